"""Information gain: the input that has the most of it, exactly, and how much that is.

With f(n) = n ln n, counts n_vc of class c at value v, n_v = sum over c and n = sum over v,

    n * gain = constant + sum over v of [ sum over c of f(n_vc) - f(n_v) ]

in which only the sum, the score, depends on the input. The counts are whole numbers, so where floating point cannot
separate two scores, whole-number arithmetic can (`logsums`).
"""

from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from math import fsum
from sys import float_info
from typing import Any

import numpy as np
import numpy.typing as npt

from ..elementary import log
from .logsums import sign_of_f_sum

Counts = npt.NDArray[np.int64]

_LN_2 = 0.6931471805599453
_UNIT: float = 2.0**-53


@dataclass(frozen=True, slots=True)
class Node:
    """The counts of one node: of K classes, and of its inputs' values but the first of each.

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
        """Return the tables (n_positions, K, most values of any) of several inputs, filled up with zeros."""
        stops = np.append(self.starts[1:], self.cells.shape[1])
        sizes = stops[positions] - self.starts[positions]
        offsets = np.arange(sizes.max())
        cells = np.minimum(self.starts[positions, None] + offsets, self.cells.shape[1] - 1)
        others = self.cells[:, cells] * (offsets < sizes[:, None])
        firsts = self.totals[:, None, None] - others.sum(axis=2, keepdims=True)
        return np.concatenate([firsts, others], axis=2).transpose(1, 0, 2)


def best_position(node: Node, columns: npt.NDArray[np.intp]) -> int | None:
    """Return the position of the input of maximum gain, None if no input varies at the node.

    `columns` (n_columns,) are the inputs' numbers: of equal gains, the lowest number wins.
    """
    scores, varies = _scores(node)
    if not varies.any():
        return None
    scores[~varies] = -np.inf
    close = np.flatnonzero(scores >= scores.max() - 2 * _error_bound(node))
    if len(close) == 1:
        return int(close[0])
    return _exact_best(node, close[np.argsort(columns[close])])


def _scores(node: Node) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """Return each input's score and whether it has more than one value at the node."""
    first = node.first_values()
    first_sizes, cell_sizes = first.sum(axis=0), node.cells.sum(axis=0)
    inside = _f(node.cells).sum(axis=0) - _f(cell_sizes)
    largest = cell_sizes
    if len(node.starts) != len(inside):
        inside = np.add.reduceat(inside, node.starts)
        largest = np.maximum.reduceat(largest, node.starts)
    scores = _f(first).sum(axis=0) - _f(first_sizes) + inside
    return scores, np.maximum(largest, first_sizes) < node.totals.sum()


def _f(counts: Counts) -> npt.NDArray[np.float64]:
    floats = counts.astype(np.float64)
    return np.asarray(floats * np.log(np.maximum(floats, 1.0)))


def _error_bound(node: Node) -> float:
    """Bound the error of a score.

    A term f(m) is off by 16 relative units of 2^-53 at most (the logarithm by 4 ulp, the product by half of one). The
    sum of T terms adds at most T - 1 units of the sum of their absolute values, which is at most 2 f(n), since the sum
    over v of f(n_v) is at most f(n). T is K + 1 for each value; no input has more values than all cells leave to it.
    """
    n = float(node.totals.sum())
    most_values = node.cells.shape[1] - len(node.starts) + 2
    terms: int = (len(node.totals) + 1) * most_values
    return 2 * n * float(np.log(max(n, 2.0))) * (terms + 16) * _UNIT


def _exact_best(node: Node, close: npt.NDArray[np.intp]) -> int:
    """Return the first of `close` whose score no other of them exceeds.

    Inputs with the same collection of terms tie at once; one of each collection is compared.
    """
    tables = node.tables(close)
    terms = _terms(tables)
    best, rivals = 0, np.arange(len(close))
    while True:
        rivals = rivals[(terms[rivals] != terms[rivals[0]]).any(axis=1)]
        if not len(rivals):
            return int(close[best])
        if compare_scores(tables[rivals[0]], tables[best]) > 0:
            best = int(rivals[0])


def _terms(tables: Counts) -> Counts:
    """Return the counts that stand in each table's score (n_tables, n_terms), in ascending order; f(0) = f(1) = 0."""
    parts = (np.where(part > 1, part, 0) for part in (tables.reshape(len(tables), -1), tables.sum(axis=1)))
    return np.concatenate([np.sort(part, axis=1) for part in parts], axis=1)


def compare_scores(one: npt.NDArray[Any], other: npt.NDArray[Any]) -> int:
    """Return the sign of score(one) - score(other), exactly; tables (K, n_values) of whole counts."""
    difference: Counter[int] = Counter()
    for table, sign in ((one, 1), (other, -1)):
        for count in table.ravel().tolist():
            difference[count] += sign
        for count in table.sum(axis=0).tolist():
            difference[count] -= sign
    return sign_of_f_sum(difference)


def gain_bits(table: Counts) -> float:
    """Return the information gain, in bits, of an input with `table` (K, n_values); exactly 0.0 where it is zero.

    The same bits on every machine: logarithms are evaluated by IEEE operations of one order, and `fsum` rounds once.
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
    # However small, it is not zero.
    return max(fsum(terms) / (n * _LN_2), float_info.min)


def entropy_bits(totals: list[int]) -> float:
    """Return H(C), in bits, of the class counts `totals`; as reproducible as `gain_bits`."""
    n = sum(totals)
    return max(fsum([_n_log_n(n), *(-_n_log_n(m) for m in totals)]) / (n * _LN_2), 0.0)


@lru_cache(maxsize=1 << 16)
def _n_log_n(n: int) -> float:
    return n * float(log(np.array(float(n)))) if n > 1 else 0.0
