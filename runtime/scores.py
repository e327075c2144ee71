"""Scores of single frames by the integer tables, in a few microseconds of plain Python.

A row of K int16 steps is one Python integer, 16 bits a class: row = sum_k steps_k * 2^(16 k). Adding two such integers
adds all K lanes at once. `IntegerTables` has proved that no sum leaves int16, so no lane can spill into the next; the
offset 2^15 per lane, added once, keeps every lane positive while it is read out.

Rejection: a frame unlike all training frames of a build has none of its grasp types, so nothing is held. A frame is
refused for its candidate, the grasp type with the largest score, in three cases: that score is below the type's
minimum; fewer or more switches are closed than the type's minimum and maximum; or more joints than `outside` are beyond
the type's ranges. All of these are integers, so Python and C refuse the same frames. Lost inputs are left out: a lost
switch may be closed or open, a lost joint lies within, and the score is judged only in frames without lost inputs.
"""

import math
from bisect import bisect_left
from collections.abc import Sequence
from functools import cached_property
from itertools import compress
from operator import getitem, gt, lt, not_
from struct import Struct

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import FrameError
from .frames import Mask
from .manifest import Rejection
from .model.integers import IntegerTables
from .model.terms.base import HIGHEST_CODE

LANE_OFFSET = 1 << 15
# The digits for the bytes of False and True.
_DIGITS = b"0" + b"1" * 255
# Switches are looked up eight at a time: a byte of a mask indexes its sum of rows.
_EIGHT = 8
# A sensor's byte has no more codes than these; a finer stream reuses the entries.
_MOST_CODES = 1 << 12
_LEAST_SHARE, _EVEN = 1e-9, 0.5
# In a frame that is not refused, none trails by this many steps: no sum of scores comes near.
_NEVER = -(1 << 40)


