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


class Tally:
    """Counts how often each of `bits` bits was set, of all at once: bit k of plane p is bit p of the count of bit k."""

    def __init__(self, bits: int) -> None:
        self._bits = bits
        self._planes: list[Mask] = []

    def add(self, mask: Mask) -> None:
        """Count the bits of `mask`, one each."""
        for place, plane in enumerate(self._planes):
            if not mask:
                return
            self._planes[place], mask = plane ^ mask, plane & mask
        if mask:
            self._planes.append(mask)

    def end(self) -> list[int]:
        """Return the counts, and begin again at 0."""
        planes, self._planes = self._planes, []
        return [sum((plane >> bit & 1) << place for place, plane in enumerate(planes)) for bit in range(self._bits)]


class Chattering:
    """Counts changes of every switch, a second at a time."""

    def __init__(self, switches: int) -> None:
        self._closed: Mask = 0
        self._began_us: int | None = None
        self._changes = Tally(switches)
        self.switches: tuple[int, ...] = ()

    def frame(self, time_us: int, closed: Mask, read: Mask) -> None:
        """Take a frame in which the switches `read` were read; `switches` are then those of the last whole second."""
        if self._began_us is None:
            self._began_us = time_us
        if time_us - self._began_us >= WINDOW_US:
            self.switches = tuple(number for number, n in enumerate(self._changes.end()) if n > MOST_CHANGES)
            self._began_us = time_us
        self._changes.add((closed ^ self._closed) & read)
        self._closed = (self._closed & ~read) | (closed & read)
