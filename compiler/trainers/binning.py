"""Columns as bins between neighbouring values, and the sums of weights and responses left of every split.

Columns of two values are processed several at a time: rows of the same values share a cell. A column of more values, or
with missing ones, has a cell for each bin. One sparse product sums all cells; a running sum gives the splits of bins. A
dense product of switches would wait for the threads of BLAS, three times as long on a busy machine. With few rows it is
three times as fast, in pieces that are too small for BLAS to start threads.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..elementary import Floats

if TYPE_CHECKING:
    from scipy.sparse import csc_array

# Elements of the sums over a batch of cells: 512 KiB of doubles stay in a processor's cache.
_BATCH_ELEMENTS = 1 << 16
# Elements of the columns processed together: 8 MiB of doubles.
_BLOCK_ELEMENTS = 1 << 20
# The most columns of two values that share a partition of the rows: 2^8 cells.
_MOST_BITS = 8
# Up to this many rows a dense product is faster; OpenBLAS multiplies up to 2^18 pairs of numbers in one thread.
_DENSE_ROWS, _DENSE_PRODUCTS = 800, 1 << 18


@dataclass(frozen=True, slots=True)
class SplitSums:
    """Sums for a batch of c columns of at most B bins, over R summands: exact integers."""

    columns: NDArray[np.intp]  # (c,) ascending
    left: Floats  # (c, R, B) rows with a value in a bin or below it
    missing: Floats | None  # (c, R); None: no value is missing
    is_split: NDArray[np.bool_]  # (c, B) some value lies above the bin


@dataclass(frozen=True, slots=True)
class BinnedColumn:
    """A column that varies: the bin (n,) of each row, len(edges) + 1 for a missing value, and the `edges` of bins."""

    bins: NDArray[np.uint8] | NDArray[np.int32]
    edges: Floats
    lacks: bool = False  # some values are missing

    @property
    def missing(self) -> NDArray[np.bool_]:
        """Whether the value of each row (n,) is missing."""
        absent: NDArray[np.bool_] = self.bins == len(self.edges) + 1
        return absent


class TwoValued:
    """Columns that take exactly two values and are never missing."""

    def __init__(self, columns: NDArray[np.intp], high: NDArray[np.bool_]) -> None:
        """`high` (c, n): the value is the higher one."""
        self.columns = columns
        self._high = high
        self._low = (~high).astype(np.float64) if high.shape[1] <= _DENSE_ROWS else None
        # 2^bits cells per partition, and in total not many more than there are rows.
        few = [bits for bits in range(2, _MOST_BITS + 1) if -(-len(high) // bits) << bits <= 2 * high.shape[1]]
        self._bits = bits = max(few, default=1)
        self._has_bit = (np.arange(1 << bits) >> np.arange(bits)[:, np.newaxis] & 1).astype(np.float64)
        self._batches: list[csc_array] = []

    def sums(self, by_row: Floats) -> Floats:
        """Return the sums (c, R) of `by_row` (n, R) over the rows that have their lower value."""
        bits, summands = self._bits, by_row.shape[1]
        if self._low is not None:
            step = max(1, _DENSE_PRODUCTS // by_row.size)
            return np.concatenate(
                [self._low[start : start + step] @ by_row for start in range(0, len(self._low), step)]
            )
        if not self._batches:
            widths = [1 << bits] * -(-len(self._high) // bits)
            self._batches = [_one_hot(self._cells(batch), width) for batch, width in _batches(widths, summands)]
        sums = [self._has_bit @ (one_hot @ by_row).reshape(-1, 1 << bits, summands) for one_hot in self._batches]
        return np.concatenate(sums).reshape(-1, summands)[: len(self._high)]

    def _cells(self, batch: slice) -> Iterator[NDArray[np.int32]]:
        for start in range(batch.start * self._bits, batch.stop * self._bits, self._bits):
            cells = np.zeros(self._high.shape[1], dtype=np.int32)
            for bit, rows in enumerate(self._high[start : start + self._bits]):
                cells |= (~rows).astype(np.int32) << bit
            yield cells


class ManyValued:
    """Columns of three or more values, or with missing ones."""

    def __init__(self, columns: dict[int, BinnedColumn]) -> None:
        self.columns = np.array([*columns], dtype=np.intp)
        self._binned = [*columns.values()]
        self._batches: list[tuple[slice, NDArray[np.bool_], bool, csc_array]] = []

    def sums(self, by_row: Floats) -> Iterator[SplitSums]:
        """Yield the sums of `by_row` (n, R), R even, a batch of columns at a time."""
        summands = by_row.shape[1]
        if not self._batches:
            for batch, width in _batches([len(column.edges) + 2 for column in self._binned], summands):
                binned = self._binned[batch]
                cells = (np.where(column.missing, np.int32(width - 1), column.bins) for column in binned)
                is_split = np.arange(width - 2) < np.array([[len(column.edges)] for column in binned])
                lacks = any(column.lacks for column in binned)
                self._batches.append((batch, is_split, lacks, _one_hot(cells, width)))
        for batch, is_split, lacks, one_hot in self._batches:
            histogram = (one_hot @ by_row).reshape(len(is_split), -1, summands)
            # Two at a time, as complex numbers: numpy's cumsum processes one element after the other.
            left = np.cumsum(histogram[:, :-2].view(np.complex128), axis=1).view(np.float64)
            missing = histogram[:, -1] if lacks else None
            yield SplitSums(self.columns[batch], np.ascontiguousarray(left.transpose(0, 2, 1)), missing, is_split)


def _batches(widths: Sequence[int], n_summands: int) -> Iterator[tuple[slice, int]]:
    """Yield batches of partitions, as many as fit but at least one, and the number of cells of the widest."""
    start = 0
    while start < len(widths):
        stop, width = start, 0
        while stop < len(widths):
            wider = max(width, widths[stop])
            if stop > start and (stop + 1 - start) * wider * n_summands > _BATCH_ELEMENTS:
                break
            stop, width = stop + 1, wider
        yield slice(start, stop), width
        start = stop


def _one_hot(partitions: Iterator[NDArray[np.int32]], width: int) -> "csc_array":
    """Return the matrix (p * width, n) of p partitions of n rows into cells below `width`.

    Stored by columns: a product reads each row of summands once, and adds it to sums that stay in the cache.
    """
    # Imported late: the help of commands lists the methods and should not load scipy, which takes half a second.
    from scipy.sparse import csc_array

    cells = np.column_stack([cells + np.int32(number * width) for number, cells in enumerate(partitions)])
    n, p = cells.shape
    return csc_array((np.ones(cells.size), cells.ravel(), np.arange(n + 1) * p), shape=(p * width, n))


@dataclass(frozen=True, slots=True)
class Binned:
    """All columns of a training set that a stump can split on, by their numbers, and in two groups that are summed."""

    n_columns: int
    columns: dict[int, BinnedColumn]
    two: TwoValued
    many: ManyValued


def bin_columns(X: NDArray[np.generic], max_bins: int | None = None) -> Binned:
    """Sort the columns of `X` (n, d), numbers with NaN for missing, into groups; constant ones are omitted.

    Columns have at most `max_bins` bins (2 or more; None: one for each value) that hold rows as evenly as possible.
    """
    two, rest = _two_valued(X)
    many: dict[int, BinnedColumn] = {}
    for number in rest:
        column = _bin(np.asarray(X[:, number], dtype=np.float64), max_bins)
        # With few bins a column of many values may have only two.
        if column.edges.size and column.bins.max() == 1:
            two[number] = BinnedColumn(column.bins.astype(np.uint8), column.edges)
        elif column.edges.size:
            many[number] = column
    two = dict(sorted(two.items()))
    high = np.array([column.bins for column in two.values()], dtype=np.bool_).reshape(len(two), len(X))
    return Binned(X.shape[1], two | many, TwoValued(np.array([*two], dtype=np.intp), high), ManyValued(many))


def _two_valued(X: NDArray[np.generic]) -> tuple[dict[int, BinnedColumn], list[int]]:
    """Return the columns of two values and none missing, and the numbers of columns of more; constant ones are omitted.

    Most columns are switches: they are processed many at a time, without sorting.
    """
    two: dict[int, BinnedColumn] = {}
    rest: list[int] = []
    step = max(1, _BLOCK_ELEMENTS // max(1, len(X)))
    for start in range(0, X.shape[1], step):
        numbers = np.asarray(X[:, start : start + step], dtype=np.float64)
        least, most = numbers.min(axis=0), numbers.max(axis=0)
        is_high = numbers == most
        few = (is_high | (numbers == least)).all(axis=0)
        thresholds = _between(least, most)
        for column in np.flatnonzero(few & (least < most)).tolist():
            two[start + column] = BinnedColumn(is_high[:, column].astype(np.uint8), thresholds[[column]])
        rest += (start + np.flatnonzero(~few)).tolist()
    return two, rest


def _bin(numbers: Floats, max_bins: int | None) -> BinnedColumn:
    """Return the bins of a column (n,) of numbers, NaN for missing."""
    values, bins, counts = np.unique(numbers, return_inverse=True, return_counts=True)
    present = ~np.isnan(values)
    edges = midpoints(values[present])
    if max_bins is not None and len(edges) >= max_bins:
        # Edge i lies where the share of rows below it is nearest to i of `max_bins` equal parts; ties go to the first.
        counts = counts[present]
        below, wanted = np.cumsum(counts)[:-1], np.arange(1, max_bins) * counts.sum()
        kept = np.unique([np.argmin(np.abs(max_bins * below - share)) for share in wanted])
        edges = edges[kept]
        bins = np.where(np.isnan(numbers), len(edges) + 1, np.searchsorted(kept, bins))
    return BinnedColumn(bins.astype(np.int32), edges, not present.all())


def midpoints(values: Floats) -> Floats:
    """Return the thresholds between neighbouring `values` (m,), ascending: (m - 1,), each with v[i] <= t < v[i + 1].

    Where the midpoint rounds up to v[i + 1] (neighbours 1 ulp apart), the threshold is v[i]: rows that were counted on
    the right stay there. Weka 3.6 keeps the midpoint and sends v[i + 1] left. Halving first keeps the largest doubles
    finite.
    """
    return _between(values[:-1], values[1:])


def _between(lower: Floats, upper: Floats) -> Floats:
    with np.errstate(over="ignore"):
        total = lower + upper
    middle = np.where(np.isfinite(total), 0.5 * total, 0.5 * lower + 0.5 * upper)
    return np.where(middle < upper, middle, lower)
