"""Two joints together, by the bins of both codes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .base import Rows, Tabulated


@dataclass(frozen=True, slots=True, eq=False)
class Grid(Tabulated):
    """The contribution of two joints together: the row of the cell of their codes.

    joints (a, b), a < b; thresholds (T_a,) and (T_b,) uint16, strictly increasing; rows (T_a + 1, T_b + 1, K). A joint
    that is missing counts as code 0 here.
    """

    name = "grid"

    joints: tuple[int, int]
    thresholds: tuple[NDArray[np.uint16], NDArray[np.uint16]]
    rows: Rows

    @property
    def inputs(self) -> tuple[int, ...]:
        """The joints."""
        return self.joints

    @property
    def steps(self) -> tuple[NDArray[Any], ...]:
        """The thresholds of both."""
        return self.thresholds

    def of(self, *values: NDArray[Any]) -> Rows:
        """Return the contribution (n, K) of codes (n,) of both."""
        down, across = (np.searchsorted(steps, codes) for steps, codes in zip(self.thresholds, values, strict=True))
        rows: Rows = self.rows[down, across]
        return rows

    def arrays(self) -> Mapping[str, NDArray[Any]]:
        """Return its fields, by name."""
        down, across = self.thresholds
        return {"joints": np.array(self.joints), "down": down, "across": across, "rows": self.rows}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> "Grid":
        """Return the grid with these fields. Raises KeyError, TypeError or ValueError for others."""
        a, b = arrays["joints"].tolist()
        return cls((a, b), (arrays["down"], arrays["across"]), arrays["rows"])


MEMBER = Grid
