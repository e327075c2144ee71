"""A joint, in proportion to its code."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import BuildError
from .base import HIGHEST_CODE, Ends, Floats, Rows, ScoreTerm, StepTerm, less_last

# Largest scaled range of codes: a distance from its middle, and its negative, must fit one byte.
WIDEST = 254
LARGEST_SLOPE = 127  # entry of a slope's row


@dataclass(frozen=True, slots=True, eq=False)
class Line(ScoreTerm):
    """The contribution of a joint in proportion to its code: row_k * (clamp(code, low, high) - low).

    Parameters
    ----------
    joint : int
        The index of the joint, from 0.
    low, high : int
        The codes between which the contribution changes, low < high: the range in the training rows.
    row : ndarray of float, shape (K,)
        The contribution per code.
    """

    name = "line"
    stepped = False

    joint: int
    low: int
    high: int
    row: Floats

    @property
    def inputs(self) -> tuple[int, ...]:
        """The joint."""
        return (self.joint,)

    @property
    def steps(self) -> tuple[NDArray[Any], ...]:
        """Every code of the range but the last."""
        return (np.arange(self.low, self.high),)

    @property
    def ends(self) -> Ends:
        """The largest and the smallest contribution, (K,) each."""
        most = self.row * (self.high - self.low)
        return np.maximum(most, 0), np.minimum(most, 0)

    @property
    def middle(self) -> Floats:
        """The contribution in the middle of the range, (K,)."""
        return self.row * ((self.high - self.low) / 2)

    def of(self, *values: NDArray[Any]) -> Rows:
        """Return the contribution (n, K) of codes (n,)."""
        row, above = self.parts(*values)
        return above * row

    def parts(self, *values: NDArray[Any]) -> tuple[Rows, NDArray[np.int64]]:
        """Return the row (1, K), and how far codes (n,) are above the lowest one (n, 1)."""
        above = np.clip(values[0].astype(np.int64), self.low, self.high) - self.low
        return self.row[np.newaxis], above[:, np.newaxis]

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> "Line":
        """Return the line with these fields. Raises KeyError, TypeError or ValueError for others."""
        joint, low, high = (int(arrays[name].item()) for name in ("joint", "low", "high"))
        return cls(joint, low, high, arrays["row"])

    def relative(self) -> "Line":
        """Return the term of scores relative to the last class."""
        return replace(self, row=less_last(self.row))

    def slope(self, scale: float) -> "Slope":
        """Return the line in steps per distance, not rounded, and measured from its zero.

        Codes are divided by the smallest power of two that makes their range fit a byte, or multiplied by the smallest
        one that makes every entry of the row fit a byte, if there is one.
        """
        span, gain, largest = self.high - self.low, 0, np.abs(self.row).max() * scale
        while span >> -gain > WIDEST:
            gain -= 1
        while gain >= 0 and span << gain + 1 <= WIDEST and np.rint(largest / 2**gain) > LARGEST_SLOPE:
            gain += 1
        return Slope(self.joint, self.low, self.high, gain, self.row * scale / 2.0**gain)

    def whole(self, scale: float, grid: int) -> "Slope":
        """Return the line in whole steps per distance from its zero."""
        slope = self.slope(scale)
        return replace(slope, row=np.rint(slope.row))

    def rounding_error(self, scale: float, grid: int) -> float:
        """Return half a step times the largest distance, plus the difference between codes that share a distance."""
        slope = self.slope(scale)
        shared = max(2.0**-slope.gain - 1, 0)
        return slope.zero / 2 + float(np.abs(self.row).max()) * scale * shared / 2


@dataclass(frozen=True, slots=True, eq=False)
class Slope(StepTerm):
    """A line in steps: row (K,), int8 where it is deployed, times the code's distance from the middle of its range.

    A code is clipped to `low` to `high`. Its distance from low is multiplied by 2^gain, or divided and rounded down if
    `gain` is negative: 0 to `most`, at most 254. The distance is that minus `zero`. Raises BuildError.
    """

    name = "line"
    stepped = False

    joint: int
    low: int
    high: int
    gain: int
    row: Rows

    def __post_init__(self) -> None:
        if not (0 <= self.low < self.high <= HIGHEST_CODE and -16 <= self.gain <= 7 and 0 < self.most <= WIDEST):
            raise BuildError(
                f"a slope from code {self.low} to {self.high} with gain {self.gain} does not fit a byte: compile again"
            )

    def _gained(self, above: int) -> int:
        return above << self.gain if self.gain > 0 else above >> -self.gain

    @property
    def _wide(self) -> Rows:
        """The row in a type that has room for products."""
        return self.row.astype(np.int64) if self.row.dtype == np.int8 else self.row

    @property
    def inputs(self) -> tuple[int, ...]:
        """The joint."""
        return (self.joint,)

    @property
    def cell(self) -> int:
        """How many codes share a distance."""
        return 1 << max(-self.gain, 0)

    @property
    def steps(self) -> tuple[NDArray[Any], ...]:
        """The codes after which the distance changes."""
        return (np.arange(self.low + self.cell - 1, self.high, self.cell),)

    @property
    def most(self) -> int:
        """The scaled value of the highest code."""
        return self._gained(self.high - self.low)

    @property
    def zero(self) -> int:
        """The scaled value of the middle, where nothing is added."""
        return (self.most + 1) // 2

    @property
    def offset(self) -> float:
        """The distance in codes from the lowest one to the zero: to the middle of the codes that share the zero
        distance, where codes are divided.
        """
        return self.zero / 2.0**self.gain + max(2.0**-self.gain - 1, 0) / 2

    @property
    def ends(self) -> Ends:
        """The largest and the smallest contribution, (K,) each."""
        ends = np.stack([-self.zero * self._wide, (self.most - self.zero) * self._wide])
        return ends.max(axis=0), ends.min(axis=0)

    def distances(self, codes: NDArray[np.integer]) -> NDArray[np.int64]:
        """Return the distances of codes (n,)."""
        above = np.clip(codes.astype(np.int64), self.low, self.high) - self.low
        gained: NDArray[np.int64] = above << self.gain if self.gain > 0 else above >> -self.gain
        return gained - self.zero

    def of(self, *values: NDArray[Any]) -> Rows:
        """Return the contribution (n, K) of codes (n,)."""
        contribution: Rows = self.distances(values[0])[:, np.newaxis] * self._wide
        return contribution

    def turning(self, ends: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return codes about each end.

        Between two ends, rounding errors at the first of the codes that share a distance lie on a straight line, and so
        do those at the last ones: the ends of both lines are among these.
        """
        firsts = self.low + (np.clip(ends, self.low, self.high) - self.low) // self.cell * self.cell
        about = (firsts + near for near in (-1, 0, self.cell - 1, self.cell))
        return np.concatenate([[self.low, self.high], *about])

    def integers(self) -> "Slope":
        """Return the term with its row as int8."""
        return replace(self, row=self.row.astype(np.int8))


MEMBER = Line
