"""ID3 by the paper's steps 1 to 6, pruned by S, with ties of gain decided exactly."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from .exact import Counts
from .gain import CellCounter, NodeCounts, best_position, gain_bits
from .inputs import PlacementError, check_labels, check_matrix
from .tree import Node, Tree

Rows = npt.NDArray[np.intp]


def grow_id3(X: npt.ArrayLike, y: npt.ArrayLike, min_samples: int = 0) -> Tree:
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
