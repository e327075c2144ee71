"""ID3 by the paper's steps 1 to 6, pruned by S, with ties of gain decided exactly."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .counts import Counter, Digits
from .exact import Counts
from .gain import NodeCounts, best_position, gain_bits
from .inputs import PlacementError, check_labels, check_matrix
from .tree import Node, Tree

Rows = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class _Subset:
    """The subset C of a node to be made: its rows, class totals (K,), and its cells if they are already known."""

    rows: Rows
    totals: Counts
    cells: Counts | None = None


def grow_id3(X: npt.ArrayLike | Digits, y: npt.ArrayLike, min_samples: int = 0) -> Tree:
    """Grow the paper's tree.

    A node is terminal if its rows have one label, are fewer than `min_samples`, or agree in every input; it then
    predicts the majority class, of equal ones the lowest. An input that is constant at a node is never chosen; of
    equal gains, exactly compared, the lowest number wins. If no input has a gain, the same rule holds: the
    lowest-numbered one that varies is chosen, and the node's gain is 0.

    Parameters
    ----------
    X : array-like, shape (n, d)
        Bool or integers >= 0, with any number of values per input; or packed `Digits`.
    y : array-like, shape (n,)
        Labels that can be sorted.
    min_samples : int
        The paper's S: nodes of fewer rows decide nothing; 0 does not prune.

    Returns
    -------
    Tree
        Its `inputs` are the columns that it tests, in preorder; `gains` are in bits.

    Raises
    ------
    PlacementError
        If X or y are not such data; the message names row and column.

    Examples
    --------
    >>> from thenar.compiler import grow_id3
    >>> grow_id3([[0, 0], [0, 1], [1, 0], [1, 1]], ["pen", "pen", "cup", "cup"]).inputs
    (0,)
    """
    if min_samples < 0:
        raise PlacementError(f"min_samples is {min_samples}, a number of rows >= 0 is needed")
    digits = X if isinstance(X, Digits) else Digits.from_matrix(check_matrix(X))
    classes, labels = check_labels(y, digits.n_rows)
    nodes = _Growth(digits, labels, len(classes), min_samples).nodes()
    return Tree(tuple(nodes), tuple(classes.tolist()), digits.n_inputs, min_samples)


class _Growth:
    def __init__(self, digits: Digits, labels: npt.NDArray[np.intp], n_classes: int, min_samples: int) -> None:
        self.digits = digits
        self.counter = Counter(digits, labels, n_classes)
        self.min_samples = min_samples
        self.root = _Subset(np.arange(digits.n_rows), np.bincount(labels, minlength=n_classes))

    def nodes(self) -> list[Node]:
        """Return the nodes in preorder. A stack replaces recursion: trees may be deep."""
        nodes, waiting = [], [self.root]
        while waiting:
            node, children = self._make(waiting.pop())
            nodes.append(node)
            waiting += reversed(children)
        return nodes

    def _make(self, subset: _Subset) -> tuple[Node, list[_Subset]]:
        counts = tuple(subset.totals.tolist())
        split = self._split(subset) if self._goes_on(subset.totals) else None
        if split is None:
            return Node(counts), []
        counted, position = split
        table = counted.table(position)
        present = np.flatnonzero(table.any(axis=0))
        values = tuple(self.digits.values[position][present].tolist())
        node = Node(counts, int(self.digits.columns[position]), gain_bits(table), values)
        return node, self._children(subset.rows, counted, position, table[:, present], present)

    def _goes_on(self, totals: Counts) -> bool:
        return int(np.count_nonzero(totals)) > 1 and int(totals.sum()) >= self.min_samples

    def _split(self, subset: _Subset) -> tuple[NodeCounts, int] | None:
        if not len(self.digits.columns):
            return None
        cells = self.counter.count(subset.rows) if subset.cells is None else subset.cells
        counted = NodeCounts(subset.totals, cells, self.counter.starts)
        position = best_position(counted, self.digits.columns)
        return None if position is None else (counted, position)

    def _children(
        self, rows: Rows, counted: NodeCounts, position: int, tables: Counts, present: npt.NDArray[Any]
    ) -> list[_Subset]:
        codes = self.digits.codes(position, rows)
        parts = [rows[codes == code] for code in present]
        children = [_Subset(part, table) for part, table in zip(parts, tables.T, strict=True)]
        return self._with_known_cells(counted.cells, children)

    def _with_known_cells(self, cells: Counts, children: list[_Subset]) -> list[_Subset]:
        """Count the smaller of two children only; the larger gets the remainder of the parent's `cells`."""
        if len(children) != 2:
            return children
        small, large = (0, 1) if len(children[0].rows) <= len(children[1].rows) else (1, 0)
        if self._goes_on(children[large].totals):
            counted = self.counter.count(children[small].rows)
            rest = cells - counted
            for index, known in ((small, counted), (large, rest)):
                children[index] = _Subset(children[index].rows, children[index].totals, known)
        return children
