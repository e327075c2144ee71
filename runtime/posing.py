"""Guided calibration of a glove's sensors as a state machine: the next pose, the meaning of keys, the time of capture.

It has no terminal, device or clock: records, keys and the time come in. drivers/calibration.py judges poses and makes
the lines from them.
"""

from collections.abc import Sequence
from typing import Literal

from thenar.drivers.calibration import (
    CalibrationPose,
    GloveCalibration,
    Held,
    calibration,
    held,
    poses_of,
    problems,
)

from .frames import OLD_US

# Pressing the key shakes the hand, and earlier records are still on their way.
SETTLE_US = 150_000
# A byte at an end of its range does not show how far the joint went beyond.
_ENDS = (1, 255)


# Before a pose, holding it, in doubt about it, or all taken.
PoseStage = Literal["ready", "held", "doubted", "done"]
# Continue, take the previous pose again, keep a doubtful one.
PoseKey = Literal["accept", "back", "keep"]


class PoseGuide:
    """Leads through the poses of sensors called `names`.

    stage     the current stage
    raw       the newest bytes of the sensors, read at `raw_us`; None before the first
    problems  the objections to the last pose, in sentences
    taken     the results of the poses
    """

    def __init__(self, names: Sequence[str], hold_us: int, old_us: int = OLD_US) -> None:
        """Take the sensors, the time to hold a pose, and the age from which a record is old."""
        self.names = tuple(names)
        self.poses = poses_of(self.names)
        self.stage: PoseStage = "ready"
        self.raw: bytes | None = None
        self.raw_us: int | None = None
        self.problems: list[str] = []
        self.taken: list[Held] = []
        self._hold_us, self._old_us = hold_us, old_us
        self._settled_us = 0
        self._samples: list[bytes] = []
        self._found: Held | None = None
        self._low, self._high = [256] * len(self.names), [-1] * len(self.names)

    @property
    def pose(self) -> CalibrationPose:
        """The pose that is next or held; when all are taken, the last."""
        return self.poses[min(len(self.taken), len(self.poses) - 1)]

    def silent(self, now_us: int) -> bool:
        """Return whether there is no record of now: then no pose can be taken."""
        return self.raw_us is None or now_us - self.raw_us > self._old_us

    def offered(self, now_us: int) -> set[PoseKey]:
        """Return the keys that are active now."""
        keys: set[PoseKey] = {"accept", "keep"} if self.stage == "doubted" else set()
        if self.stage == "ready" and not self.silent(now_us):
            keys.add("accept")
        if self.stage in ("ready", "done") and self.taken:
            keys.add("back")
        return keys

    def take(self, now_us: int, raw: bytes) -> None:
        """Take a record, one byte per sensor; if the pose has been held long enough, judge it."""
        self.raw, self.raw_us = raw, now_us
        for place, byte in enumerate(raw):
            self._low[place], self._high[place] = min(self._low[place], byte), max(self._high[place], byte)
        if self.stage != "held" or now_us < self._settled_us:
            return
        self._samples.append(raw)
        if now_us < self._settled_us + self._hold_us:
            return
        self._found = held(self._samples)
        self.problems = problems(self.names, self.taken[0] if self.taken else None, self.pose, self._found)
        if self.problems:
            self.stage = "doubted"
        else:
            self._keep()

    def press(self, now_us: int, key: PoseKey) -> None:
        """Carry out `key`, if it is active now."""
        if key not in self.offered(now_us):
            return
        if key == "keep":
            self._keep()
        elif key == "back":
            self.taken.pop()
            self.stage = "ready"
        elif self.stage == "ready":
            self._samples, self.problems, self._settled_us = [], [], now_us + SETTLE_US
            self.stage = "held"
        else:
            self.stage = "ready"

    def states(self) -> list[str]:
        """Return the fault of each sensor now, in a few words; "" if there is none.

        A sensor at an end of its range is saturated. A sensor is dead if its byte was the same in all records so far,
        although a pose that moves it was taken.
        """
        moved = {name for pose, _ in zip(self.poses, self.taken, strict=False) for name in pose.degrees}
        found = []
        for name, raw, low, high in zip(self.names, self.raw or b"", self._low, self._high, strict=False):
            if not raw:
                found.append("not measured")
            elif raw in _ENDS:
                found.append("at the end of its range")
            else:
                found.append("dead: it never moved" if low == high and name in moved else "")
        return found

    def calibration(self, subject: str) -> GloveCalibration:
        """Return the calibration from the poses, all of which must be taken."""
        return calibration(self.names, self.taken[0], list(zip(self.poses[1:], self.taken[1:], strict=True)), subject)

    def _keep(self) -> None:
        assert self._found is not None
        self.taken.append(self._found)
        self.stage = "done" if len(self.taken) == len(self.poses) else "ready"
