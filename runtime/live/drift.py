"""Joints whose codes wander off: a glove that slips, a sensor that ages.

The hand opens and closes again and again, so a joint's lowest and highest code come back. When both have moved the same
way since the first minute, the sensor's zero has moved by at least the smaller of both; grasps that merely use less of
the range move them towards each other.
"""

from collections.abc import Sequence
from operator import gt, lt

WINDOW_US = 60_000_000
# Share of a joint's range in the first window by which both ends must have moved.
LARGEST = 0.2

Ends = list[tuple[int, int]]


class JointDrift:
    """Compares the lowest and highest code of every joint in the last whole window with those in the first one."""

    def __init__(self) -> None:
        self._first: Ends | None = None
        self._began_us: int | None = None
        self._low: list[int] = []
        self._high: list[int] = []
        self.codes: tuple[int, ...] = ()

    def frame(self, time_us: int, codes: Sequence[int]) -> None:
        """Take the codes of all joints; `codes` is then by how much each has drifted, 0 where it is within bounds."""
        if self._began_us is not None and time_us - self._began_us >= WINDOW_US:
            self._end()
            self._began_us = None
        if self._began_us is None:
            self._began_us, self._low, self._high = time_us, list(codes), list(codes)
        # Seldom so: after a few grasps a joint has been where it goes.
        if any(map(lt, codes, self._low)):
            self._low = list(map(min, self._low, codes))
        if any(map(gt, codes, self._high)):
            self._high = list(map(max, self._high, codes))

    def _end(self) -> None:
        ends = list(zip(self._low, self._high, strict=True))
        if self._first is None:
            self._first = ends
        self.codes = tuple(_drift(first, last) for first, last in zip(self._first, ends, strict=True))


def _drift(first: tuple[int, int], last: tuple[int, int]) -> int:
    low, high = last[0] - first[0], last[1] - first[1]
    if low * high <= 0:
        return 0
    shift = min(low, high, key=abs)
    return shift if abs(shift) > LARGEST * (first[1] - first[0]) else 0
