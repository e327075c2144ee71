"""The newest frame of a device, and whether it still counts."""

from typing import Generic, Protocol, TypeVar

# A frame counts for so many of its periods: one more may be late, two may not.
PERIODS = 2


class Timed(Protocol):
    """A frame with the time at which it was read."""

    @property
    def time_us(self) -> int:
        """Microseconds of the host's monotonic clock."""


F = TypeVar("F", bound=Timed)


class Newest(Generic[F]):
    """Keeps the newest frame of a device whose frames should come every `period_us`; None: there is no such device.

    A frame that claims to be of the future is taken to be of the moment at which it came: whatever a device's clock
    says, a frame ages from then on.
    """

    __slots__ = ("_frame", "_longest_us", "_time_us")

    def __init__(self, period_us: int | None) -> None:
        self._longest_us = None if period_us is None else PERIODS * period_us
        self._frame: F | None = None
        self._time_us = 0

    def take(self, frame: F | None, now_us: int) -> None:
        """Take what came in by now: nothing, the same frame again, or another; one older than the newest is dropped."""
        if frame is None or self._longest_us is None or frame == self._frame:
            return
        time_us = min(frame.time_us, now_us)
        if self._frame is None or time_us >= self._time_us:
            self._frame, self._time_us = frame, time_us

    @property
    def time_us(self) -> int | None:
        """When the newest frame was read; None before the first."""
        return None if self._frame is None else self._time_us

    def fresh(self, now_us: int) -> F | None:
        """Return the newest frame, None if it is older than two periods."""
        if self._longest_us is None or now_us - self._time_us > self._longest_us:
            return None
        return self._frame
