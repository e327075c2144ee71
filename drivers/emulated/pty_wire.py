"""One pty from plugging in to unplugging, with the thread that carries bytes between it and a device's model."""

import contextlib
import os
import pty
import select
import socket
import tty
from collections.abc import Callable
from threading import Thread, current_thread
from time import monotonic

from .pacing import Outgoing

_CHUNK_S = 0.002  # longer messages arrive in pieces, as they do from a real adapter
_HEARD = 256


class PtyWire:
    """Opens a pty in raw mode and carries bytes until it is closed. The slave stays open here.

    A client that closes its side hangs nothing up, and its successor finds the same port. Bytes from the client are
    heard as late as they would be on a wire of the same pace, one chunk at a time, so that a fast writer is slowed down
    as by a real port.
    """

    def __init__(self, outgoing: Outgoing, heard: Callable[[bytes], None], sent: Callable[[int], None]) -> None:
        self._outgoing, self._heard, self._sent = outgoing, heard, sent
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
        """Have the thread look at what is queued."""
        with contextlib.suppress(OSError):  # full: it will wake all the same; closed: nothing to wake
            self._wake_write.send(b"\0")

    def close(self) -> None:
        """Close the pty: the client sees its port die. From the line's own thread, as soon as it comes back to it."""
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
            self._sent(written)

    def _hear(self) -> None:
        if self._incoming is None:
            with contextlib.suppress(BlockingIOError):
                data = os.read(self._master, _HEARD)
                self._incoming = monotonic() + len(data) * self._outgoing.byte_s, data
        if self._incoming is not None and self._incoming[0] <= monotonic():
            data, self._incoming = self._incoming[1], None
            self._heard(data)

    def _wait(self) -> None:
        """Sleep until a byte is due, the client sends, it reads again after it had not, or somebody wakes us."""
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
