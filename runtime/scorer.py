"""Scores of one frame in a few microseconds of plain Python, by adding whole rows as single integers (packed.py)."""

from bisect import bisect_left
from itertools import compress
from operator import getitem

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import FrameError
from .packed import LANE_OFFSET, PackedTables
from .tables import IntegerTables

__all__ = ["LANE_OFFSET", "Scorer"]

_HIGHEST_CODE = 65535


class Scorer:
    """The tables of a build, arranged for one frame at a time."""

    __slots__ = ("_packed",)

    def __init__(self, tables: IntegerTables) -> None:
        self._packed = PackedTables(tables)

    def lanes(self, bits: ArrayLike, codes: ArrayLike) -> tuple[int, ...]:
        """Return the scores of one frame, each 2^15 too high: K integers. Raises FrameError."""
        packed, switches = self._packed, self._bits(bits)
        bins = map(bisect_left, packed.thresholds, self._codes(codes))
        total = sum(compress(packed.switch_rows, switches), packed.start)
        return packed.unpacked(sum(map(getitem, packed.joint_rows, bins), total))

    def lanes_without(
        self, bits: ArrayLike, codes: ArrayLike, lost_switches: ArrayLike, lost_joints: ArrayLike
    ) -> tuple[int, ...]:
        """Return what `lanes` does, with the mean row in place of every switch and joint that the masks call lost."""
        packed, switches, joints = self._packed, self._bits(bits), self._codes(codes)
        lost_bits = _flags(lost_switches, len(packed.switch_rows), "lost switches")
        lost_codes = _flags(lost_joints, len(packed.thresholds), "lost joints")
        there = [bit and not lost for bit, lost in zip(switches, lost_bits, strict=True)]
        total = sum(compress(packed.switch_rows, there), sum(compress(packed.switch_means, lost_bits), packed.start))
        for joint, (code, lost) in enumerate(zip(joints, lost_codes, strict=True)):
            row = packed.joint_rows[joint][bisect_left(packed.thresholds[joint], code)]
            total += packed.joint_means[joint] if lost else row
        return packed.unpacked(total)

    def _bits(self, bits: ArrayLike) -> list[bool]:
        return _flags(bits, len(self._packed.switch_rows), "switches")

    def _codes(self, codes: ArrayLike) -> list[int]:
        array = np.asarray(codes)
        expected = len(self._packed.thresholds)
        if array.shape != (expected,):
            raise FrameError(f"a frame with codes of shape {array.shape}, the build has {expected} joints")
        values: list[int] = array.tolist()
        if array.dtype != np.uint16 and values:
            _check_codes(array, values)
        return values


def _flags(flags: ArrayLike, expected: int, what: str) -> list[bool]:
    array = np.asarray(flags)
    if array.shape != (expected,):
        raise FrameError(f"a frame with {what} of shape {array.shape}, the build has {expected}")
    values: list[bool] = array.tolist()
    if array.dtype != np.bool_ and any(value not in (0, 1) for value in values):
        raise FrameError(f"{what} are 0 or 1, this frame has {next(v for v in values if v not in (0, 1))!r}")
    return values


def _check_codes(array: NDArray[np.generic], values: list[int]) -> None:
    if array.dtype.kind not in "iu":
        raise FrameError(f"joint codes are integers, this frame has {array.dtype}")
    if min(values) < 0 or max(values) > _HIGHEST_CODE:
        wrong = next(value for value in values if not 0 <= value <= _HIGHEST_CODE)
        raise FrameError(f"joint codes are 0 to {_HIGHEST_CODE}, this frame has {wrong}")
