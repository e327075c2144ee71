"""Two joints together, by the bins of both codes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .base import CoreTerm, Ends, Rows, less_last, rounded


@dataclass(frozen=True, slots=True, eq=False)
class Grid(CoreTerm):
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

    @property
    def cells(self) -> Rows:
        """The rows, one after the other (cells, K): the first joint's bins one by one, in each the other's."""
        return self.rows.reshape(-1, self.rows.shape[-1])

    @property
    def n_rows(self) -> int:
        """The number of its rows."""
        return len(self.cells)

    @property
    def ends(self) -> Ends:
        """The largest and the smallest contribution, (K,) each."""
        return self.cells.max(axis=0), self.cells.min(axis=0)

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

    def relative(self) -> "Grid":
        """Return the term of scores relative to the last class."""
        return replace(self, rows=less_last(self.rows))

    def whole(self, scale: float, grid: int) -> "Grid":
        """Return the term in whole steps."""
        return replace(self, rows=rounded(self.rows * scale))

    def rounding_error(self, scale: float, grid: int) -> float:
        """Return half a step."""
        return 0.5

    def integers(self) -> "Grid":
        """Return the term with its rows as int16."""
        return replace(self, rows=self.rows.astype(np.int16))


MEMBER = Grid
