"""The details of a grasp for people: closed switches, joints in their unit, the probability of every type."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec

from .frames import Mask

if TYPE_CHECKING:
    from .build import Build
    from .live.recogniser import Moment


class Detail(msgspec.Struct, frozen=True):
    """A moment.

    closed         a character per kept switch, in the build's order: "1" closed, "0" open
    joints         the value of each joint of the build, in its unit; None while they are lost
    probabilities  of every class of the build, in order; None while too little can be read
    """

    closed: str
    joints: tuple[float, ...] | None
    probabilities: tuple[float, ...] | None


class Details:
    """Makes the details of the moments of a run of `build`."""

    def __init__(self, build: "Build") -> None:
        self._switches, self._scale = build.tables.n_switches, build.tables.scale
        self._none_leads = None if build.rejector is None else build.none_leads
        self._joints = [
            (joint.value_a, joint.code_a, (joint.value_b - joint.value_a) / (joint.code_b - joint.code_a))
            for joint in build.manifest.joints
        ]

    def __call__(self, moment: "Moment") -> Detail:
        """Return the details of a moment."""
        frame = moment.switches
        return Detail(
            closed=self._bits(0 if frame is None else frame.closed),
            joints=None if moment.codes is None else self._values(moment.codes),
            probabilities=self._probabilities(moment.scores, moment.refused) if moment.scores else None,
        )

    def _bits(self, mask: Mask) -> str:
        return f"{mask:0{self._switches}b}"[::-1] if self._switches else ""

    def _values(self, codes: Sequence[int]) -> tuple[float, ...]:
        pairs = zip(codes, self._joints, strict=True)
        return tuple(round(value + (code - at) * step, 2) for code, (value, at, step) in pairs)

    def _probabilities(self, scores: Sequence[int], refused: bool) -> tuple[float, ...]:
        best = max(scores)
        if self._none_leads is not None:
            scores = (*scores, best + self._none_leads[refused])
            best = max(scores)
        powers = [math.exp((score - best) / self._scale) for score in scores]
        total = sum(powers)
        return tuple(round(power / total, 4) for power in powers)
