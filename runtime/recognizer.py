"""Frames in, recognitions out. The decision is integer arithmetic; a probability is only worked out to be published."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .build import Build
from .softmax import softmax

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One reading of everything that the build keeps.

    time_us is an integer clock in microseconds, bits (s,) and codes (j,) are in the build's order. The masks, where
    given, mark switches and joints that could not be read; what stands in `bits` and `codes` there does not matter.
    """

    time_us: int
    bits: NDArray[np.bool_]
    codes: NDArray[np.uint16]
    lost_switches: Mask | None = None
    lost_joints: Mask | None = None


@dataclass(frozen=True, slots=True)
class Recognition:
    """What was recognised in a frame, and how surely.

    probability is the softmax of the scores, margin the lead over the second best in integer steps; degraded says that
    a switch or a joint was missing and its mean contribution stood in for it.
    """

    time_us: int
    grasp: str
    probability: float
    margin: int
    degraded: bool


class Recognizer:
    """The recogniser of a build."""

    __slots__ = ("_build",)

    def __init__(self, build: Build) -> None:
        self._build = build

    def recognise(self, frame: Frame) -> Recognition:
        """Return the grasp type of `frame`. Raises FrameError if the frame does not fit the build."""
        lanes, degraded = self._lanes(frame)
        second, best = sorted(lanes)[-2:]
        winner = lanes.index(best)
        return Recognition(
            time_us=frame.time_us,
            grasp=self._build.grasps[winner],
            probability=softmax(lanes, winner, self._build.tables.scale),
            margin=best - second,
            degraded=degraded,
        )

    def _lanes(self, frame: Frame) -> tuple[tuple[int, ...], bool]:
        if frame.lost_switches is None and frame.lost_joints is None:
            return self._build.lanes(frame.bits, frame.codes), False
        tables = self._build.tables
        switches = np.zeros(tables.n_switches, bool) if frame.lost_switches is None else frame.lost_switches
        joints = np.zeros(tables.n_joints, bool) if frame.lost_joints is None else frame.lost_joints
        lanes = self._build.lanes_without(frame.bits, frame.codes, switches, joints)
        return lanes, bool(np.any(switches) or np.any(joints))
