"""The far end of a serial line: a pty that any serial client opens by name, paced like a wire."""

import contextlib
import os
import pty
import select
import socket
import tty
from collections import deque
from collections.abc import Callable
from pathlib import Path
from threading import Lock, Thread, current_thread
from time import monotonic

from ..closing import Closing
from ..errors import DeviceError
from ..serial_line import BITS_A_BYTE

_CHUNK_S = 0.002  # longer messages arrive in pieces, as they do from a real adapter
_HEARD = 256
_MOST_WAITING = 4096


class Outgoing:
    """Outgoing messages, each sent when it was queued or the line became free, whichever is later.

    byte_s is the time of a byte in seconds (0: none). All times are seconds of one arbitrary clock. At most `most`
    bytes wait: older waiting messages are dropped whole, and counted. `put` may be called by any thread, the other
    methods by one.
    """

    def __init__(self, byte_s: float, most: int) -> None:
        self.byte_s = byte_s
        self.most = most
        self.damage: Callable[[bytes], bytes] | None = None
        self.dropped = self.sent_bytes = 0
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
        """Drop waiting and partly sent messages. Only while no thread sends."""
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
        # A hundredth of a byte of grace, so that a wake-up that rounding puts before the byte's end still succeeds.
        return self._rest[: max(0, int((now - self._from) / self.byte_s + 0.01))]

    def take(self, count: int) -> None:
        """Record that `count` arrived bytes were delivered."""
        self.sent_bytes += count
        self._rest = self._rest[count:]
        self._from += count * self.byte_s

    def hold(self, now: float) -> None:
        """Record that arrived bytes were not accepted: later ones are paced from `now`, not sent in a burst."""
        arrived = len(self.arrived(now))
        self._from = max(self._from, now - arrived * self.byte_s)
        self._free_at = self._from + len(self._rest) * self.byte_s

    def next_at(self, at_most_bytes: int) -> float | None:
        """Return the arrival time of the next `at_most_bytes`, or of the rest of the message; None if it is idle."""
        while not self._rest and self._begin():
            pass
        return self._from + min(len(self._rest), at_most_bytes) * self.byte_s if self._rest else None

    def _begin(self) -> bool:
        """Put the next waiting message, after damage, onto the wire. False if none waits."""
        with self._lock:
            if not self._waiting:
                return False
            queued_at, message = self._waiting.popleft()
            self._waiting_bytes -= len(message)
        damage = self.damage  # another thread may remove it meanwhile
        self._rest = message if damage is None else damage(message)
        self._from = max(queued_at, self._free_at)
        self._free_at = self._from + len(self._rest) * self.byte_s
        return True


class PtyWire:
    """Opens a pty in raw mode and carries bytes until it is closed. The slave stays open here.

    A client that closes its side does not end the connection, and the next client finds the same port. Bytes from the
    client arrive as late as on a wire of the same pace, one chunk at a time, so that a fast writer is slowed down as by
    a real port.
    """

    def __init__(self, outgoing: Outgoing, heard: Callable[[bytes], None]) -> None:
        self._outgoing, self._heard = outgoing, heard
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        self._wake_read, self._wake_write = socket.socketpair()
        self._wake_read.setblocking(False)
        self._wake_write.setblocking(False)
        self._closing = False
        self._blocked = False
        self._incoming: tuple[float, bytes] | None = None
        self._thread = Thread(target=self._run, name=f"line {self.path}", daemon=True)
        self._thread.start()

    def wake(self) -> None:
        """Wake the thread to process the queue."""
        with contextlib.suppress(OSError):  # full: it will wake anyway; closed: nothing to wake
            self._wake_write.send(b"\0")

    def close(self) -> None:
        """Close the pty: the client gets a hang-up. From the line's own thread, at its next iteration."""
        self._closing = True
        self.wake()
        if current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        try:
            while not self._closing:
                self._send()
                self._hear()
                self._wait()
        finally:
            os.close(self._master)
            os.close(self._slave)
            self._wake_read.close()
            self._wake_write.close()

    def _send(self) -> None:
        self._blocked = False
        while not self._blocked and (arrived := self._outgoing.arrived(monotonic())):
            try:
                written = os.write(self._master, arrived)
            except BlockingIOError:
                self._blocked = True
                self._outgoing.hold(monotonic())
                return
            self._outgoing.take(written)

    def _hear(self) -> None:
        if self._incoming is None:
            with contextlib.suppress(BlockingIOError):
                data = os.read(self._master, _HEARD)
                self._incoming = monotonic() + len(data) * self._outgoing.byte_s, data
        if self._incoming is not None and self._incoming[0] <= monotonic():
            data, self._incoming = self._incoming[1], None
            self._heard(data)

    def _wait(self) -> None:
        """Sleep until a byte is due, the client sends or resumes reading, or `wake` is called."""
        if self._closing:
            return
        reading = [self._wake_read.fileno()] + [self._master] * (self._incoming is None)
        due = self._due()
        seconds = None if due is None else max(0.0, due - monotonic())
        woken, _, _ = select.select(reading, [self._master] if self._blocked else [], [], seconds)
        if self._wake_read.fileno() in woken:
            with contextlib.suppress(BlockingIOError):
                self._wake_read.recv(4096)

    def _due(self) -> float | None:
        byte_s = self._outgoing.byte_s
        chunk = max(1, int(_CHUNK_S / byte_s)) if byte_s else 1
        sending = None if self._blocked else self._outgoing.next_at(chunk)
        times = [sending, self._incoming[0] if self._incoming else None]
        return min((time for time in times if time is not None), default=None)


