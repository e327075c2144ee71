"""JSON lines to whoever connects to a socket, many at a time.

Everything happens inside `publish`, without threads and without waiting: new readers are let in, each gets the line if
it keeps up. A slow reader loses whole lines, sees it by the gaps in `number`, and holds nobody up. What waits for it is
the rest of one line and what the system buffers, which is kept small so that it does not read the past.
"""

import select
import socket
from collections.abc import Callable
from contextlib import suppress

from ..live.health import HealthReport
from ..live.published import LiveGrasp
from ..preshape.preshape import Preshape
from .angles import JointAngles
from .line import encode, encode_health
from .outlet import Outlet
from .sink import SinkReport

MAX_READERS = 32
# Some fifty lines; the kernel doubles it for its own bookkeeping.
SEND_BUFFER = 16384


class SocketLines:
    """Serves the readers of a listening socket, which it takes over; `tidy` is called once, at the end."""

    __slots__ = ("_error", "_knocks", "_listener", "_lost", "_readers", "_sent", "_tidy", "_where")

    def __init__(self, listener: socket.socket, where: str, tidy: Callable[[], None] = lambda: None) -> None:
        listener.setblocking(False)
        self._listener = listener
        self._knocks = select.poll()
        self._knocks.register(listener, select.POLLIN)
        self._where = where
        self._tidy = tidy
        self._readers: dict[socket.socket, Outlet] = {}
        self._sent = self._lost = 0
        self._error = ""

    @property
    def address(self) -> tuple[str, int] | str:
        """Where it listens: host and port, or the path."""
        name: tuple[str, int] | str = self._listener.getsockname()
        return name if isinstance(name, str) else name[:2]

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Let in who knocks, and give every reader the line."""
        self._let_in()
        if self._readers:
            self._send_all(encode(grasp, preshape, angles))

    def health(self, report: HealthReport) -> None:
        """Give every reader the report's line."""
        if self._readers:
            self._send_all(encode_health(report))

    def _let_in(self) -> None:
        if self._listener.fileno() < 0 or not self._knocks.poll(0):
            return
        try:
            with suppress(BlockingIOError):
                while True:
                    self._seat(self._listener.accept()[0])
        except OSError as reason:  # gone between knocking and entering, or no descriptors left
            self._error = reason.strerror or str(reason)

    def _seat(self, reader: socket.socket) -> None:
        if len(self._readers) >= MAX_READERS:
            self._error = f"more than {MAX_READERS} readers: the newest were turned away"
            reader.close()
        else:
            self._readers[reader] = _outlet(reader)

    def _send_all(self, line: bytes) -> None:
        for reader in tuple(self._readers):
            self._send(reader, line)

    def _send(self, reader: socket.socket, line: bytes) -> None:
        try:
            sent = self._readers[reader].send(line)
        except OSError:
            del self._readers[reader]
            reader.close()
            sent = False
        self._sent += sent
        self._lost += not sent

    def report(self) -> SinkReport:
        """Return how this sink is doing."""
        return SinkReport(self._where, len(self._readers), self._sent, self._lost, self._error)

    def close(self) -> None:
        """Close the socket and every reader's."""
        if self._listener.fileno() < 0:
            return
        self._listener.close()
        for reader in self._readers:
            reader.close()
        self._readers.clear()
        self._tidy()


def _outlet(reader: socket.socket) -> Outlet:
    reader.setblocking(False)
    reader.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
    if reader.family != socket.AF_UNIX:
        reader.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return Outlet(reader.send)