class Scorer:
    """The tables of a build, arranged for one frame at a time. A build makes one, shared by all users of its scores.

    start                       bias and offset: the sum of no rows
    switch_rows, switch_means   s rows
    joint_means                 j rows
    joint_rows, thresholds      j lists: a row per bin, and the codes between the bins; distances of a slope are bins
    joints_lost                 the contribution of all joints while they are lost
    size, unpack                for a sum that began with `start`: its bytes, and the function that makes K scores of
                                them, each 2^15 too high
    rejector                    decides which frames are refused; None if the build refuses none
    none_leads                  the leads of none for a frame that is not refused and for one that is
    """

    def __init__(self, tables: IntegerTables, rejection: Rejection | None = None) -> None:
        self.tables = tables
        self.rejector = None if rejection is None else Rejector(rejection)
        self.none_leads = (0, 0) if rejection is None else none_leads(rejection, tables.scale)
        lanes = Struct(f"<{tables.n_classes}H")
        self.size, self.unpack = lanes.size, lanes.unpack
        offsets = _packed(np.zeros((1, tables.n_classes), np.int16), 0)[0]
        self.start = _packed(tables.bias[np.newaxis], 0)[0]
        self.switch_rows = _packed(tables.switch_rows, offsets)
        self.switch_means = _packed(tables.switch_means, offsets)
        self.joint_means = _packed(tables.joint_means, offsets)
        binned = [tables.binned(joint) for joint in range(tables.n_joints)]
        self.joint_rows = [_packed(bins.rows, offsets) for bins in binned]
        self.thresholds: list[list[int]] = [bins.thresholds.tolist() for bins in binned]
        self._by_code = [*map(_RowsByCode, self.thresholds, self.joint_rows)]
        self._grids = [
            (
                *grid.joints,
                *(steps.tolist() for steps in grid.thresholds),
                [_packed(rows, offsets) for rows in grid.rows],
            )
            for grid in tables.grids
        ]
        # Of all joints lost.
        self.joints_lost = sum(self.joint_means) + self._grid_sum((0,) * tables.n_joints)

    @cached_property
    def row_sums(self) -> list[list[int]]:
        """The sums of the rows of every set of eight switches, indexed by the set's byte."""
        return _sums(self.switch_rows)

    @cached_property
    def mean_sums(self) -> list[list[int]]:
        """The same for the mean rows."""
        return _sums(self.switch_means)

    def biased_scores(
        self,
        bits: ArrayLike,
        codes: ArrayLike,
        lost_switches: ArrayLike | None = None,
        lost_joints: ArrayLike | None = None,
    ) -> tuple[int, ...]:
        """Return the scores of one frame, each 2^15 too high: K integers. The arguments and errors are `state`'s."""
        return self.state_scores(*self.state(bits, codes, lost_switches, lost_joints))

    def state(
        self,
        bits: ArrayLike,
        codes: ArrayLike,
        lost_switches: ArrayLike | None = None,
        lost_joints: ArrayLike | None = None,
    ) -> tuple[Mask, Mask, list[int], Mask]:
        """Return the closed and the lost switches, the codes and the lost joints of one frame; None: nothing is lost.

        Raises FrameError.
        """
        switches, joints = len(self.switch_rows), len(self.thresholds)
        return (
            _mask(bits, switches, "switches"),
            0 if lost_switches is None else _mask(lost_switches, switches, "lost switches"),
            self._codes(codes),
            0 if lost_joints is None else _mask(lost_joints, joints, "lost joints"),
        )

    def joint_sum(self, codes: Sequence[int], lost: Mask = 0) -> int:
        """Return the sum of the contributions of all joints' codes, with the mean for lost ones."""
        if lost:
            there = [not lost >> joint & 1 for joint in range(len(codes))]
            rows = map(getitem, self._by_code, codes)
            known = sum(compress(rows, there), sum(compress(self.joint_means, map(not_, there))))
            return known + self._grid_sum([code * own for code, own in zip(codes, there, strict=True)])
        known = sum(map(getitem, self._by_code, codes))
        return known + self._grid_sum(codes) if self._grids else known

    def _grid_sum(self, codes: Sequence[int]) -> int:
        total = 0
        for one, other, steps, more, rows in self._grids:
            total += rows[bisect_left(steps, codes[one])][bisect_left(more, codes[other])]
        return total

    def state_scores(
        self, closed: Mask, lost: Mask, codes: Sequence[int] | None, lost_joints: Mask = 0
    ) -> tuple[int, ...]:
        """Return `biased_scores` of a state, with mean rows for what is lost; codes are None if all joints are. Bits of
        `closed` that are lost are ignored. Raises FrameError.
        """
        if (closed | lost) >> len(self.switch_rows):
            raise FrameError(f"a switch beyond the {len(self.switch_rows)} of the build is closed or lost")
        if codes is not None and len(codes) != len(self.thresholds):
            raise FrameError(f"a frame has {len(codes)} codes, but the build has {len(self.thresholds)} joints")
        total = self.start + _sum(closed & ~lost, self.row_sums)
        if lost:
            total += _sum(lost, self.mean_sums)
        total += self.joints_lost if codes is None else self.joint_sum(codes, lost_joints)
        return self.unpack(total.to_bytes(self.size, "little"))

    def with_none(
        self, biased_scores: tuple[int, ...], closed: Mask, lost: Mask, codes: Sequence[int] | None, lost_joints: Mask
    ) -> tuple[tuple[int, ...], bool]:
        """Return the scores of all classes, given those of a state: with one for none if the build may refuse a frame;
        and whether it refuses this one.
        """
        if self.rejector is None:
            return biased_scores, False
        seen, gone = (closed & ~lost).bit_count(), lost.bit_count()
        refused = self.rejector.refuses(biased_scores, seen, gone, codes, lost_joints=lost_joints)
        return (*biased_scores, max(biased_scores) + self.none_leads[refused]), refused

    def _codes(self, codes: ArrayLike) -> list[int]:
        array = np.asarray(codes)
        expected = len(self.thresholds)
        if array.shape != (expected,):
            raise FrameError(f"a frame has codes of shape {array.shape}, but the build has {expected} joints")
        values: list[int] = array.tolist()
        if array.dtype != np.uint16 and values:
            if array.dtype.kind not in "iu":
                raise FrameError(f"joint codes must be integers, but this frame has {array.dtype}")
            if min(values) < 0 or max(values) > HIGHEST_CODE:
                wrong = next(value for value in values if not 0 <= value <= HIGHEST_CODE)
                raise FrameError(f"joint codes must be 0 to {HIGHEST_CODE}, but this frame has {wrong}")
        return values


class _RowsByCode(dict[int, int]):
    """The rows of a joint by its codes: a code is looked up among the thresholds on first use."""

    __slots__ = ("_rows", "_thresholds")

    def __init__(self, thresholds: Sequence[int], rows: Sequence[int]) -> None:
        self._thresholds, self._rows = thresholds, rows

    def __missing__(self, code: int) -> int:
        if len(self) >= _MOST_CODES:
            self.clear()
        row = self[code] = self._rows[bisect_left(self._thresholds, code)]
        return row


def none_leads(rejection: Rejection, scale: float) -> tuple[int, int]:
    """Return the lead of none over the best score, at `scale` steps per unit, for a frame that is not refused and for
    one that is: there ln((1 - share) / share), where `share` is the share of grasps that are refused.
    """
    share = max(rejection.share, _LEAST_SHARE)
    return _NEVER, math.ceil(scale * math.log((1 - share) / share)) if share < _EVEN else 1


