"""A joint, by the bin of its code."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .base import Rows, Tabulated


@dataclass(frozen=True, slots=True, eq=False)
class Bins(Tabulated):
    """The contribution of a joint: the row of the bin of its code.

    thresholds (T,) uint16, strictly increasing; rows (T + 1, K). The bin is the number of thresholds below the code, so
    a code <= t is left of t.
    """

    name = "bins"

    joint: int
    thresholds: NDArray[np.uint16]
    rows: Rows

    @property
    def inputs(self) -> tuple[int, ...]:
        """The joint."""
        return (self.joint,)

    @property
    def steps(self) -> tuple[NDArray[Any], ...]:
        """The thresholds."""
        return (self.thresholds,)

    def of(self, *values: NDArray[Any]) -> Rows:
        """Return the contribution (n, K) of codes (n,)."""
        rows: Rows = self.rows[np.searchsorted(self.thresholds, values[0])]
        return rows

    def plus(self, other: "Bins") -> "Bins":
        """Return the sum of both, which are of one joint."""
        thresholds = np.union1d(self.thresholds, other.thresholds)
        codes = np.append(0, thresholds.astype(np.int64) + 1)
        return Bins(self.joint, thresholds, self.of(codes) + other.of(codes))

    def grid_of(self, grid: int) -> int:
        """Return the grid of its rows: a joint's only row is part of the starting value, and needs none."""
        return grid if len(self.rows) > 1 else 1

    def integers(self) -> "Bins":
        """Return the term with its rows as int16, and without the thresholds that rounding has made redundant."""
        rows = self.rows.astype(np.int16)
        kept = (rows[1:] != rows[:-1]).any(axis=1)
        return Bins(self.joint, self.thresholds[kept], rows[np.concatenate([[True], kept])])


MEMBER = Bins
