"""Guided collection: what is shown to whoever wears the glove, what a key means, and when a grasp is captured.

No terminal, no device and no clock in here: frames, keys and the time come in, labels go to a Recorder.
"""

from collections.abc import Sequence
from enum import Enum

from ..live.frames import GloveFrame, SwitchFrame
from ..names import list_names
from .session import Event, Label
from .trials import Trial
from .writer import Recorder

# A frame this old was not read while the grasp was held.
FRESH_US = 200_000
# Bit of the CyberGlove's status byte: the glove is plugged into its box.
_PLUGGED = 1


class Stage(Enum):
    """Where a collection stands: before its first countdown, counting, with a captured grasp to judge, or over."""

    READY = "ready"
    COUNTDOWN = "countdown"
    REVIEW = "review"
    OVER = "over"


class Key(Enum):
    """What the keys mean: go on (and accept), do it again, leave."""

    ACCEPT = "accept"
    REDO = "redo"
    QUIT = "quit"


class Guide:
    """Leads through `trials`: countdown, capture, judgement, one key a trial.

    stage, trial  where it stands (trial: None when all are done)
    accepted      how many were accepted here
    problem       why nothing could be captured, as a sentence; "" when all was well
    """

    def __init__(self, trials: Sequence[Trial], recorder: Recorder, countdown_us: int) -> None:
        """The recorder's session must have a collection."""
        collection = recorder.session.collection
        assert collection is not None
        self.subject = collection.subject
        self.accepted = 0
        self.problem = ""
        self._left = list(reversed(trials))
        self._recorder = recorder
        self._countdown_us = countdown_us
        self._zero_us = 0
        self._switches: SwitchFrame | None = None
        self._glove: GloveFrame | None = None
        self.stage = Stage.READY if self._left else Stage.OVER

    @property
    def trial(self) -> Trial | None:
        """The trial that is next or under way."""
        return self._left[-1] if self._left else None

    @property
    def captured(self) -> tuple[SwitchFrame | None, GloveFrame | None]:
        """The newest frames; in review, those that were captured."""
        return self._switches, self._glove

    def seconds_left(self, now_us: int) -> float:
        """Return what is left of the countdown."""
        return max(0, self._zero_us - now_us) / 1e6

    def take(self, now_us: int, arrived: Sequence[SwitchFrame | GloveFrame]) -> None:
        """Record what came in, and capture the grasp if the countdown has ended. Raises FrameError."""
        for frame in arrived:
            self._record(frame)
        if self.stage is Stage.COUNTDOWN and now_us >= self._zero_us:
            self._capture(now_us)

    def press(self, now_us: int, key: Key) -> None:
        """Do what `key` asks for, if it means anything now."""
        if key is Key.QUIT:
            self.stage = Stage.OVER
        elif self.stage is Stage.REVIEW and key is Key.ACCEPT:
            self._label(now_us, "accepted")
            self._left.pop()
            self.accepted += 1
            self._next(now_us)
        elif self.stage is Stage.REVIEW:
            self._label(now_us, "redone")
            self._next(now_us)
        elif self.stage is Stage.READY or key is Key.REDO:
            self._next(now_us)

    def _next(self, now_us: int) -> None:
        self.problem = ""
        self._zero_us = now_us + self._countdown_us
        self.stage = Stage.COUNTDOWN if self._left else Stage.OVER

    def _record(self, frame: SwitchFrame | GloveFrame) -> None:
        if isinstance(frame, SwitchFrame):
            self._recorder.switches(frame)
        else:
            self._recorder.glove(frame)
        if self.stage is Stage.REVIEW:
            return
        if isinstance(frame, SwitchFrame):
            self._switches = frame
        else:
            self._glove = frame

    def _capture(self, now_us: int) -> None:
        self.problem = self._lack(now_us)
        if self.problem:
            self.stage = Stage.READY
            return
        self._label(now_us, "captured")
        self.stage = Stage.REVIEW

    def _lack(self, now_us: int) -> str:
        session = self._recorder.session
        if session.switches and (self._switches is None or now_us - self._switches.time_us > FRESH_US):
            return "the switches are silent"
        if session.switches and self._switches is not None and (lost := self._switches.lost | self._switches.unread):
            names = [name for place, name in enumerate(session.switches) if lost >> place & 1]
            return f"switches cannot be read: {list_names(names)}"
        if session.sensors and (self._glove is None or now_us - self._glove.time_us > FRESH_US):
            return "the CyberGlove is silent"
        if self._glove is not None and self._glove.status is not None and not self._glove.status & _PLUGGED:
            return "the CyberGlove is not plugged into its box"
        return ""

    def _label(self, now_us: int, event: Event) -> None:
        trial = self._left[-1]
        self._recorder.label(Label(now_us, event, trial.number, trial.grasp, self.subject, trial.object))
