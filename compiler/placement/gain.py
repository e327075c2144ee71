"""Information gain: find the input with the most gain, or the most gain per cost, exactly, and compute that gain.

With f(n) = n ln n, counts n_vc of class c at value v, n_v and n_c their sums and n the number of rows,

    n * gain = f(n) - sum over c of f(n_c) + sum over v of [ sum over c of f(n_vc) - f(n_v) ]

in which only the sum over v, the score, depends on the input. If floating point cannot separate two inputs, integer
arithmetic does (`exact`).
"""

from dataclasses import dataclass
from functools import lru_cache
from math import fsum
from sys import float_info
from typing import Any

import numpy as np
import numpy.typing as npt

from ..elementary import LN_2, log
from .exact import Counts, Floats, compare, error_bound, first_best, n_log_n


@dataclass(frozen=True, slots=True)
class NodeCounts:
    """The counts of one node: of K classes, and of all values of its inputs except the first.

    totals  (K,) rows of each class
    cells   (K, n_cells) rows of each class at each value
    starts  (n_columns,) each input's first cell
    """

    totals: Counts
    cells: Counts
    starts: npt.NDArray[np.intp]

    def first_values(self) -> Counts:
        """Return (K, n_columns) rows of each class at the first value of each input."""
        columns = len(self.starts)
        rest = self.cells if columns == self.cells.shape[1] else np.add.reduceat(self.cells, self.starts, axis=1)
        return self.totals[:, None] - rest

    def table(self, position: int) -> Counts:
        """Return (K, n_values) rows of each class at each value of one input."""
        table: Counts = self.tables(np.array([position]))[0]
        return table

    def tables(self, positions: npt.NDArray[np.intp]) -> Counts:
        """Return the tables (n_positions, K, most values of any) of several inputs, padded with zeros."""
        stops = np.append(self.starts[1:], self.cells.shape[1])
        sizes = stops[positions] - self.starts[positions]
        offsets = np.arange(sizes.max())
        cells = np.minimum(self.starts[positions, None] + offsets, self.cells.shape[1] - 1)
        others = self.cells[:, cells] * (offsets < sizes[:, None])
        firsts = self.totals[:, None, None] - others.sum(axis=2, keepdims=True)
        return np.concatenate([firsts, others], axis=2).transpose(1, 0, 2)


# Rows counted together: as float32 they stay in a processor's cache, and their counts are exact.
_BLOCK = 4096


class CellCounter:
    """Counts cells at nodes: subsets of the rows of X (n, d), bool or ints >= 0, of class numbers `labels` (n,).

    columns  (n_columns,) the inputs of several values; if X holds bits only, all of them
    values   for each of `columns`, its values in ascending order: all but the first are cells
    starts   (n_columns,) the first cell of each of `columns`
    """

    def __init__(self, X: npt.NDArray[Any], labels: npt.NDArray[np.intp], n_classes: int) -> None:
        self.X, self._labels, self._classes = X, labels, np.arange(n_classes)[:, np.newaxis]
        if X.dtype == np.bool_ or not X.size or X.max() <= 1:
            self.columns, self._cells = np.arange(X.shape[1]), X.astype(np.bool_, copy=False)
            self.values = [np.arange(2)] * X.shape[1]
        else:
            values = [np.unique(column) for column in X.T]
            self.columns = np.flatnonzero([len(each) > 1 for each in values])
            self.values = [values[column] for column in self.columns]
            cells = [X[:, [column]] == values[column][1:] for column in self.columns]
            self._cells = np.concatenate(cells, axis=1)
        self.starts = np.cumsum([0, *(len(each) - 1 for each in self.values)])[:-1].astype(np.intp)

    def count(self, rows: npt.NDArray[np.intp]) -> Counts:
        """Return the cells (n_classes, n_cells) of the node that holds `rows`."""
        counts = np.zeros((len(self._classes), self._cells.shape[1]), np.int64)
        for start in range(0, len(rows), _BLOCK):
            block = rows[start : start + _BLOCK]
            member = (self._labels[block] == self._classes).astype(np.float32)
            counts += (member @ self._cells[block].astype(np.float32)).astype(np.int64)
        return counts


