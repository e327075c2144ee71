"""Scores of one frame in a few microseconds of plain Python, by adding whole rows as single integers.

A row of K int16 steps is packed into one Python integer, a lane of 16 bits per class: row = sum_k steps_k * 2^(16 k).
Adding two such integers adds all K lanes at once. `IntegerTables` has proved that no sum leaves int16, so no lane can
spill into the next; the offset 2^15 per lane, added once, keeps every lane positive while it is read out.
"""

from bisect import bisect_left
from itertools import compress
from operator import getitem
from struct import Struct

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import FrameError
from .tables import IntegerTables

LANE_OFFSET = 1 << 15
_HIGHEST_CODE = 65535


class Scorer:
    """The tables of a build, arranged for one frame at a time."""

    __slots__ = ("_joint_means", "_joint_rows", "_lanes", "_start", "_switch_means", "_switch_rows", "_thresholds")

    def __init__(self, tables: IntegerTables) -> None:
        self._lanes = Struct(f"<{tables.n_classes}H")
        offsets = _packed(np.zeros((1, tables.n_classes), np.int16), 0)[0]
        self._start = _packed(tables.bias[np.newaxis], 0)[0]
        self._switch_rows = _packed(tables.switch_rows, offsets)
        self._switch_means = _packed(tables.switch_means, offsets)
        self._joint_means = _packed(tables.joint_means, offsets)
        self._joint_rows = [_packed(rows, offsets) for rows in tables.joint_rows]
        self._thresholds: list[list[int]] = [thresholds.tolist() for thresholds in tables.thresholds]

    def lanes(self, bits: ArrayLike, codes: ArrayLike) -> tuple[int, ...]:
        """Return the scores of one frame, each 2^15 too high: K integers. Raises FrameError."""
        switches = self._bits(bits)
        bins = map(bisect_left, self._thresholds, self._codes(codes))
        total = sum(compress(self._switch_rows, switches), self._start)
        return self._unpacked(sum(map(getitem, self._joint_rows, bins), total))

    def lanes_without(
        self, bits: ArrayLike, codes: ArrayLike, lost_switches: ArrayLike, lost_joints: ArrayLike
    ) -> tuple[int, ...]:
        """Return what `lanes` does, with the mean row in place of every switch and joint that the masks call lost."""
        switches, joints = self._bits(bits), self._codes(codes)
        lost_bits = _flags(lost_switches, len(self._switch_rows), "lost switches")
        lost_codes = _flags(lost_joints, len(self._thresholds), "lost joints")
        there = [bit and not lost for bit, lost in zip(switches, lost_bits, strict=True)]
        total = sum(compress(self._switch_rows, there), sum(compress(self._switch_means, lost_bits), self._start))
        for joint, (code, lost) in enumerate(zip(joints, lost_codes, strict=True)):
            row = self._joint_rows[joint][bisect_left(self._thresholds[joint], code)]
            total += self._joint_means[joint] if lost else row
        return self._unpacked(total)

    def _unpacked(self, total: int) -> tuple[int, ...]:
        return self._lanes.unpack(total.to_bytes(self._lanes.size, "little"))

    def _bits(self, bits: ArrayLike) -> list[bool]:
        return _flags(bits, len(self._switch_rows), "switches")

    def _codes(self, codes: ArrayLike) -> list[int]:
        array = np.asarray(codes)
        if array.shape != (len(self._thresholds),):
            raise FrameError(f"a frame with codes of shape {array.shape}, the build has {len(self._thresholds)} joints")
        values: list[int] = array.tolist()
        if array.dtype != np.uint16 and values:
            _check_codes(array, values)
        return values


def _packed(rows: NDArray[np.int16], offsets: int) -> list[int]:
    """Return every row as one integer. `offsets` is 2^15 in each lane, taken off again; 0 leaves it in."""
    lanes = (rows.astype(np.int32) + LANE_OFFSET).astype("<u2")
    return [int.from_bytes(row.tobytes(), "little") - offsets for row in lanes]


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