class Rejector:
    """Decides whether a build refuses a live frame."""

    __slots__ = ("_closed", "_least", "_outside", "_ranges")

    def __init__(self, rejection: Rejection) -> None:
        self._least = [least + LANE_OFFSET for least in rejection.least_scores]
        self._closed, self._outside = rejection.closed, rejection.outside
        # Of each type, the lowest and the highest codes of all joints.
        self._ranges = [
            (tuple(low for low, _ in ranges), tuple(high for _, high in ranges)) for ranges in rejection.ranges
        ]

    def refuses(
        self,
        biased_scores: Sequence[int],
        closed: int,
        lost: int,
        codes: Sequence[int] | None,
        *,
        lost_joints: Mask = 0,
    ) -> bool:
        """Return whether nothing is held.

        Parameters
        ----------
        biased_scores : sequence of int
            The K scores, each 2^15 too high, as in `Scorer.biased_scores`.
        closed, lost : int
            How many of the kept switches are closed, and how many are lost.
        codes : sequence of int or None
            The joints' codes; None: all are lost.
        lost_joints : int
            A mask of the joints that are lost.
        """
        best = max(biased_scores)
        candidate = biased_scores.index(best)
        whole = not (lost or lost_joints or codes is None)
        if best < self._least[candidate] and whole:
            return True
        fewest, most = self._closed[candidate]
        if closed > most or closed + lost < fewest:
            return True
        if codes is None:
            return False
        low, high = self._ranges[candidate]
        if lost_joints:
            pairs = enumerate(zip(codes, low, strict=True))
            codes = [least if lost_joints >> joint & 1 else code for joint, (code, least) in pairs]
        outside: int = sum(map(lt, codes, low)) + sum(map(gt, codes, high))
        return outside > self._outside


def refused(
    rejection: Rejection, scores: NDArray[np.integer], bits: NDArray[np.bool_], codes: NDArray[np.integer]
) -> NDArray[np.bool_]:
    """Return which frames are refused (n,): scores (n, K), kept switches (n, s) and codes (n, j), nothing lost."""
    candidate = scores.argmax(axis=1)
    closed, ranges = np.array(rejection.closed), np.array(rejection.ranges).reshape(len(rejection.closed), -1, 2)
    count, (fewest, most), (low, high) = bits.sum(axis=1), closed[candidate].T, np.moveaxis(ranges[candidate], 2, 0)
    outside = ((codes < low) | (codes > high)).sum(axis=1)
    least = np.array(rejection.least_scores)[candidate]
    return np.asarray((scores.max(axis=1) < least) | (count < fewest) | (count > most) | (outside > rejection.outside))


def softmax(scores: Sequence[int], scale: float) -> list[float]:
    """Return the softmax of `scores` (K,), in steps of 1 / `scale`; it cannot overflow.

    It is calculated only to be published: no decision depends on it.
    """
    best, total = max(scores), 0.0
    odds = [math.exp((score - best) / scale) for score in scores]
    for share in odds:
        total += share
    return [share / total for share in odds]


def _packed(rows: NDArray[np.int16], offsets: int) -> list[int]:
    """Return every row as one integer. `offsets` is 2^15 in each lane, subtracted again; 0 leaves it in."""
    lanes = (rows.astype(np.int32) + LANE_OFFSET).astype("<u2")
    return [int.from_bytes(row.tobytes(), "little") - offsets for row in lanes]


def _sums(rows: Sequence[int]) -> list[list[int]]:
    found = []
    for first in range(0, len(rows), _EIGHT):
        sums = [0]
        for row in rows[first : first + _EIGHT]:
            sums += [row + others for others in sums]
        found.append(sums)
    return found


def _sum(switches: Mask, sums: Sequence[Sequence[int]]) -> int:
    """Return the sum of the rows of `switches`."""
    return sum(map(getitem, sums, switches.to_bytes(len(sums), "little")))


def _mask(flags: ArrayLike, expected: int, what: str) -> Mask:
    array = np.asarray(flags)
    if array.shape != (expected,):
        raise FrameError(f"a frame has {what} of shape {array.shape}, but the build has {expected}")
    if array.dtype != np.bool_:
        if wrong := [value for value in array.tolist() if value not in (0, 1)]:
            raise FrameError(f"{what} must be 0 or 1, but this frame has {wrong[0]!r}")
        array = array.astype(bool)
    # As digits, last first: numpy's packing of so few bits takes three times as long.
    return int(b"0" + array.tobytes()[::-1].translate(_DIGITS), 2)
