"""Information about the class from counts: the input with the most gain, or the most gain per cost, exactly.

With f(m) = m ln m, counts n_vc of class c at value v, n_v and n_c their sums and n the number of rows,

    n * gain = f(n) - sum over c of f(n_c) + sum over v of [ sum over c of f(n_vc) - f(n_v) ]

in which only the sum over v, the score, depends on the input. The information of a bit a given a bit b is, with the
counts n_cab of class c and values of a and b,

    n * I(class; a | b) = sum f(n_cab) - sum f(n_ab) - sum f(n_cb) + sum f(n_b);    without b, as if b were constant

If floating point cannot separate two such sums, they are compared by their signs as integer multiples of logarithms.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Context, Decimal
from functools import lru_cache
from math import fsum, gcd
from math import log as ln
from sys import float_info
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..elementary import LN_2, Floats, log

Counts = NDArray[np.int64]

UNIT: float = 2.0**-53
_FIRST_DIGITS = 40


def n_log_n(counts: NDArray[Any], logarithm: Callable[[Floats], Floats] = np.log) -> Floats:
    """Return f(m) = m ln m of every count; f(0) = 0."""
    floats = counts.astype(np.float64)
    return np.asarray(floats * logarithm(np.maximum(floats, 1.0)))


def error_bound(n: int, terms: int, times: int) -> float:
    """Bound the error of a floating-point sum of f over `terms` counts, whose absolute values add up to times * f(n).

    A term f(m) is off by 16 relative units of 2^-53 at most: the logarithm by 4 ulp, which are 8 units, and the product
    by half of one, which is 1 unit. The 7 units left cover a division of the sum by a cost, and the comparison. The sum
    adds at most terms - 1 units of the sum of the absolute values.
    """
    rows = float(max(n, 2))
    return times * rows * ln(rows) * (terms + 16) * UNIT


def first_best(plus: Counts, minus: Counts, costs: Counts | None = None) -> int:
    """Return the first candidate of maximum value, compared exactly.

    A candidate's value is the sum of f over its row of `plus` (candidates, p), less that over its row of `minus`
    (candidates, q), divided by its cost: an integer > 0 (None: all cost the same). Values must be at least 0; costs
    that differ must ascend.
    """
    # f(0) = f(1) = 0. Among candidates of the same counts, the first is the cheapest.
    parts = (np.where(part > 1, part, 0) for part in (plus, minus))
    terms = np.concatenate([np.sort(part, axis=1) for part in parts], axis=1)
    prices = [1] * len(terms) if costs is None else costs.tolist()
    best, others = 0, np.arange(len(terms))
    while True:
        others = others[(terms[others] != terms[others[0]]).any(axis=1)]
        if not len(others):
            return best
        other = int(others[0])
        if compare(plus[other], minus[other], plus[best], minus[best], prices[best], prices[other]) > 0:
            best = other


def compare(
    plus: Counts, minus: Counts, other_plus: Counts, other_minus: Counts, times: int = 1, other_times: int = 1
) -> int:
    """Return the exact sign of times * (f(plus) - f(minus)) - other_times * (f(other_plus) - f(other_minus)), where f
    of counts is the sum over them.
    """
    difference: Counter[int] = Counter()
    for counts, factor in ((plus, times), (minus, -times), (other_plus, -other_times), (other_minus, other_times)):
        for count in counts.ravel().tolist():
            difference[count] += factor
    return sign_of_log_sum({n: n * factor for n, factor in difference.items() if n})


def sign_of_log_sum(multiples: Mapping[int, int]) -> int:
    """Return the sign, -1, 0 or 1, of the sum over m of multiples[m] * ln m, for integers m >= 1.

    The sum is zero exactly if the product of all m ** multiples[m] is 1, which the exponents over a base of pairwise
    coprime numbers decide. Otherwise decimal arithmetic of rising precision finds the sign after finitely many steps.
    """
    terms = {m: times for m, times in multiples.items() if times and m > 1}
    base = _coprime_base(list(terms))
    if all(sum(times * _multiplicity(m, factor) for m, times in terms.items()) == 0 for factor in base):
        return 0
    digits = _FIRST_DIGITS
    while True:
        total, bound = _log_sum(terms, digits)
        if total.copy_abs() > bound:
            return 1 if total > 0 else -1
        digits *= 2


def _coprime_base(numbers: list[int]) -> list[int]:
    """Return pairwise coprime numbers > 1 such that each of `numbers` is a product of their powers."""
    base: list[int] = []
    todo = list(numbers)
    while todo:
        number = todo.pop()
        meets = next((factor for factor in base if gcd(factor, number) > 1), None)
        if number == 1 or number in base:
            continue
        if meets is None:
            base.append(number)
        else:
            common = gcd(meets, number)
            base.remove(meets)
            todo += [common, meets // common, number // common]
    return base


def _multiplicity(number: int, factor: int) -> int:
    times = 0
    while number % factor == 0:
        number //= factor
        times += 1
    return times


def _log_sum(terms: Mapping[int, int], digits: int) -> tuple[Decimal, Decimal]:
    """Return the sum in decimal arithmetic and a bound on its error.

    Logarithm, product and each addition are correctly rounded: at most (number of terms + 2) errors of relative size
    10^(1 - digits), each of at most the sum of the terms' absolute values; twice that covers their products.
    """
    context = Context(prec=digits)
    total = size = Decimal(0)
    for m, times in terms.items():
        term = context.multiply(Decimal(times), context.ln(Decimal(m)))
        total = context.add(total, term)
        size = context.add(size, context.abs(term))
    error = context.multiply(size, Decimal(2 * (len(terms) + 2)))
    return total, context.scaleb(error, 1 - digits)


@dataclass(frozen=True, slots=True)
class NodeCounts:
    """The counts of one node: of K classes, and of all values of its inputs except the first.

    totals  (K,) rows of each class
    cells   (K, n_cells) rows of each class at each value
    starts  (n_columns,) each input's first cell
    """

    totals: Counts
    cells: Counts
    starts: NDArray[np.intp]

    def table(self, position: int) -> Counts:
        """Return (K, n_values) rows of each class at each value of one input."""
        table: Counts = self.tables(np.array([position]))[0]
        return table

    def tables(self, positions: NDArray[np.intp]) -> Counts:
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

    def __init__(self, X: NDArray[Any], labels: NDArray[np.intp], n_classes: int) -> None:
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

    def count(self, rows: NDArray[np.intp]) -> Counts:
        """Return the cells (n_classes, n_cells) of the node that holds `rows`."""
        counts = np.zeros((len(self._classes), self._cells.shape[1]), np.int64)
        for start in range(0, len(rows), _BLOCK):
            block = rows[start : start + _BLOCK]
            member = (self._labels[block] == self._classes).astype(np.float32)
            # OpenBLAS may set this flag for finite numbers (numpy issue 24067).
            with np.errstate(invalid="ignore"):
                counts += (member @ self._cells[block].astype(np.float32)).astype(np.int64)
        return counts


def best_position(node: NodeCounts, columns: NDArray[np.intp]) -> int | None:
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
    varying = np.flatnonzero(_scores(node)[1])
    if not len(varying):
        return None
    varying = varying[np.lexsort((varying, costs[varying]))]
    return int(varying[first_of_most_gain(node.tables(varying), costs[varying])])


def first_of_most_gain(tables: Counts, costs: Counts | None = None) -> int:
    """Return the first of the tables (m, K, values) with the largest n * gain, or n * gain / cost, compared exactly.

    The tables may be of any nodes. Costs must not descend.
    """
    plus = np.column_stack([tables.reshape(len(tables), -1), tables.sum(axis=(1, 2))])
    minus = np.column_stack([tables.sum(axis=1), tables.sum(axis=2)])
    prices = np.ones(len(tables), np.int64) if costs is None else costs
    gains = (n_log_n(plus).sum(axis=1) - n_log_n(minus).sum(axis=1)) / prices
    # The absolute values of the terms are f(n) in sum over the cells, classes, values, and rows.
    slack = error_bound(int(plus.max()), plus.shape[1] + minus.shape[1], 4) / prices
    close = np.flatnonzero(gains + slack >= (gains - slack).max())
    return int(close[first_best(plus[close], minus[close], None if costs is None else costs[close])])


def _scores(node: NodeCounts) -> tuple[Floats, NDArray[np.bool_]]:
    """Return each input's score and whether it has more than one value at the node."""
    of_bits = len(node.starts) == node.cells.shape[1]
    first = node.totals[:, None] - (node.cells if of_bits else np.add.reduceat(node.cells, node.starts, axis=1))
    first_sizes, cell_sizes = first.sum(axis=0), node.cells.sum(axis=0)
    inside = n_log_n(node.cells).sum(axis=0) - n_log_n(cell_sizes)
    largest = cell_sizes
    if not of_bits:
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


