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


class Cooccurrence:
    """Counts of all pairs of bits X (n, d) bool in each of n_classes classes `labels` (n,)."""

    def __init__(self, X: npt.NDArray[np.bool_], labels: npt.NDArray[np.intp], n_classes: int) -> None:
        # Whole numbers in float64: one fast matrix product a class, exact below 2^53.
        members = [X[labels == c].astype(np.float64) for c in range(n_classes)]
        self._both = np.array([m.T @ m for m in members]).astype(np.int64).reshape(n_classes, X.shape[1], X.shape[1])
        self._ones = self._both.diagonal(axis1=1, axis2=2)
        self._totals = np.bincount(labels, minlength=n_classes)
        ones = self._ones.sum(axis=0)
        self.varying = np.flatnonzero((ones > 0) & (ones < len(X)))
        n = max(float(len(X)), 2.0)
        # Four sums, each of at most n ln n, of 6 (K + 1) terms of a relative 8 units: see gain._error_bound.
        self.error_bound = 4 * n * float(np.log(n)) * (6 * (n_classes + 1) + 16) * _UNIT

    def information(self, given: int | None = None) -> npt.NDArray[np.float64]:
        """Return n * I(class; a | given) for every bit a, (d,), in nats."""
        return sum((sign * _f(counts).sum(axis=(0, 2, 3)) for sign, counts in _parts(self._tables(given))), np.zeros(1))

    def sign(self, one: tuple[int, int | None], other: tuple[int, int | None]) -> int:
        """Return the sign of I(class; a | b) of pair `one` minus that of pair `other`, exactly."""
        difference: Counter[int] = Counter()
        for (bit, given), sign in ((one, 1), (other, -1)):
            for part_sign, counts in _parts(self._tables(given, slice(bit, bit + 1))):
                for count in counts.ravel().tolist():
                    difference[count] += sign * part_sign
        return sign_of_f_sum(difference)

    def _tables(self, given: int | None, bits: slice = slice(None)) -> Counts:
        """Return counts (K, bits, 2 values of the bit, 2 values of `given` or 1)."""
        ones = self._ones[:, bits]
        zeros = self._totals[:, None] - ones
        if given is None:
            return np.stack([zeros, ones], axis=2)[..., None]
        one_one = self._both[:, bits, given]
        zero_one = self._ones[:, given, None] - one_one
        pairs = np.stack([zeros - zero_one, zero_one, ones - one_one, one_one], axis=2)
        return pairs.reshape(*ones.shape, 2, 2)


def _parts(tables: Counts) -> Iterator[tuple[int, Counts]]:
    """Yield sign and counts of the four sums, each of four axes: class, bit, its value, value of what is given."""
    yield 1, tables
    yield -1, tables.sum(axis=0, keepdims=True)
    yield -1, tables.sum(axis=2, keepdims=True)
    yield 1, tables.sum(axis=(0, 2), keepdims=True)


def _f(counts: Counts) -> npt.NDArray[np.float64]:
    floats = counts.astype(np.float64)
    return np.asarray(floats * np.log(np.maximum(floats, 1.0)))