class PtyLine(Closing):
    """A serial line whose near end is the port `link`.

    link   path of the port: a symbolic link to the pty, created atomically, removed on close
    baud   bits a second, ten of them a byte, both ways; a client may set any other rate on its side
    paced  False: bytes take no time

    `receive` is called from the line's own thread with the client's bytes; `damage` maps every outgoing message to the
    one after a bad cable, which may be empty. Both may be set at any time. Of the messages that wait for the line, or
    for a client that does not read, the newest 4096 bytes are kept; older messages are dropped whole.

    Raises DeviceError if the link cannot be created or the system has no pty left.
    """

    def __init__(self, link: Path, baud: int = 115200, *, paced: bool = True) -> None:
        self.link, self.baud = link, baud
        self.receive: Callable[[bytes], None] | None = None
        self._outgoing = Outgoing(BITS_A_BYTE / baud if paced else 0.0, _MOST_WAITING)
        self._unplugged = 0
        self._lock = Lock()
        self._wire: PtyWire | None = None
        self.replug()

    @property
    def damage(self) -> Callable[[bytes], bytes] | None:
        """The function applied to every outgoing message."""
        return self._outgoing.damage

    @damage.setter
    def damage(self, damage: Callable[[bytes], bytes] | None) -> None:
        self._outgoing.damage = damage

    @property
    def dropped_messages(self) -> int:
        """Number of messages never sent: too many waited, or the line was unplugged."""
        return self._outgoing.dropped + self._unplugged

    @property
    def sent_bytes(self) -> int:
        """Number of bytes delivered to clients."""
        return self._outgoing.sent_bytes

    @property
    def plugged(self) -> bool:
        """Whether there is a port to open."""
        return self._wire is not None

    def send(self, data: bytes) -> None:
        """Queue one message. Never blocks."""
        wire = self._wire
        if wire is None:
            self._unplugged += 1
            return
        self._outgoing.put(monotonic(), data)
        wire.wake()

    def unplug(self) -> None:
        """Remove the port, like a pulled USB plug: an open client gets a hang-up, and the link is gone."""
        with self._lock:
            wire, self._wire = self._wire, None
        if wire is not None:
            _unlink(self.link, wire.path)
            wire.close()

    def replug(self) -> None:
        """Create a new port under the same link. Messages that waited for the old one are dropped."""
        with self._lock:
            if self._wire is None:
                self._outgoing.clear()
                self._wire = self._plug()

    def close(self) -> None:
        """Remove the port for good."""
        self.unplug()

    def _plug(self) -> PtyWire:
        try:
            wire = PtyWire(self._outgoing, self._heard)
        except OSError as error:
            raise DeviceError(f"no pty for {self.link}: {error.strerror}; is /dev/pts mounted and not full?") from error
        try:
            _link(self.link, wire.path)
        except OSError:
            wire.close()
            raise
        return wire

    def _heard(self, data: bytes) -> None:
        receive = self.receive  # another thread may remove it meanwhile
        if receive is not None:
            receive(data)


def _link(link: Path, target: str) -> None:
    """Make `link` point to `target`. Replace only a link to a pty from an earlier run."""
    from_earlier = link.is_symlink() and str(link.readlink()).startswith("/dev/pts/")
    if (link.exists() or link.is_symlink()) and not from_earlier:
        raise DeviceError(f"{link} exists and is not an emulated port: remove it, or use another path")
    fresh = link.with_name(f".{link.name}.{os.getpid()}")
    try:
        fresh.symlink_to(target)
        fresh.replace(link)
    except OSError as error:
        fresh.unlink(missing_ok=True)
        raise DeviceError(f"{link}: cannot link a port there: {error.strerror}") from error


def _unlink(link: Path, target: str) -> None:
    """Remove `link` unless it refers to another port by now."""
    with contextlib.suppress(OSError):
        if str(link.readlink()) == target:
            link.unlink()
