"""How often frames come, and switches that change more often than a hand can."""

from .frames import Mask

WINDOW_US = 1_000_000
# Nobody presses and releases a switch ten times a second; a contact that is loose does.
MOST_CHANGES = 20


class FrameRate:
    """Frames per second over the last second."""

    def __init__(self) -> None:
        self._began_us: int | None = None
        self._frames = 0
        self._hz = 0.0

    def frame(self, time_us: int) -> None:
        """Count a frame."""
        if self._began_us is None:
            self._began_us = time_us
            return
        self._frames += 1
        if time_us - self._began_us >= WINDOW_US:
            self._hz = self._over(time_us)
            self._began_us, self._frames = time_us, 0

    def hz(self, now_us: int) -> float:
        """Return the rate of the last whole second; of the time since the last frames, when they do not come."""
        if self._began_us is not None and now_us - self._began_us > 2 * WINDOW_US:
            return self._over(now_us)
        return self._hz

    def _over(self, now_us: int) -> float:
        return self._frames * 1e6 / (now_us - (self._began_us or 0))


class Chattering:
    """Counts changes of every switch, a second at a time."""

    def __init__(self, switches: int) -> None:
        self._closed: Mask = 0
        self._began_us: int | None = None
        self._changes = [0] * switches
        self.switches: tuple[int, ...] = ()

    def frame(self, time_us: int, closed: Mask, read: Mask) -> None:
        """Take a frame in which the switches `read` were read; `switches` are then those of the last whole second."""
        if self._began_us is None:
            self._began_us = time_us
        if time_us - self._began_us >= WINDOW_US:
            self.switches = tuple(number for number, n in enumerate(self._changes) if n > MOST_CHANGES)
            self._changes = [0] * len(self._changes)
            self._began_us = time_us
        changed = (closed ^ self._closed) & read
        while changed:
            bit = changed & -changed
            self._changes[bit.bit_length() - 1] += 1
            changed ^= bit
        self._closed = (self._closed & ~read) | (closed & read)
