"""The newest of several devices that each read a part of the switches, as one frame."""

from collections.abc import Sequence
from dataclasses import dataclass

from .frames import Mask, SwitchFrame


@dataclass(slots=True)
class Part:
    """The switches that one device reads, its newest frame (bits as in the whole), and the last moment it counts."""

    owned: Mask
    newest: SwitchFrame | None = None
    expires_us: int = 0

    def take(self, frame: SwitchFrame, now_us: int, longest_us: int) -> None:
        """Take a frame that came in at now_us and counts for longest_us from the time at which it was read."""
        self.newest, self.expires_us = frame, min(frame.time_us, now_us) + longest_us

    def fresh(self, now_us: int) -> SwitchFrame | None:
        """Return the newest frame, None once it has expired."""
        return self.newest if now_us <= self.expires_us else None


class Parts:
    """Parts that share no switch. Switches that no part owns are always lost."""

    def __init__(self, switches: int, parts: Sequence[Part]) -> None:
        self.parts = tuple(parts)
        self._nobodys = (1 << switches) - 1 & ~sum(part.owned for part in parts)

    def joined(self, now_us: int) -> SwitchFrame | None:
        """Return the newest of all parts as one frame, None before the first came.

        What a part owns is lost once its frame has expired, all of it when all have. The time is that of the newest
        frame, expired or not: it never falls when a part does.
        """
        times = [part.newest.time_us for part in self.parts if part.newest is not None]
        if not times:
            return None
        fresh = [(part, part.fresh(now_us)) for part in self.parts]
        frames = [frame for _, frame in fresh if frame is not None]
        silent = sum(part.owned for part, frame in fresh if frame is None)
        if len(frames) == 1 and not (silent | self._nobodys):
            return frames[0]
        return SwitchFrame(
            time_us=max(times),
            closed=sum(frame.closed for frame in frames),
            lost=sum(frame.lost for frame in frames) | silent | self._nobodys,
            unread=sum(frame.unread for frame in frames),
            glove=next((frame.glove for frame in frames if frame.unread), None),
        )
