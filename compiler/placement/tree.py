"""The paper's ID3: a decision tree by its steps 1 to 6, pruned by S, that predicts and prints.

Ties of gain are decided exactly. Nodes are in preorder: a node, then its children's subtrees in the order of their
values. That order and each node's number of values determine the children.
"""

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..samples import TrainingError
from ..text import counted
from .gain import CellCounter, Counts, NodeCounts, best_position, gain_bits

Label = bool | int | float | str
Rows = NDArray[np.intp]


class Node(msgspec.Struct, frozen=True):
    """One node: `counts` of its rows by class; a decision node also has the number of its `input`, the input's gain
    there in bits, and the `values` it takes there, ascending, with a child for each.
    """

    counts: tuple[int, ...]
    input: int | None = None
    gain: float = 0.0
    values: tuple[int, ...] = ()

    @property
    def size(self) -> int:
        """Number of rows at the node."""
        return sum(self.counts)

    @property
    def majority(self) -> int:
        """Class number of most rows; of several, the lowest."""
        return self.counts.index(max(self.counts))

    @property
    def gains_nothing(self) -> bool:
        """Whether this is a decision at which no input has a gain alone."""
        return self.input is not None and self.gain == 0


class Tree(msgspec.Struct, frozen=True, dict=True):
    """An ID3 tree over `n_inputs` inputs: nodes in preorder, classes in ascending order, pruned by `min_samples`."""

    nodes: tuple[Node, ...]
    classes: tuple[Label, ...]
    n_inputs: int
    min_samples: int = 0

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """For each node, the numbers of its children, in the order of their values."""
        found: list[list[int]] = [[] for _ in self.nodes]
        for number, parent in enumerate(self.parents):
            if parent >= 0:
                found[parent].append(number)
        return tuple(map(tuple, found))

    @cached_property
    def parents(self) -> tuple[int, ...]:
        """For each node, the number of its parent; -1 for the root."""
        parents, waiting = [], [-1]
        for number, node in enumerate(self.nodes):
            parents.append(waiting.pop())
            waiting += [number] * len(node.values)
        return tuple(parents)

    @cached_property
    def depths(self) -> tuple[int, ...]:
        """For each node, the number of decisions above it."""
        depths: list[int] = []
        for parent in self.parents:
            depths.append(depths[parent] + 1 if parent >= 0 else 0)
        return tuple(depths)

    @property
    def inputs(self) -> tuple[int, ...]:
        """The placement: numbers of the inputs that label decision nodes, in the order of the nodes, each once."""
        return tuple(self._gain_of_input)

    @property
    def gains(self) -> tuple[float, ...]:
        """Each input's gain, in bits: the sum over its nodes of |C| / n * gain."""
        return tuple(self._gain_of_input.values())

    @cached_property
    def _gain_of_input(self) -> dict[int, float]:
        brought: dict[int, float] = {}
        for node in self.nodes:
            if node.input is not None:
                share = node.gain * node.size / self.nodes[0].size
                brought[node.input] = brought.get(node.input, 0.0) + share
        return brought

    @property
    def depth(self) -> int:
        """Largest number of decisions on a path from the root to a leaf."""
        return max(self.depths)

    @property
    def n_leaves(self) -> int:
        """Number of leaves."""
        return sum(node.input is None for node in self.nodes)

    @property
    def n_zero_gain(self) -> int:
        """Number of decision nodes at which no input has a gain alone, as in XOR."""
        return sum(node.gains_nothing for node in self.nodes)

    @property
    def n_undecided(self) -> int:
        """Number of leaves of several classes whose rows agree in every input; pruned leaves do not count."""
        leaves = (node for node in self.nodes if node.input is None)
        return sum(max(leaf.counts) < leaf.size and leaf.size >= self.min_samples for leaf in leaves)

    def remarks(self, what: str = "input") -> Iterator[str]:
        """Yield warnings: decisions without a gain, and leaves that no input can split."""
        if self.n_zero_gain:
            yield (
                f"at {counted(self.n_zero_gain, 'node')} no {what} gains anything alone, "
                "the lowest-numbered varying one was taken"
            )
        if self.n_undecided:
            leaves = counted(self.n_undecided, "leaf", "leaves")
            yield f"at {leaves} rows of several classes agree in every {what}"

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """Return the label (n,) of each row of X (n, n_inputs); an unseen value gets the node's majority."""
        matrix = check_matrix(X)
        if matrix.shape[1] != self.n_inputs:
            raise TrainingError(f"X has {matrix.shape[1]} inputs, the tree was grown on {self.n_inputs}")
        labels = np.zeros(len(matrix), dtype=np.intp)
        rows_of = {0: np.arange(len(matrix))}
        for number, node in enumerate(self.nodes):
            rows = rows_of.pop(number, None)
            if rows is None:
                continue
            labels[rows] = node.majority
            if node.input is not None:
                column = matrix[rows, node.input]
                for value, child in zip(node.values, self.children[number], strict=True):
                    if (below := rows[column == value]).size:
                        rows_of[child] = below
        return np.array(self.classes)[labels]

    def text(self, names: Sequence[str] = (), class_names: Sequence[str] = ()) -> str:
        """Return the tree as text, one line per node; names default to x0, x1 ... and `classes`.

        Raises TrainingError if there are names, but not one for each.
        """
        names, class_names = names_for(self, names, class_names)
        lines = []
        # The node's number, and the prefixes of its line and of its children's lines.
        waiting = [(0, "", "")]
        while waiting:
            number, lead, below = waiting.pop()
            node, children = self.nodes[number], self.children[number]
            lines.append(lead + node_text(node, names, class_names))
            for value, child in zip(reversed(node.values), reversed(children), strict=True):
                last = child == children[-1]
                waiting.append(
                    (child, f"{below}{'└─' if last else '├─'} {value}: ", below + ("   " if last else "│  "))
                )
        pruned = f", pruned at S = {self.min_samples}" if self.min_samples else ""
        summary = (
            f"{len(self.inputs)} of {self.n_inputs} inputs, {len(self.nodes)} nodes, {self.n_leaves} leaves, "
            f"depth {self.depth}{pruned}"
        )
        return "\n".join([*lines, "; ".join([summary, *self.remarks()])])


