"""A joint, in proportion to its code."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import BuildError
from .base import HIGHEST_CODE, CoreTerm, Ends, Floats, Rows, less_last

# Largest scaled range of codes: a distance from its middle, and its negative, must fit one byte.
WIDEST = 254
LARGEST_SLOPE = 127  # entry of a row in steps


@dataclass(frozen=True, slots=True, eq=False)
class Line(CoreTerm):
    """The contribution of a joint in proportion to its code: row times the code's distance from `zero`.

    A code is clipped to `low` to `high`. In scores its distance is that from low. In steps that is multiplied by
    2^gain, or divided and rounded down if `gain` is negative, 0 to `most`, at most 254, and counted from the middle of
    that range. Raises BuildError if a distance in steps does not fit a byte.

    Parameters
    ----------
    joint : int
        The index of the joint, from 0.
    low, high : int
        The codes between which the contribution changes, low < high: the range in the training rows.
    row : ndarray, shape (K,)
        The contribution per distance: of float for scores, of int8 where it is deployed.
    gain : int, optional
        The power of two of a line in steps; None for scores.
    """

    name = "line"
    stepped = False

    joint: int
    low: int
    high: int
    row: Rows
    gain: int | None = None

    def __post_init__(self) -> None:
        if self.gain is None:
            return
        if not (0 <= self.low < self.high <= HIGHEST_CODE and -16 <= self.gain <= 7 and 0 < self.most <= WIDEST):
            raise BuildError(
                f"a slope from code {self.low} to {self.high} with gain {self.gain} does not fit a byte: compile again"
            )

    @property
    def _wide(self) -> Rows:
        """The row in a type that has room for products."""
        return self.row.astype(np.int64) if self.row.dtype == np.int8 else self.row

    @property
    def inputs(self) -> tuple[int, ...]:
        """The joint."""
        return (self.joint,)

    @property
    def shift(self) -> int:
        """The gain, 0 for scores."""
        return self.gain or 0

    @property
    def cell(self) -> int:
        """How many codes share a distance."""
        return 1 << max(-self.shift, 0)

    @property
    def steps(self) -> tuple[NDArray[Any], ...]:
        """The codes after which the distance changes."""
        return (np.arange(self.low + self.cell - 1, self.high, self.cell),)

    @property
    def most(self) -> int:
        """The scaled value of the highest code."""
        return ((self.high - self.low) << max(self.shift, 0)) // self.cell

    @property
    def zero(self) -> int:
        """The scaled value where nothing is added: of the lowest code, or of the middle in steps."""
        return 0 if self.gain is None else (self.most + 1) // 2

    @property
    def ends(self) -> Ends:
        """The largest and the smallest contribution, (K,) each."""
        ends = np.stack([-self.zero * self._wide, (self.most - self.zero) * self._wide])
        return ends.max(axis=0), ends.min(axis=0)

    @property
    def middle(self) -> Floats:
        """The score in the middle of the range, (K,)."""
        middle: Floats = self.row * ((self.high - self.low) / 2)
        return middle

    def distances(self, codes: NDArray[np.integer]) -> NDArray[np.int64]:
        """Return the distances of codes (n,)."""
        above = np.clip(codes.astype(np.int64), self.low, self.high) - self.low
        gained: NDArray[np.int64] = (above << max(self.shift, 0)) // self.cell
        return gained - self.zero

    def of(self, *values: NDArray[Any]) -> Rows:
        """Return the contribution (n, K) of codes (n,)."""
        row, distances = self.parts(*values)
        return distances * row

    def parts(self, *values: NDArray[Any]) -> tuple[Rows, NDArray[np.int64]]:
        """Return the row (1, K), and the distances (n, 1) of codes (n,)."""
        return self._wide[np.newaxis], self.distances(values[0])[:, np.newaxis]

    def turning(self, ends: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return codes about each end; none for scores.

        Between two ends, rounding errors at the first of the codes that share a distance lie on a straight line, and so
        do those at the last ones: the ends of both lines are among these.
        """
        if self.gain is None:
            return ends[:0]
        firsts = self.low + (np.clip(ends, self.low, self.high) - self.low) // self.cell * self.cell
        about = (firsts + near for near in (-1, 0, self.cell - 1, self.cell))
        return np.concatenate([[self.low, self.high], *about])

    def arrays(self) -> Mapping[str, NDArray[Any]]:
        """Return the fields of scores, by name."""
        return {name: np.asarray(getattr(self, name)) for name in ("joint", "low", "high", "row")}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> "Line":
        """Return the line with these fields. Raises KeyError, TypeError or ValueError for others."""
        joint, low, high = (int(arrays[name].item()) for name in ("joint", "low", "high"))
        return cls(joint, low, high, arrays["row"])

    def relative(self) -> "Line":
        """Return the term of scores relative to the last class."""
        return replace(self, row=less_last(self.row))

    def slope(self, scale: float) -> "Line":
        """Return the line in steps, not rounded.

        Codes are divided by the smallest power of two that makes their range fit a byte, or multiplied by the smallest
        one that makes every entry of the row fit a byte, if there is one.
        """
        span, gain, largest = self.high - self.low, 0, np.abs(self.row).max() * scale
        while span >> -gain > WIDEST:
            gain -= 1
        while gain >= 0 and span << gain + 1 <= WIDEST and np.rint(largest / 2**gain) > LARGEST_SLOPE:
            gain += 1
        return replace(self, row=self.row * scale / 2.0**gain, gain=gain)

    def offset(self, scale: float) -> Floats:
        """Return the score (K,) at the zero of the line in steps: in the middle of the codes that share that distance,
        where codes are divided.
        """
        slope = self.slope(scale)
        offset: Floats = self.row * (slope.zero / 2.0**slope.shift + (slope.cell - 1) / 2)
        return offset

    def whole(self, scale: float, grid: int) -> "Line":
        """Return the line in whole steps."""
        slope = self.slope(scale)
        return replace(slope, row=np.rint(slope.row))

    def rounding_error(self, scale: float, grid: int) -> float:
        """Return half a step times the largest distance, plus the difference between codes that share a distance."""
        slope = self.slope(scale)
        return slope.zero / 2 + float(np.abs(self.row).max()) * scale * (slope.cell - 1) / 2

    def integers(self) -> "Line":
        """Return the term with its row as int8."""
        return replace(self, row=self.row.astype(np.int8))


MEMBER = Line
