"""Pairs of grasps of different types that look alike: those that no classifier, however good, tells apart."""

import numpy as np
from numpy.typing import NDArray

from ..samples import Columns, Samples

Counts = NDArray[np.int64]
Numbers = NDArray[np.intp]


class Pairs:
    """The pairs of rows of different grasp types, and how many of them look alike in some of the switches.

    Two rows look alike in some switches if they are equal in every one of these. All counts are exact whole numbers.
    Joints are not looked at.

    total      pairs there are
    varying    (v,) numbers of the switches that ever change
    """

    def __init__(self, learning: Samples) -> None:
        bits = learning.switches
        self.varying: Numbers = np.flatnonzero(bits.any(axis=0) & ~bits.all(axis=0))
        packed = np.packbits(bits[:, self.varying], axis=1)
        kinds = _numbered(packed) * learning.n_classes + learning.labels
        # Rows of one type that are alike in everything are one row that counts so often.
        _, first, counts = np.unique(kinds, return_index=True, return_counts=True)
        self._bits, self._labels, self._counts = bits[first], learning.labels[first], counts.astype(np.float64)
        self._n_classes = learning.n_classes
        self.total = self.alike(())

    def alike(self, columns: Columns) -> int:
        """Return how many pairs look alike in `columns`."""
        groups, cells = self._cut(columns)
        return (_squares(np.bincount(groups, self._counts)) - _squares(np.bincount(cells, self._counts))) // 2

    def gains(self, columns: Columns) -> Counts:
        """Return (s,) how many of the pairs alike in `columns` each further switch, alone, tells apart."""
        groups, cells = self._cut(columns)
        mixed = np.bincount(groups, self._counts)[groups] > np.bincount(cells, self._counts)[cells]
        left = self._halves(groups, mixed) - self._halves(cells, mixed)
        return np.asarray(self.alike(columns) - left // 2, dtype=np.int64)

    def _cut(self, columns: Columns) -> tuple[Numbers, Numbers]:
        """Return the number of every row's group (rows alike in `columns`), and of its cell (those of its type)."""
        groups = _numbered(np.packbits(self._bits[:, list(columns)], axis=1))
        cells = np.unique(groups * self._n_classes + self._labels, return_inverse=True)[1]
        return groups, cells

    def _halves(self, parts: Numbers, rows: NDArray[np.bool_]) -> Counts:
        """Return for every switch (s,) the sum, over the two halves into which it cuts each part, of size squared."""
        from scipy.sparse import csr_matrix

        numbers = np.unique(parts[rows], return_inverse=True)[1]
        shape = (int(numbers.max(initial=-1)) + 1, len(numbers))
        sums = csr_matrix((self._counts[rows], (numbers, np.arange(len(numbers)))), shape=shape)
        closed = sums @ self._bits[rows].astype(np.float64)
        opened = sums.sum(axis=1) - closed
        squares: NDArray[np.float64] = (np.square(closed) + np.square(opened)).sum(axis=0)
        return np.asarray(squares).ravel().astype(np.int64)


def _numbered(packed: NDArray[np.uint8]) -> Numbers:
    """Return for every row (n,) the number of its pattern."""
    if not packed.shape[1]:
        return np.zeros(len(packed), dtype=np.intp)
    return np.asarray(np.unique(packed, axis=0, return_inverse=True)[1], dtype=np.intp).ravel()


def _squares(sizes: NDArray[np.generic]) -> int:
    return int(np.square(sizes.astype(np.int64)).sum())