class Cooccurrence:
    """Counts of all pairs of bits X (n, d) bool, and of each in `ones`, in every one of n_classes classes `labels`."""

    def __init__(self, X: NDArray[np.bool_], labels: NDArray[np.intp], n_classes: int) -> None:
        self._X, self._labels, self._counter = X, labels, CellCounter(X, labels, n_classes)
        self._totals = np.bincount(labels, minlength=n_classes)
        self.ones = self._counter.count(np.arange(len(X)))
        ones = self.ones.sum(axis=0)
        self.varying = np.flatnonzero((ones > 0) & (ones < len(X)))
        # Four sums, each of at most n ln n, of 6 (K + 1) terms together.
        self.error_bound = error_bound(len(X), 6 * (n_classes + 1), 4)

    def information(self, given: int | None = None) -> Floats:
        """Return n * I(class; a | given) for every bit a, (d,), in nats."""
        ones = self.ones
        tables = np.stack([self._totals[:, np.newaxis] - ones, ones], axis=2)[..., np.newaxis]
        if given is not None:
            # The counts of rows in which the given bit is set, and of the others.
            inside = np.flatnonzero(self._X[:, given])
            totals, ones = np.bincount(self._labels[inside], minlength=len(ones)), self._counter.count(inside)
            part = np.stack([totals[:, np.newaxis] - ones, ones], axis=2)[..., np.newaxis]
            tables = np.concatenate([tables - part, part], axis=3)
        cells, bits, classes, rest = (n_log_n(part).sum(axis=(0, 2, 3)) for part in _parts(tables))
        return np.asarray(cells - bits - classes + rest)

    def sign(self, one: tuple[int, int | None], other: tuple[int, int | None]) -> int:
        """Return the sign of I(class; a | b) of pair `one` minus that of pair `other`, exactly."""
        return compare(*self._terms(*one), *self._terms(*other))

    def _terms(self, bit: int, given: int | None) -> tuple[Counts, Counts]:
        """Return the counts whose f are added in n * I(class; bit | given), and those whose f are subtracted."""
        value = 2 * self._X[:, bit] + (0 if given is None else self._X[:, given])
        counts = np.bincount(4 * self._labels + value, minlength=4 * len(self._totals))
        cells, bits, classes, rest = (part.ravel() for part in _parts(counts.reshape(-1, 1, 2, 2)))
        return np.concatenate([cells, rest]), np.concatenate([bits, classes])


def _parts(tables: Counts) -> tuple[Counts, Counts, Counts, Counts]:
    """Return the counts of the four sums, each of four axes: class, bit, its value, value of the given bit."""
    return (
        tables,
        tables.sum(axis=0, keepdims=True),
        tables.sum(axis=2, keepdims=True),
        tables.sum(axis=(0, 2), keepdims=True),
    )