def grow_id3(X: ArrayLike, y: ArrayLike, min_samples: int = 0) -> Tree:
    """Grow the paper's tree.

    A node is terminal if its rows have one label, are fewer than `min_samples`, or agree in every input; it then
    predicts the majority class, of equal ones the lowest. An input that is constant at a node is never chosen; of
    equal gains, exactly compared, the lowest number wins. If no input has a gain, the same rule holds: the
    lowest-numbered one that varies is chosen, and the node's gain is 0.

    Parameters
    ----------
    X : array-like, shape (n, d)
        Bool or integers >= 0, with any number of values per input.
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
    TrainingError
        If X or y are not such data; the message names row and column.

    Examples
    --------
    >>> from thenar.compiler import grow_id3
    >>> grow_id3([[0, 0], [0, 1], [1, 0], [1, 1]], ["pen", "pen", "cup", "cup"]).inputs
    (0,)
    """
    if min_samples < 0:
        raise TrainingError(f"min_samples is {min_samples}, a number of rows >= 0 is needed")
    matrix = check_matrix(X)
    classes, labels = check_labels(y, len(matrix))
    nodes = _nodes(CellCounter(matrix, labels, len(classes)), np.bincount(labels), min_samples)
    return Tree(tuple(nodes), tuple(classes.tolist()), matrix.shape[1], min_samples)


def _nodes(counter: CellCounter, totals: Counts, min_samples: int) -> Iterator[Node]:
    """Yield the nodes in preorder; `totals` (K,) are the rows of each class. A stack replaces recursion: trees may be
    deep.
    """
    # The rows of each node to be made, its class totals, and its cells if they are already known.
    waiting: list[tuple[Rows, Counts, Counts | None]] = [(np.arange(len(counter.X)), totals, None)]
    while waiting:
        rows, totals, cells = waiting.pop()
        position = None
        if len(counter.columns) and _goes_on(totals, min_samples):
            cells = counter.count(rows) if cells is None else cells
            counted = NodeCounts(totals, cells, counter.starts)
            position = best_position(counted, counter.columns)
        if position is None:
            yield Node(tuple(totals.tolist()))
            continue
        table = counted.table(position)
        present = np.flatnonzero(table.any(axis=0))
        column, values = int(counter.columns[position]), counter.values[position][present]
        yield Node(tuple(totals.tolist()), column, gain_bits(table), tuple(values.tolist()))
        taken = counter.X[rows, column]
        parts, tables = [rows[taken == value] for value in values], table[:, present].T
        known: list[Counts | None] = [None] * len(parts)
        small, *others = np.argsort([len(part) for part in parts], kind="stable").tolist()
        if len(others) == 1 and _goes_on(tables[others[0]], min_samples):
            # Count the smaller of two children only; the larger gets the rest.
            known[small] = counter.count(parts[small])
            known[others[0]] = counted.cells - known[small]
        waiting += reversed(list(zip(parts, tables, known, strict=True)))


