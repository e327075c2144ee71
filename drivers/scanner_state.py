"""The known state of a scanner board: its closed keys, and the times of its messages."""

from itertools import combinations
from time import monotonic_ns

from .scanner_protocol import WITHOUT_DIODES, Channels, Event, FromBoard, Heartbeat, Hello, Lost, Mask, Ping, State

_MODULUS = 1 << 32
# A ceramic resonator is wrong by up to 0.5 %, so the offset may grow between two frames by 1/128 of their interval.
_DRIFT_SHIFT = 7
# Period of the PINGs that bound the delay common to all messages; clocks drift by at most 2 ms in between.
_PING_US = 250_000
# At most this many PINGs are pending: a reply that takes longer carries no information.
_UNDER_WAY = 64
_TOKENS = 0xFFFF


def ambiguous(closed: Mask, rows: int, columns: int) -> Mask:
    """Return the keys, bits row * columns + column, that read closed but may be ghosts of others.

    Current through three closed corners of a rectangle makes the fourth read closed; which of the four is the ghost is
    not observable. If two rows share two or more columns, all keys there are doubtful. A key that reads open is open.
    """
    row = (1 << columns) - 1
    held = [(shift, closed >> shift & row) for shift in range(0, rows * columns, columns)]
    crowded = [(shift, bits) for shift, bits in held if bits & (bits - 1)]
    doubtful = 0
    for (one, bits), (other, others) in combinations(crowded, 2):
        common = bits & others
        if common & (common - 1):
            doubtful |= common << one | common << other
    return doubtful


class BoardKeys:
    """The keys of a board, initialised from its HELLO, which was the frame numbered `sequence`.

    They are unknown until a HEARTBEAT and the frame before it arrive: that is a LOST if there are keys that the board
    cannot read. `trusted` is True if no message about the keys is missing.
    """

    def __init__(self, rows: int = 0, columns: int = 0, flags: int = 0, sequence: int = 0) -> None:
        self._rows, self._columns, self._flags, self._sequence = rows, columns, flags, sequence
        self.keys = rows * columns
        self._all = (1 << self.keys) - 1
        self.closed: Mask = 0
        self.lost: Mask = 0
        self.gaps = 0
        self._follows = True  # the frame before the last one was read, too
        self._unread = False  # the last one was valid, but could not be read
        self._is_lost = self._after_lost = False  # the last one, and the one before it, were LOSTs
        self.restarted()

    @property
    def known(self) -> Mask:
        """The keys with a known state."""
        if not self.trusted:
            return 0
        readable = self._all & ~self.lost
        if not self._flags & WITHOUT_DIODES:
            return readable
        return readable & ~ambiguous(self.closed, self._rows, self._columns)

    def restarted(self) -> None:
        """Record that the board restarted: its earlier messages no longer apply."""
        self._has_bitmap = self._has_lost = self.trusted = False

    def damaged(self) -> None:
        """Record bytes that were not a frame: they may have been an EVENT. A lost LOST would leave a gap."""
        self._has_bitmap = self.trusted = False

    def misread(self) -> None:
        """Record that the last frame could not be read: it may have been any message."""
        self._unread = True
        self.restarted()

    def numbered(self, sequence: int) -> None:
        """Record the number of a frame; a gap before it means lost frames or a restart of the board."""
        gap = sequence != (self._sequence + 1) & 0xFF
        self._follows, self._unread, self._sequence = not (gap or self._unread), False, sequence
        self._after_lost, self._is_lost = self._is_lost, False
        if gap:
            self.gaps += 1
            self.restarted()

    def heard(self, message: FromBoard) -> None:
        """Update the keys from the last numbered frame. An EVENT is ignored before the first bitmap."""
        match message:
            case State():
                self.closed, self._has_bitmap = message.closed, True
            case Heartbeat():
                self.closed, self._has_bitmap = message.closed, True
                self._not_lost()
            case Lost():
                self.lost, self._has_lost, self._is_lost = message.lost, True, True
            case Event() if self._has_bitmap:
                bit = 1 << message.key
                self.closed = self.closed | bit if message.edge else self.closed & ~bit
        self.trusted = self._has_bitmap and self._has_lost

    def _not_lost(self) -> None:
        """Conclude from a HEARTBEAT that does not follow a LOST that all keys can be read."""
        if self._follows and not self._after_lost:
            self.lost, self._has_lost = 0, True


