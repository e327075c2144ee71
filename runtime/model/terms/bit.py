"""A switch."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .base import CoreTerm, Ends, Rows, less_last, rounded


@dataclass(frozen=True, slots=True, eq=False)
class Bit(CoreTerm):
    """The contribution of a closed switch: row (K,)."""

    name = "bit"

    switch: int
    row: Rows

    @property
    def inputs(self) -> tuple[int, ...]:
        """The switch."""
        return (self.switch,)

    @property
    def steps(self) -> tuple[NDArray[Any], ...]:
        """An open switch is 0, a closed one 1."""
        return (np.zeros(1, np.uint16),)

    @property
    def ends(self) -> Ends:
        """The largest and the smallest contribution to each type, (K,) and (K,)."""
        return np.maximum(self.row, 0), np.minimum(self.row, 0)

    def of(self, *values: NDArray[Any]) -> Rows:
        """Return the contribution (n, K) of states (n,)."""
        return np.where(values[0][:, np.newaxis], self.row, self.row.dtype.type(0))

    def relative(self) -> "Bit":
        """Return the term of scores relative to the last class."""
        return replace(self, row=less_last(self.row))

    def whole(self, scale: float, grid: int) -> "Bit":
        """Return the term in whole steps, of multiples of `grid`."""
        return replace(self, row=rounded(self.row * scale, grid))

    def rounding_error(self, scale: float, grid: int) -> float:
        """Return half of the grid."""
        return grid / 2

    def integers(self) -> "Bit":
        """Return the term with its row as int16."""
        return replace(self, row=self.row.astype(np.int16))


MEMBER = Bit