def best_position(node: NodeCounts, columns: npt.NDArray[np.intp]) -> int | None:
    """Return the position of the input of maximum gain, None if no input varies at the node.

    `columns` (n_columns,) are the inputs' numbers: of equal gains, the lowest number wins.
    """
    scores, varies = _scores(node)
    if not varies.any():
        return None
    scores[~varies] = -np.inf
    close = np.flatnonzero(scores >= scores.max() - 2 * _score_bound(node))
    if len(close) == 1:
        return int(close[0])
    close = close[np.argsort(columns[close])]
    tables = node.tables(close)
    return int(close[first_best(tables.reshape(len(close), -1), tables.sum(axis=1))])


def best_per_cost(node: NodeCounts, costs: Counts) -> int | None:
    """Return the number of the switch of largest gain / cost at `node` of bits, None if none varies there.

    costs (d,) are integers > 0. Of equal switches the cheapest wins, then the lowest number.
    """
    scores, varies = _scores(node)
    varying = np.flatnonzero(varies)
    if not len(varying):
        return None
    n, classes = int(node.totals.sum()), len(node.totals)
    own = float(n_log_n(np.array(n)) - n_log_n(node.totals).sum())
    gains = (scores[varying] + own) / costs[varying]
    # Two values: 3 (K + 1) terms, whose absolute values are f(n) in sum over the classes, values, both, and rows.
    slack = error_bound(n, 3 * (classes + 1), 4) / costs[varying]
    close = varying[gains + slack >= (gains - slack).max()]
    close = close[np.lexsort((close, costs[close]))]
    return int(close[first_of_most_gain(node.tables(close), costs[close])])


def first_of_most_gain(tables: Counts, costs: Counts | None = None) -> int:
    """Return the first of the tables (m, K, values) with the largest n * gain, or n * gain / cost, compared exactly.

    The tables may be of any nodes. Costs must not descend.
    """
    plus = np.column_stack([tables.reshape(len(tables), -1), tables.sum(axis=(1, 2))])
    minus = np.column_stack([tables.sum(axis=1), tables.sum(axis=2)])
    return first_best(plus, minus, costs)


def _scores(node: NodeCounts) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Return each input's score and whether it has more than one value at the node."""
    first = node.first_values()
    first_sizes, cell_sizes = first.sum(axis=0), node.cells.sum(axis=0)
    inside = n_log_n(node.cells).sum(axis=0) - n_log_n(cell_sizes)
    largest = cell_sizes
    if len(node.starts) != len(inside):
        inside = np.add.reduceat(inside, node.starts)
        largest = np.maximum.reduceat(largest, node.starts)
    scores = n_log_n(first).sum(axis=0) - n_log_n(first_sizes) + inside
    return scores, np.maximum(largest, first_sizes) < node.totals.sum()


def _score_bound(node: NodeCounts) -> float:
    """Bound the error of a score: it has K + 1 terms for each value, whose absolute values are 2 f(n) in sum, since the
    sum over v of f(n_v) is at most f(n). An input has at most the values that all cells leave to it.
    """
    most_values = node.cells.shape[1] - len(node.starts) + 2
    return error_bound(int(node.totals.sum()), (len(node.totals) + 1) * most_values, 2)


def compare_scores(one: npt.NDArray[Any], other: npt.NDArray[Any]) -> int:
    """Return the exact sign of score(one) - score(other); tables (K, n_values) of integer counts."""
    return compare(one, one.sum(axis=0), other, other.sum(axis=0))


def gain_bits(table: Counts) -> float:
    """Return the information gain, in bits, of an input with `table` (K, n_values); exactly 0.0 if it is zero.

    The result has the same bits on every machine: logarithms use IEEE operations in a fixed order, and `fsum` rounds
    once.
    """
    totals, sizes = table.sum(axis=1).tolist(), table.sum(axis=0).tolist()
    n: int = sum(totals)
    counts = table.tolist()
    if all(
        m * n == total * size
        for row, total in zip(counts, totals, strict=True)
        for m, size in zip(row, sizes, strict=True)
    ):
        return 0.0
    terms = [_n_log_n(m) for row in counts for m in row] + [_n_log_n(n)]
    terms += [-_n_log_n(m) for m in totals + sizes]
    # A gain that is not zero must not round to zero.
    return max(fsum(terms) / (n * LN_2), float_info.min)


def entropy_bits(totals: list[int]) -> float:
    """Return H(C), in bits, of the class counts `totals`; as reproducible as `gain_bits`."""
    n = sum(totals)
    return max(fsum([_n_log_n(n), *(-_n_log_n(m) for m in totals)]) / (n * LN_2), 0.0)


@lru_cache(maxsize=1 << 16)
def _n_log_n(n: int) -> float:
    return float(n_log_n(np.array(n), log))