def _goes_on(totals: Counts, min_samples: int) -> bool:
    return int(np.count_nonzero(totals)) > 1 and int(totals.sum()) >= min_samples


def names_for(tree: Tree, names: Sequence[str], class_names: Sequence[str]) -> tuple[Sequence[str], Sequence[str]]:
    """Return a name for each input and each class: those given, or numbers and labels."""
    names = names or [f"x{number}" for number in range(tree.n_inputs)]
    class_names = class_names or [str(label) for label in tree.classes]
    if len(names) != tree.n_inputs or len(class_names) != len(tree.classes):
        raise TrainingError(
            f"{len(names)} input and {len(class_names)} class names were given, "
            f"the tree has {tree.n_inputs} inputs and {len(tree.classes)} classes"
        )
    return names, class_names


def node_text(node: Node, names: Sequence[str], class_names: Sequence[str]) -> str:
    """Return one node in words."""
    if node.input is not None:
        gain = "no input gains anything alone" if node.gains_nothing else f"gain {node.gain:.4g} bits"
        return f"{names[node.input]}?  {node.size} rows, {gain}"
    most = max(node.counts)
    return f"{class_names[node.majority]}  {most if most == node.size else f'{most} of {node.size}'} rows"


_WHOLE = "not a whole number >= 0"


def check_matrix(X: ArrayLike) -> NDArray[Any]:
    """Return X (n, d) as an array of bool or int, all values >= 0; floats with integer values become ints.

    Raises TrainingError that names row and column of the first other entry.
    """
    matrix = np.asarray(X)
    if matrix.ndim != 2:
        raise TrainingError(f"X has {matrix.ndim} dimensions, (rows, inputs) are needed")
    if matrix.dtype.kind not in "biuf":
        raise TrainingError(f"X holds {matrix.dtype}, bits or non-negative whole numbers are needed")
    if matrix.dtype.kind == "f":
        # Comparisons with NaN are false, so this finds NaN as well.
        _refuse(~((matrix >= 0) & (matrix < 2**62) & (matrix == np.floor(matrix))), matrix, _WHOLE)
        return matrix.astype(np.int64)
    if matrix.dtype.kind == "i" and matrix.size and matrix.min() < 0:
        _refuse(matrix < 0, matrix, _WHOLE)
    return matrix


def _refuse(bad: NDArray[np.bool_], matrix: NDArray[Any], why: str) -> None:
    if bad.any():
        row, column = (int(index) for index in np.argwhere(bad)[0])
        raise TrainingError(f"X holds {matrix[row, column]} in row {row}, column {column}: {why}")


def check_labels(y: ArrayLike, n_rows: int) -> tuple[NDArray[Any], NDArray[np.intp]]:
    """Return the sorted classes (K,) of y and the class number of each row (n,).

    Raises TrainingError if y is empty, does not have one label for each row, holds NaN or infinity, or cannot be
    sorted.
    """
    labels = np.asarray(y)
    if labels.shape != (n_rows,):
        raise TrainingError(f"y has shape {labels.shape}, one label for each of the {n_rows} rows of X is needed")
    if not n_rows:
        raise TrainingError("there are no rows: a placement needs at least one labelled grasp")
    strange = ~np.isfinite(labels) if labels.dtype.kind == "f" else np.zeros(n_rows, np.bool_)
    if labels.dtype.kind == "O":
        strange = np.array([isinstance(label, float) and not math.isfinite(label) for label in labels.tolist()])
    if strange.any():
        row = int(strange.argmax())
        raise TrainingError(f"y is {labels[row]} in row {row}: every row needs a label")
    try:
        classes, numbers = np.unique(labels, return_inverse=True)
    except TypeError as mixed:
        raise TrainingError(f"the labels in y cannot be sorted ({mixed}): use text or numbers, not both") from None
    return classes, numbers
