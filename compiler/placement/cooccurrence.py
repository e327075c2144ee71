"""What one bit tells about the class, alone or given another bit: from counts, comparable exactly.

n * I(class; a | b) is, with f(n) = n ln n and the counts n_cab of class c and values of a and b,

    sum f(n_cab) - sum f(n_ab) - sum f(n_cb) + sum f(n_b);    without b, as if b were constant
"""

from collections import Counter
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from .logsums import sign_of_f_sum

Counts = npt.NDArray[np.int64]

_UNIT: float = 2.0**-53
# Of the numbers (classes, bits) that are looked at together: their tables and logarithms take some 40 MiB.
_BLOCK = 1 << 18


class Cooccurrence:
    """Counts of all pairs of bits X (n, d) bool in each of n_classes classes `labels` (n,)."""

    def __init__(self, X: npt.NDArray[np.bool_], labels: npt.NDArray[np.intp], n_classes: int) -> None:
        # Pairs are counted when they are asked for: all of them would be K d^2 numbers.
        self._packed, self._starts = _by_class(X, labels, n_classes)
        self._ones = self._count(self._packed)
        self._totals = np.bincount(labels, minlength=n_classes)
        ones = self._ones.sum(axis=0)
        self.varying = np.flatnonzero((ones > 0) & (ones < len(X)))
        n = max(float(len(X)), 2.0)
        # Four sums, each of at most n ln n, of 6 (K + 1) terms of a relative 8 units: see gain._error_bound.
        self.error_bound = 4 * n * float(np.log(n)) * (6 * (n_classes + 1) + 16) * _UNIT

    def information(self, given: int | None = None) -> npt.NDArray[np.float64]:
        """Return n * I(class; a | given) for every bit a, (d,), in nats."""
        step = max(1, _BLOCK // len(self._totals))
        return np.concatenate(
            [
                sum(
                    (sign * _f(counts).sum(axis=(0, 2, 3)) for sign, counts in _parts(self._tables(given, bits))),
                    np.zeros(1),
                )
                for bits in (slice(start, start + step) for start in range(0, max(1, len(self._packed)), step))
            ]
        )

    def kinds(self) -> tuple[list[int], npt.NDArray[np.intp]]:
        """Return a bit of each kind, those of a kind having equal counts in every class, and each bit's kind (d,)."""
        _, first, kind = np.unique(self._ones, axis=1, return_index=True, return_inverse=True)
        return first.tolist(), kind.ravel()

    def sign(self, one: tuple[int, int | None], other: tuple[int, int | None]) -> int:
        """Return the sign of I(class; a | b) of pair `one` minus that of pair `other`, exactly."""
        difference: Counter[int] = Counter()
        for (bit, given), sign in ((one, 1), (other, -1)):
            for part_sign, counts in _parts(self._tables(given, slice(bit, bit + 1))):
                for count in counts.ravel().tolist():
                    difference[count] += sign * part_sign
        return sign_of_f_sum(difference)

    def _tables(self, given: int | None, bits: slice) -> Counts:
        """Return counts (K, bits, 2 values of the bit, 2 values of `given` or 1)."""
        ones = self._ones[:, bits]
        zeros = self._totals[:, None] - ones
        if given is None:
            return np.stack([zeros, ones], axis=2)[..., None]
        one_one = self._count(self._packed[bits] & self._packed[given])
        zero_one = self._ones[:, given, None] - one_one
        pairs = np.stack([zeros - zero_one, zero_one, ones - one_one, one_one], axis=2)
        return pairs.reshape(*ones.shape, 2, 2)

    def _count(self, packed: npt.NDArray[np.uint8]) -> Counts:
        """Return the ones of each class (K, d) in `packed` (d, bytes)."""
        ones = np.bitwise_count(packed)
        return np.ascontiguousarray(np.add.reduceat(ones, self._starts, axis=1, dtype=np.int64).T)


def _by_class(
    X: npt.NDArray[np.bool_], labels: npt.NDArray[np.intp], n_classes: int
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.intp]]:
    """Return X (n, d) by column, packed (d, bytes), the rows of a class side by side, and each class's first byte.

    Each class begins a byte of its own, and has one even without rows.
    """
    sizes = np.maximum(-(-np.bincount(labels, minlength=n_classes) // 8), 1)
    starts = np.cumsum(sizes) - sizes
    packed = np.zeros((X.shape[1], int(sizes.sum())), dtype=np.uint8)
    for c, start in enumerate(starts.tolist()):
        rows = np.packbits(X[labels == c], axis=0).T
        packed[:, start : start + rows.shape[1]] = rows
    return packed, starts


def _parts(tables: Counts) -> Iterator[tuple[int, Counts]]:
    """Yield sign and counts of the four sums, each of four axes: class, bit, its value, value of what is given."""
    yield 1, tables
    yield -1, tables.sum(axis=0, keepdims=True)
    yield -1, tables.sum(axis=2, keepdims=True)
    yield 1, tables.sum(axis=(0, 2), keepdims=True)


def _f(counts: Counts) -> npt.NDArray[np.float64]:
    floats = counts.astype(np.float64)
    return np.asarray(floats * np.log(np.maximum(floats, 1.0)))
