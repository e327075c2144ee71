"""When the messages of a scanner board were sent, on the host's clock."""

from time import monotonic_ns

from .board_clock import BoardClock
from .scanner_messages import FromBoard, Hello, Lost, Ping, State

# What comes in later than this had to wait somewhere, or the clocks lost each other: a PING tells, once a second.
_LATE_US = 250_000
_PING_AGAIN_US = 1_000_000
_TOKENS = 0xFFFF


class BoardTimes:
    """Gives every message its time, in the host's monotonic microseconds: never one before the last one's.

    late_us  how late the last message with a time of its own came in, which those without one are taken to share
    pings    how often the board's time was asked for
    """

    def __init__(self) -> None:
        self._clock = BoardClock()
        self.late_us = 0
        self._time_us = self._asked_us = 0
        self.pings = 0

    def ping(self) -> Ping:
        """Return a message that asks for the time; the one before counts no more."""
        self._asked_us = monotonic_ns() // 1000
        self.pings += 1
        return Ping(self._token)

    def doubtful(self, came_us: int) -> bool:
        """Whether what last came in was so late that the time should be asked for, and it was not just now."""
        return self.late_us > _LATE_US and came_us - self._asked_us >= _PING_AGAIN_US

    def stamp(self, message: FromBoard | None, came_us: int) -> int:
        """Return the time of what came in. What carries none is taken to be as late as the last that did."""
        if message is not None and not isinstance(message, State | Lost):
            answer = isinstance(message, Hello) and self.pings > 0 and message.token == self._token
            asked_us = self._asked_us if answer else None
            self.late_us = came_us - self._clock.host_us(message.time_us, came_us, asked_us)
        self._time_us = max(self._time_us, came_us - self.late_us)
        return self._time_us

    @property
    def _token(self) -> int:
        return (self.pings - 1) % _TOKENS + 1
