"""What came in from all devices: the newest frames, and those that nobody took yet."""

from collections import deque
from dataclasses import dataclass
from threading import Condition

from .frames import GloveFrame, SwitchFrame, now_us
from .newest import PERIODS
from .parts import Part, Parts

# Frames that came in and were not taken yet; a loop that stalls for longer than they last loses the oldest.
_MOST_WAITING = 4096


@dataclass(frozen=True, slots=True)
class Taken:
    """The newest frames, and all that arrived since the last time, in order."""

    switches: SwitchFrame | None
    glove: GloveFrame | None
    arrived: tuple[SwitchFrame | GloveFrame, ...]


class Arrivals:
    """Frames from the threads of the devices, for the one thread that takes them.

    What these methods share is only touched under the condition. `switches`, `glove` and `overflowed` may be read
    without it: each is one value that is replaced whole.

    switches, glove  the newest frames, None before the first
    overflowed       frames that nobody took in time: a recording lacks them
    """

    def __init__(self, parts: Parts) -> None:
        self.switches: SwitchFrame | None = None
        self.glove: GloveFrame | None = None
        self.overflowed = 0
        self._parts = parts
        self._waiting: deque[SwitchFrame | GloveFrame] = deque(maxlen=_MOST_WAITING)
        self._condition = Condition()

    def put_switches(self, part: Part, frame: SwitchFrame, longest_us: int) -> None:
        """Take in a frame of the switches of `part`, which counts for longest_us from the time at which it was read."""
        with self._condition:
            now = now_us()
            part.take(frame, now, longest_us)
            self.switches = self._parts.joined(now)
            if self.switches is not None:
                self._wait_for_taking(self.switches)
            self._condition.notify_all()

    def put_glove(self, frame: GloveFrame) -> None:
        """Take in a record of the glove."""
        with self._condition:
            self.glove = frame
            self._wait_for_taking(frame)
            self._condition.notify_all()

    def wait(self, timeout_s: float) -> bool:
        """Wait until something has come in that was not taken; return whether it has."""
        with self._condition:
            return self._condition.wait_for(lambda: bool(self._waiting), timeout_s)

    def fresh_for_us(self, now_us: int, glove_period_us: int | None) -> int | None:
        """Return after how many microseconds the first of the fresh frames is too old; None: none is fresh."""
        with self._condition:
            last = [part.expires_us for part in self._parts.parts if part.newest is not None]
            if self.glove is not None and glove_period_us is not None:
                last.append(self.glove.time_us + PERIODS * glove_period_us)
        return min((last_us + 1 - now_us for last_us in last if last_us >= now_us), default=None)

    def take(self) -> Taken:
        """Return the newest frames, and all that arrived since the last call.

        A part of the switches that fell silent meanwhile is lost from now on, whether or not another one speaks.
        """
        with self._condition:
            switches = self._parts.joined(now_us())
            if switches is not None and switches != self.switches:
                self.switches = switches
                self._wait_for_taking(switches)
            arrived = tuple(self._waiting)
            self._waiting.clear()
            return Taken(self.switches, self.glove, arrived)

    def _wait_for_taking(self, frame: SwitchFrame | GloveFrame) -> None:
        self.overflowed += len(self._waiting) == _MOST_WAITING
        self._waiting.append(frame)