class BoardClock:
    """Estimates the offset between the clocks as the smallest delay seen, forgotten no faster than clocks drift apart.

    Delays only add to the offset, so the smallest is the best estimate. A host that falls behind and reads an old
    buffer thus gets the times at which frames were sent, not those at which they were read. The board's clock wraps
    after 71.6 minutes; it may restart at any time.

    A delay common to all frames does not show in that offset. Frames that the host requested bound it from the other
    side: they were not sent before the request. `trip_us` is the distance between the two bounds.
    """

    def __init__(self) -> None:
        self._board: int | None = None
        self._offset = 0
        self._least: int | None = None
        self._guessed = False

    @property
    def trip_us(self) -> int:
        """The most by which a frame may be older than its time from `host_us`; 0 before the first requested frame."""
        return 0 if self._least is None else self._offset - self._least

    def host_us(self, board_us: int, came_us: int, asked_us: int | None = None) -> int:
        """Return the host's time of `board_us` (0 to 2**32 - 1) in a frame that arrived at `came_us`, which bounds it.

        asked_us  when the host requested this frame, if it did: the board cannot have sent it before
        """
        if self._board is None:
            self._board, self._offset = board_us, came_us - board_us
        passed, trip_us = (board_us - self._board) % _MODULUS, self.trip_us
        drift_us = passed >> _DRIFT_SHIFT
        self._board += passed
        self._offset = min(came_us - self._board, self._offset + drift_us)
        if self._least is not None:
            self._least -= drift_us
            # If the bounds cross, the board has restarted: keep the trip time until the next request.
            self._guessed |= self._least > self._offset
            if self._guessed:
                self._least = min(self._least, self._offset - trip_us)
        if asked_us is not None:
            asked = asked_us - self._board
            self._offset = max(self._offset, asked)
            self._least = asked if self._least is None or self._guessed else max(self._least, asked)
            self._guessed = False
        return self._board + self._offset


class BoardTimes:
    """Gives every message its time, in the host's monotonic microseconds, never decreasing.

    clock     bounds the delay common to all messages (`trip_us`)
    late_us   delay of the last message with a time; messages without one are assumed to share it
    pings     how often the board's time was requested
    replied   whether a reply ever came
    """

    def __init__(self) -> None:
        self.clock = BoardClock()
        self.late_us = 0
        self._time_us = self._asked_us = 0
        self._asked: dict[int, int] = {}
        self.pings = 0
        self.replied = False

    def ping(self) -> Ping:
        """Return a message that requests the time."""
        token = self.pings % _TOKENS + 1
        self._asked_us = self._asked[token] = monotonic_ns() // 1000
        self.pings += 1
        if len(self._asked) > _UNDER_WAY:
            del self._asked[next(iter(self._asked))]
        return Ping(token)

    @property
    def due(self) -> bool:
        """Whether the next request for the time is due."""
        return monotonic_ns() // 1000 - self._asked_us >= _PING_US

    def stamp(self, message: FromBoard | None, came_us: int) -> int:
        """Return the time of a message. One without a time is assumed to be as late as the last that had one."""
        if message is not None and not isinstance(message, State | Lost | Channels):
            asked_us = self._asked.get(message.token) if isinstance(message, Hello) else None
            self.replied |= asked_us is not None
            self.late_us = came_us - self.clock.host_us(message.time_us, came_us, asked_us)
        self._time_us = max(self._time_us, came_us - self.late_us)
        return self._time_us
