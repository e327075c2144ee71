"""The live loop: whenever a device has delivered something, and at least once in half a frame period, a grasp."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Event
from time import time_ns
from typing import Protocol

from ..recording.writer import Recorder
from .arrivals import Taken
from .frames import GloveFrame, SwitchFrame, now_us
from .joiner import LiveRecognizer
from .published import LiveGrasp


class Feed(Protocol):
    """Where frames come from: `Sources`, as a rule."""

    @property
    def patience_s(self) -> float:
        """How long to wait for something new before looking what has become too old."""

    def wait(self, timeout_s: float) -> bool:
        """Wait until something has come in that was not taken; return whether it has."""

    def take(self) -> Taken:
        """Return the newest frames, and all that arrived since the last call."""


@dataclass(frozen=True, slots=True)
class Moment:
    """A grasp, and what it came of: the newest frames, and the joints' codes, None while the joints are lost."""

    grasp: LiveGrasp
    switches: SwitchFrame | None
    glove: GloveFrame | None
    codes: Sequence[int] | None


class LiveLoop:
    """Joins what `sources` deliver, recognises it, hands it on, and records it where there is a recorder.

    What is recorded is in the order in which it was used: the frames that came in, then the grasp that came of the
    newest of them; so a replay of the recording gives the same grasps.
    """

    def __init__(
        self,
        sources: Feed,
        recognizer: LiveRecognizer,
        tell: Callable[[Moment], None],
        recorder: Recorder | None = None,
    ) -> None:
        self._sources, self._recognizer, self._tell, self._recorder = sources, recognizer, tell, recorder
        self.frames = 0

    def run(self, stop: Event, frames: int | None = None) -> None:
        """Run until `stop` is set, or until so many `frames` are published."""
        while not stop.is_set() and (frames is None or self.frames < frames):
            self._sources.wait(self._sources.patience_s)
            self.step()

    def step(self) -> None:
        """Recognise the newest frames, and hand on what came of them."""
        taken = self._sources.take()
        now = now_us()
        grasp = self._recognizer.step(now, time_ns() // 1000, taken.switches, taken.glove)
        if self._recorder is not None:
            _record(self._recorder, taken, grasp)
        self._tell(Moment(grasp, taken.switches, taken.glove, self._recognizer.codes(now, None)))
        self.frames += 1


def _record(recorder: Recorder, taken: Taken, grasp: LiveGrasp) -> None:
    for frame in taken.arrived:
        if isinstance(frame, SwitchFrame):
            recorder.switches(frame)
        else:
            recorder.glove(frame)
    recorder.grasp(grasp)
