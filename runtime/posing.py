"""Guided calibration of a glove's sensors as a state machine: which pose is next, what a key means, when it is taken.

No terminal, no device and no clock in here: records, keys and the time come in. What a pose is worth, and the lines
that the poses make, are those of drivers/calibration.py.
"""

from collections.abc import Sequence
from enum import Enum

from thenar.drivers.calibration import (
    GloveCalibration,
    Held,
    Pose,
    calibration,
    held,
    poses_of,
    problems,
)

# Pressing the key shakes the hand, and records from before it are still on their way.
SETTLE_US = 150_000
# A byte at an end of its range says nothing of how far the joint went beyond.
_ENDS = (1, 255)


class PoseStage(Enum):
    """Where a calibration stands: before a pose is held, while it is, in doubt about one, with all taken, or over."""

    READY = "ready"
    HELD = "held"
    DOUBTED = "doubted"
    DONE = "done"
    OVER = "over"


class PoseKey(Enum):
    """What the keys mean: go on, take the pose before again, keep a doubtful one, leave."""

    ACCEPT = "accept"
    BACK = "back"
    KEEP = "keep"
    QUIT = "quit"


class PoseGuide:
    """Leads through the poses of sensors called `names`.

    stage     where it stands; `left`: whether it is over because somebody left
    raw       the newest bytes of the sensors; None before the first
    problems  what speaks against the pose that was held last, in sentences
    taken     what the poses gave
    step      counts every change of stage
    """

    def __init__(self, names: Sequence[str], hold_us: int) -> None:
        self.names = tuple(names)
        self.poses = poses_of(self.names)
        self.stage = PoseStage.READY
        self.left = False
        self.step = 0
        self.raw: bytes | None = None
        self.problems: list[str] = []
        self.taken: list[Held] = []
        self._hold_us = hold_us
        self._settled_us = 0
        self._samples: list[bytes] = []
        self._found: Held | None = None
        self._low, self._high = [256] * len(self.names), [-1] * len(self.names)

    @property
    def pose(self) -> Pose:
        """The pose that is next or held; when all are taken, the last."""
        return self.poses[min(len(self.taken), len(self.poses) - 1)]

    def offered(self) -> dict[PoseKey, str]:
        """Return the keys that do something now, and what they do."""
        words: dict[PoseStage, dict[PoseKey, str]] = {
            PoseStage.READY: {PoseKey.ACCEPT: "I hold it: take it"},
            PoseStage.DOUBTED: {PoseKey.ACCEPT: "hold it again", PoseKey.KEEP: "keep it all the same"},
            PoseStage.DONE: {PoseKey.ACCEPT: "write the calibration"},
        }
        found = dict(words.get(self.stage, {}))
        if self.taken and self.stage in (PoseStage.READY, PoseStage.DONE):
            found[PoseKey.BACK] = "back to the pose before"
        if self.stage is not PoseStage.OVER:
            found[PoseKey.QUIT] = "leave, and write nothing"
        return found

    def seconds_left(self, now_us: int) -> float:
        """Return for how long the pose is to be held still."""
        return max(0, self._settled_us + self._hold_us - now_us) / 1e6 if self.stage is PoseStage.HELD else 0.0

    def take(self, now_us: int, raw: bytes) -> None:
        """Take a record, a byte a sensor; where the pose has been held for long enough, judge it."""
        self.raw = raw
        for place, byte in enumerate(raw):
            self._low[place], self._high[place] = min(self._low[place], byte), max(self._high[place], byte)
        if self.stage is not PoseStage.HELD or now_us < self._settled_us:
            return
        self._samples.append(raw)
        if now_us < self._settled_us + self._hold_us:
            return
        self._found = held(self._samples)
        self.problems = problems(self.names, self.taken[0] if self.taken else None, self.pose, self._found)
        if self.problems:
            self._become(PoseStage.DOUBTED)
        else:
            self._keep()

    def press(self, now_us: int, key: PoseKey) -> None:
        """Do what `key` asks for, if it means anything now."""
        if key not in self.offered():
            return
        if key is PoseKey.QUIT:
            self.left = True
            self._become(PoseStage.OVER)
        elif key is PoseKey.KEEP:
            self._keep()
        elif key is PoseKey.BACK:
            self.taken.pop()
            self._become(PoseStage.READY)
        elif self.stage is PoseStage.READY:
            self._samples, self.problems, self._settled_us = [], [], now_us + SETTLE_US
            self._become(PoseStage.HELD)
        else:
            self._become(PoseStage.READY if self.stage is PoseStage.DOUBTED else PoseStage.OVER)

    def states(self) -> list[str]:
        """Return what is wrong with each sensor now, in a few words; "" where nothing is.

        One at an end of its range is saturated. One whose byte was the same in all records so far, though a pose that
        moves it was taken, is dead.
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
        """Return the lines that the poses make; all must be taken."""
        return calibration(self.names, self.taken[0], list(zip(self.poses[1:], self.taken[1:], strict=True)), subject)

    def _keep(self) -> None:
        assert self._found is not None
        self.taken.append(self._found)
        self._become(PoseStage.DONE if len(self.taken) == len(self.poses) else PoseStage.READY)

    def _become(self, stage: PoseStage) -> None:
        self.stage = stage
        self.step += 1
