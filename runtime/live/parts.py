"""The newest of several devices that each read a part of the switches, as one frame."""

from collections.abc import Sequence
from dataclasses import dataclass

from .frames import Mask, SwitchFrame
from .newest import PERIODS


@dataclass(slots=True)
class Part:
    """The switches that one device reads, how often it should, and its newest frame (bits as in the whole)."""

    owned: Mask
    period_us: int
    newest: SwitchFrame | None = None

    def fresh(self, now_us: int) -> SwitchFrame | None:
        """Return the newest frame, None if it is older than two periods."""
        newest = self.newest
        return newest if newest and now_us - newest.time_us <= PERIODS * self.period_us else None


class Parts:
    """Parts that share no switch. Switches that no part owns are always lost."""

    def __init__(self, switches: int, parts: Sequence[Part]) -> None:
        self.parts = tuple(parts)
        self._nobodys = (1 << switches) - 1 & ~sum(part.owned for part in parts)

    def joined(self, now_us: int) -> SwitchFrame | None:
        """Return the newest of all parts, None before the first came: its time is that of the newest, and what a part
        that fell silent owns is lost.
        """
        fresh = [(part, part.fresh(now_us)) for part in self.parts]
        frames = [frame for _, frame in fresh if frame is not None]
        if not frames:
            return max(
                (part.newest for part in self.parts if part.newest), key=lambda frame: frame.time_us, default=None
            )
        silent = sum(part.owned for part, frame in fresh if frame is None)
        if len(frames) == 1 and not (silent | self._nobodys):
            return frames[0]
        return SwitchFrame(
            time_us=max(frame.time_us for frame in frames),
            closed=sum(frame.closed for frame in frames),
            lost=sum(frame.lost for frame in frames) | silent | self._nobodys,
            unread=sum(frame.unread for frame in frames),
            glove=next((frame.glove for frame in frames if frame.unread), None),
        )
