"""Columns as bins between neighbouring values, and the sums of weights and responses left of every split.

A column of two values is a row of an indicator matrix: all such columns and all classes are summed by one matrix
product. A column of more values, or with missing ones, is a one-hot block: one sparse product sums its bins, a running
sum its splits.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Floats = NDArray[np.float64]

# Elements of the histograms of one batch of many-valued columns: 32 MiB of doubles, whatever the number of rows.
_BATCH_ELEMENTS = 1 << 22
# Of the columns that are looked at together: 8 MiB of doubles.
_BLOCK_ELEMENTS = 1 << 20


@dataclass(frozen=True, slots=True)
class SplitSums:
    """Sums of a batch of c columns of at most B - 1 splits, over R summands: exact integers.

    Splits come first, so that the running sum over them adds long rows.
    """

    columns: NDArray[np.intp]  # (c,) ascending
    left: Floats  # (B - 1, c, R) rows with a value at or below the split
    missing: Floats | None  # (c, R)
    valid: NDArray[np.bool_] | None  # (B - 1, c) which splits exist; None: all


@dataclass(frozen=True)
class TwoValued:
    """Columns that take exactly two values and are never missing."""

    columns: NDArray[np.intp]  # (c,)
    low: NDArray[np.bool_]  # (c, n) value is the lower one
    thresholds: Floats  # (c,)

    @cached_property
    def _indicator(self) -> Floats:
        return self.low.astype(np.float64)

    def sums(self, summands: Floats) -> Iterator[SplitSums]:
        """Yield the sums of `summands` (R, n)."""
        left = self._indicator @ summands.T
        yield SplitSums(self.columns, left[np.newaxis], None, None)

    def goes_left(self, position: int, split: int) -> NDArray[np.bool_]:
        """Return (n,) whether each row lies left of the only split of column number `position` of this group."""
        rows: NDArray[np.bool_] = self.low[position]
        return rows

    def is_missing(self, position: int) -> None:
        """Nothing is missing here."""
        return

    def n_splits(self, position: int) -> int:
        """One."""
        return 1

    def threshold(self, position: int, split: int) -> float:
        """Return the value between the two of the column."""
        return float(self.thresholds[position])


class ManyValued:
    """Columns of three or more values, or with missing ones."""

    def __init__(self, columns: list[int], bins: list[NDArray[np.int32]], edges: list[Floats]) -> None:
        """`bins` (n,) a column, the last bin number (len(edges) + 1) standing for missing; `edges` the splits."""
        self.columns = np.array(columns, dtype=np.intp)
        self._bins = bins
        self._edges = edges
        self._batches: list[tuple[slice, int, csr_array]] = []

    def sums(self, summands: Floats) -> Iterator[SplitSums]:
        """Yield the sums of `summands` (R, n), a batch of columns at a time."""
        if not self._batches:
            self._batches = list(self._one_hot(len(summands)))
        by_row = np.ascontiguousarray(summands.T)
        for batch, width, one_hot in self._batches:
            histogram = (one_hot @ by_row).reshape(width + 1, -1, len(summands))
            splits = np.array([len(edges) for edges in self._edges[batch]])
            valid = np.arange(width - 1)[:, np.newaxis] < splits
            # Row by row: numpy's cumsum over a first axis walks down it element by element, five times slower.
            for row in range(1, width - 1):
                histogram[row] += histogram[row - 1]
            yield SplitSums(self.columns[batch], histogram[: width - 1], histogram[width], valid)

    def goes_left(self, position: int, split: int) -> NDArray[np.bool_]:
        """Return (n,) whether each row lies left of a split of column number `position` of this group."""
        return self._bins[position] <= split

    def is_missing(self, position: int) -> NDArray[np.bool_]:
        """Return (n,) whether the column has no value."""
        absent: NDArray[np.bool_] = self._bins[position] == len(self._edges[position]) + 1
        return absent

    def n_splits(self, position: int) -> int:
        """In how many places column number `position` of this group may be split."""
        return len(self._edges[position])

    def threshold(self, position: int, split: int) -> float:
        """Return the value between the two that the split parts."""
        return float(self._edges[position][split])

    def _one_hot(self, n_summands: int) -> Iterator[tuple[slice, int, "csr_array"]]:
        """Yield (columns, bins W of the widest, one-hot matrix ((W + 1) * c, n)); bin W holds the missing rows."""
        start = 0
        while start < len(self._bins):
            stop, width = start, 0
            while stop < len(self._bins):
                wider = max(width, len(self._edges[stop]) + 1)
                if stop > start and (stop + 1 - start) * (wider + 1) * n_summands > _BATCH_ELEMENTS:
                    break
                stop, width = stop + 1, wider
            batch = slice(start, stop)
            yield batch, width, self._stack(batch, width)
            start = stop

    def _stack(self, batch: slice, width: int) -> "csr_array":
        # Help of commands lists the methods, and none of it takes scipy's half a second.
        from scipy.sparse import csr_array

        n_columns = batch.stop - batch.start
        rows = []
        for offset, (bins, edges) in enumerate(zip(self._bins[batch], self._edges[batch], strict=True)):
            rows.append(np.where(bins > len(edges), width, bins) * n_columns + offset)
        row = np.concatenate(rows)
        column = np.tile(np.arange(rows[0].size), n_columns)
        return csr_array((np.ones(row.size), (row, column)), shape=((width + 1) * n_columns, rows[0].size))


@dataclass(frozen=True, slots=True)
class Binned:
    """All columns of a training set that a stump can split on."""

    n_columns: int
    groups: tuple[TwoValued | ManyValued, ...]
    home: dict[int, tuple[TwoValued | ManyValued, int]]  # column -> its group and position there


def bin_columns(X: NDArray[np.generic], max_bins: int | None = None, weights: Floats | None = None) -> Binned:
    """Sort the columns of `X` (n, d), numbers with NaN for missing, into groups; constant ones are left out.

    Columns have at most `max_bins` bins (2 or more; None: one for each value), that hold rows as evenly as can be; a
    row counts as often as `weights` (n,) say, of which every sum must be exact.
    """
    two, rest = _two_valued(X)
    binned = [(column, *_bin(np.asarray(X[:, column], dtype=np.float64), max_bins, weights)) for column in rest]
    varying = [(column, bins, edges) for column, bins, edges in binned if edges.size]
    # With few bins a column of many values may have two.
    two += [([column], [bins == 0], edges) for column, bins, edges in varying if bins.max() == 1]
    many = [(column, bins, edges) for column, bins, edges in varying if bins.max() > 1]
    groups: list[TwoValued | ManyValued] = []
    if two:
        columns, low, thresholds = map(np.concatenate, zip(*two, strict=True))
        order = np.argsort(columns)
        groups.append(TwoValued(columns[order], low[order], thresholds[order]))
    if many:
        groups.append(ManyValued(*map(list, zip(*many, strict=True))))
    home = {column: (group, position) for group in groups for position, column in enumerate(group.columns.tolist())}
    return Binned(X.shape[1], tuple(groups), home)


def _two_valued(X: NDArray[np.generic]) -> tuple[list[tuple[Any, Any, Floats]], list[int]]:
    """Return the columns of two values and no missing one, and the numbers of those of more; constant ones are in none.

    Most columns are switches: many at a time, and no need to sort them. Each part of the first is what `TwoValued` is
    made of: columns (c,), low (c, n), thresholds (c,).
    """
    two: list[tuple[Any, Any, Floats]] = []
    rest: list[int] = []
    step = max(1, _BLOCK_ELEMENTS // max(1, len(X)))
    for start in range(0, X.shape[1], step):
        numbers = np.asarray(X[:, start : start + step], dtype=np.float64)
        least, most = numbers.min(axis=0), numbers.max(axis=0)
        is_low = numbers == least
        few = (is_low | (numbers == most)).all(axis=0)
        parted = few & (least < most)
        if parted.any():
            columns = start + np.flatnonzero(parted)
            two.append((columns, is_low.T[parted], _between(least[parted], most[parted])))
        rest += (start + np.flatnonzero(~few)).tolist()
    return two, rest


def _bin(numbers: Floats, max_bins: int | None, weights: Floats | None = None) -> tuple[NDArray[np.int32], Floats]:
    """Return the bin (n,) of every number and the edges between bins; a missing one gets bin len(edges) + 1."""
    values, bins, counts = np.unique(numbers, return_inverse=True, return_counts=True)
    present = ~np.isnan(values)
    edges = midpoints(values[present])
    if max_bins is not None and len(edges) >= max_bins:
        heavy = counts if weights is None else np.bincount(bins, weights)
        kept = _even(heavy[present], max_bins)
        edges = edges[kept]
        bins = np.where(np.isnan(numbers), len(edges) + 1, np.searchsorted(kept, bins))
    return bins.astype(np.int32), edges


def _even(counts: NDArray[np.intp] | Floats, bins: int) -> NDArray[np.intp]:
    """Return after which of the values, each with as many rows as `counts` says, to part them into `bins` at most.

    An edge lies where the share of rows below it is nearest to 1, 2, ... of so many parts; of equally near ones first.
    """
    below = np.cumsum(counts)[:-1]
    wanted = np.arange(1, bins) * counts.sum()
    return np.unique([np.argmin(np.abs(bins * below - share)) for share in wanted])


def midpoints(values: Floats) -> Floats:
    """Return the thresholds between neighbouring `values` (m,), ascending: (m - 1,), each with v[i] <= t < v[i + 1].

    Where the midpoint rounds up to v[i + 1] (neighbours 1 ulp apart), the threshold is v[i]: what was counted on the
    right stays there. Weka 3.6 keeps the midpoint and sends v[i + 1] left. Halving first keeps the largest doubles
    finite.
    """
    return _between(values[:-1], values[1:])


def _between(lower: Floats, upper: Floats) -> Floats:
    with np.errstate(over="ignore"):
        total = lower + upper
    middle = np.where(np.isfinite(total), 0.5 * total, 0.5 * lower + 0.5 * upper)
    return np.where(middle < upper, middle, lower)
