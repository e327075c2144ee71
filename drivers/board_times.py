"""When the messages of a scanner board were sent, on the host's clock."""

from time import monotonic_ns

from .board_clock import BoardClock
from .scanner_messages import FromBoard, Hello, Lost, Ping, State

# How often a PING bounds the delay that all messages share; between two of them clocks drift apart by 2 ms at most.
_PING_US = 250_000
# At most this many PINGs are under way: an answer that takes longer than they do says nothing.
_UNDER_WAY = 64
_TOKENS = 0xFFFF


class BoardTimes:
    """Gives every message its time, in the host's monotonic microseconds: never one before the last one's.

    late_us   how late the last message with a time came in, which those without one are taken to share
    pings     how often the board's time was asked for
    answered  whether an answer ever came
    """

    def __init__(self) -> None:
        self._clock = BoardClock()
        self.late_us = 0
        self._time_us = self._asked_us = 0
        self._asked: dict[int, int] = {}
        self.pings = 0
        self.answered = False

    def ping(self) -> Ping:
        """Return a message that asks for the time."""
        token = self.pings % _TOKENS + 1
        self._asked_us = self._asked[token] = monotonic_ns() // 1000
        self.pings += 1
        if len(self._asked) > _UNDER_WAY:
            del self._asked[next(iter(self._asked))]
        return Ping(token)

    @property
    def due(self) -> bool:
        """Whether the time should be asked for again."""
        return monotonic_ns() // 1000 - self._asked_us >= _PING_US

    @property
    def trip_us(self) -> int:
        """By how much a message may have been sent before the time that it was given: a delay that all share."""
        return self._clock.trip_us

    def stamp(self, message: FromBoard | None, came_us: int) -> int:
        """Return the time of what came in. What carries none is taken to be as late as the last that did."""
        if message is not None and not isinstance(message, State | Lost):
            asked_us = self._asked.get(message.token) if isinstance(message, Hello) else None
            self.answered |= asked_us is not None
            self.late_us = came_us - self._clock.host_us(message.time_us, came_us, asked_us)
        self._time_us = max(self._time_us, came_us - self.late_us)
        return self._time_us
