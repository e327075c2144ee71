"""When the bytes of queued messages arrive at the far end of a serial line, by an absolute schedule."""

from collections import deque
from threading import Lock
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

BITS_PER_BYTE = 10  # start, eight data, stop


class Outgoing:
    """Messages on their way out, each from the moment it was queued or the line became free, whichever is later.

    byte_s is how long a byte takes, in seconds (0: no time at all). Times are seconds of any one clock. More than
    `most` bytes never wait: the oldest waiting messages are dropped whole, and counted. `put` may be called by any
    thread, the rest by one.
    """

    def __init__(self, byte_s: float, most: int) -> None:
        self.byte_s = byte_s
        self.most = most
        self.damage: Callable[[bytes], bytes] | None = None
        self.dropped = 0
        self._lock = Lock()
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._waiting_bytes = 0
        self._rest = b""
        self._from = self._free_at = 0.0

    def put(self, now: float, message: bytes) -> None:
        """Queue a message."""
        with self._lock:
            self._waiting.append((now, message))
            self._waiting_bytes += len(message)
            while self._waiting_bytes > self.most and len(self._waiting) > 1:
                self._waiting_bytes -= len(self._waiting.popleft()[1])
                self.dropped += 1

    def clear(self) -> None:
        """Forget what waits and what is under way. Only while no thread sends."""
        with self._lock:
            self._waiting.clear()
            self._waiting_bytes = 0
            self._rest = b""
            self._free_at = 0.0

    def arrived(self, now: float) -> bytes:
        """Return the bytes of one message that have arrived by `now` and were not yet taken; empty if none have."""
        while not self._rest and self._begin():
            pass
        if not self.byte_s:
            return self._rest
        # A hundredth of a byte of grace, so that a wake-up that rounding puts before the byte's end still finds it.
        return self._rest[: max(0, int((now - self._from) / self.byte_s + 0.01))]

    def take(self, count: int) -> None:
        """Note that `count` bytes of what has arrived were handed over."""
        self._rest = self._rest[count:]
        self._from += count * self.byte_s

    def hold(self, now: float) -> None:
        """Note that nobody takes what has arrived: what follows is paced from `now`, not sent in a burst."""
        arrived = len(self.arrived(now))
        self._from = max(self._from, now - arrived * self.byte_s)
        self._free_at = self._from + len(self._rest) * self.byte_s

    def next_at(self, at_most_bytes: int) -> float | None:
        """Return when so many more bytes, or the rest of the message, have arrived; None if nothing is under way."""
        while not self._rest and self._begin():
            pass
        return self._from + min(len(self._rest), at_most_bytes) * self.byte_s if self._rest else None

    def _begin(self) -> bool:
        """Take the next waiting message onto the wire, as it is after damage. False if none waits."""
        with self._lock:
            if not self._waiting:
                return False
            queued_at, message = self._waiting.popleft()
            self._waiting_bytes -= len(message)
        damage = self.damage  # another thread may take it away meanwhile
        self._rest = message if damage is None else damage(message)
        self._from = max(queued_at, self._free_at)
        self._free_at = self._from + len(self._rest) * self.byte_s
        return True
