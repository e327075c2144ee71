"""Information of one bit about the class, alone or given another bit: from counts, exactly comparable.

n * I(class; a | b) is, with f(n) = n ln n and the counts n_cab of class c and values of a and b,

    sum f(n_cab) - sum f(n_ab) - sum f(n_cb) + sum f(n_b);    without b, as if b were constant
"""

import numpy as np
import numpy.typing as npt

from .exact import Counts, Floats, compare, error_bound, n_log_n

# (Class, bit) pairs that are processed together: their tables and logarithms take some 40 MiB.
_BLOCK = 1 << 18


class Cooccurrence:
    """Counts of all pairs of bits X (n, d) bool in each of n_classes classes `labels` (n,)."""

    def __init__(self, X: npt.NDArray[np.bool_], labels: npt.NDArray[np.intp], n_classes: int) -> None:
        # Count pairs on demand: all of them would be K d^2 numbers.
        self._packed, self._starts = _by_class(X, labels, n_classes)
        self._ones = self._count(self._packed)
        self._totals = np.bincount(labels, minlength=n_classes)
        ones = self._ones.sum(axis=0)
        self.varying = np.flatnonzero((ones > 0) & (ones < len(X)))
        # Four sums, each of at most n ln n, of 6 (K + 1) terms together.
        self.error_bound = error_bound(len(X), 6 * (n_classes + 1), 4)

    def information(self, given: int | None = None) -> Floats:
        """Return n * I(class; a | given) for every bit a, (d,), in nats."""
        step = max(1, _BLOCK // len(self._totals))
        starts = range(0, max(1, len(self._packed)), step)
        return np.concatenate([_information(self._tables(given, slice(start, start + step))) for start in starts])

    def kinds(self) -> tuple[list[int], npt.NDArray[np.intp]]:
        """Return one bit of each kind (bits with equal counts in every class), and each bit's kind (d,)."""
        _, first, kind = np.unique(self._ones, axis=1, return_index=True, return_inverse=True)
        return first.tolist(), kind.ravel()

    def sign(self, one: tuple[int, int | None], other: tuple[int, int | None]) -> int:
        """Return the sign of I(class; a | b) of pair `one` minus that of pair `other`, exactly."""
        return compare(*self._terms(*one), *self._terms(*other))

    def _terms(self, bit: int, given: int | None) -> tuple[Counts, Counts]:
        """Return the counts whose f are added in n * I(class; bit | given), and those whose f are subtracted."""
        cells, bits, classes, rest = (part.ravel() for part in _parts(self._tables(given, slice(bit, bit + 1))))
        return np.concatenate([cells, rest]), np.concatenate([bits, classes])

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
        """Return the number of ones of each class (K, d) in `packed` (d, bytes)."""
        ones = np.bitwise_count(packed)
        return np.ascontiguousarray(np.add.reduceat(ones, self._starts, axis=1, dtype=np.int64).T)


def _by_class(
    X: npt.NDArray[np.bool_], labels: npt.NDArray[np.intp], n_classes: int
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.intp]]:
    """Return X (n, d) by column, packed (d, bytes) with the rows of each class adjacent, and each class's first byte.

    Each class begins at a byte boundary and has at least one byte, even without rows.
    """
    sizes = np.maximum(-(-np.bincount(labels, minlength=n_classes) // 8), 1)
    starts = np.cumsum(sizes) - sizes
    packed = np.zeros((X.shape[1], int(sizes.sum())), dtype=np.uint8)
    for c, start in enumerate(starts.tolist()):
        rows = np.packbits(X[labels == c], axis=0).T
        packed[:, start : start + rows.shape[1]] = rows
    return packed, starts


def _parts(tables: Counts) -> tuple[Counts, Counts, Counts, Counts]:
    """Return the counts of the four sums, each of four axes: class, bit, its value, value of the given bit."""
    return (
        tables,
        tables.sum(axis=0, keepdims=True),
        tables.sum(axis=2, keepdims=True),
        tables.sum(axis=(0, 2), keepdims=True),
    )


def _information(tables: Counts) -> Floats:
    cells, bits, classes, rest = (n_log_n(part).sum(axis=(0, 2, 3)) for part in _parts(tables))
    return np.asarray(cells - bits - classes + rest)
