"""JSON lines to all readers of a TCP port.

Everything happens inside `send`, without threads and without waiting: new readers are accepted, and each gets the
line if it keeps up. A slow reader loses whole lines, which shows as gaps in `number`, and delays nobody. Only the rest
of one line waits for it, and the system's buffer, which is kept small so that it does not read the past.

Places are limited. A reader that takes nothing for five seconds is dropped.
"""

import errno
import ipaddress
import os
import re
import socket
from contextlib import suppress

from thenar.drivers.errors import SettingError

from .base import SinkError, SinkKind
from .jsonl import LineSink

_BACKLOG = 16
MAX_READERS = 32
# A reader that takes no byte for this long hangs.
HANGING_S = 5.0
# About fifty lines; the kernel doubles it for its own bookkeeping.
SEND_BUFFER = 16384
# Readers accepted per frame, so that many at once do not delay it.
_KNOCKS = 16


class SocketLines(LineSink):
    """Serves the readers of a listening socket, which it takes over."""

    def __init__(self, listener: socket.socket, where: str) -> None:
        listener.setblocking(False)
        self._listener = listener
        self.where = where
        self._clients: list[_Reader] = []
        self._dropped = 0
        self._header = b""

    @property
    def address(self) -> tuple[str, int]:
        """The host and port of the socket."""
        host, port = self._listener.getsockname()[:2]
        return host, port

    def send(self, topic: str, line: bytes) -> None:
        """Accept new readers, and send every reader the line; those that come later begin with the header."""
        self._accept_clients()
        if topic == "joints":
            self._header = line
        for reader in tuple(self._clients):
            sent = self._send(reader, line)
            self.sent += sent
            self.lost += not sent

    def _accept_clients(self) -> None:
        if self._listener.fileno() < 0:
            return
        try:
            with suppress(BlockingIOError):
                for _ in range(_KNOCKS):
                    self._add_client(self._listener.accept()[0])
        except OSError as reason:  # gone before it was accepted, or no descriptors left
            self.error = reason.strerror or str(reason)

    def _add_client(self, reader: socket.socket) -> None:
        if len(self._clients) >= MAX_READERS:
            self.error = f"more than {MAX_READERS} readers: the newest were rejected"
            reader.close()
            return
        self._clients.append(_Reader(reader))
        if self._header:
            self._send(self._clients[-1], self._header)

    def _send(self, reader: "_Reader", line: bytes) -> bool:
        try:
            return reader.send(line)
        except OSError as reason:
            self._clients.remove(reader)
            reader.close()
            if reason.errno == errno.ETIMEDOUT:
                self._dropped += 1
                self.error = f"readers dropped that took nothing for {HANGING_S:g} s: {self._dropped}"
            return False

    def readers(self) -> int:
        """Return the number of readers."""
        return len(self._clients)

    def close(self) -> None:
        """Close the socket and every reader's."""
        if self._listener.fileno() < 0:
            return
        self._listener.close()
        for reader in self._clients:
            reader.close()
        self._clients.clear()


class _Reader:
    """A reader of the lines; the rest of one line may wait for it here."""

    __slots__ = ("_rest", "_socket")

    def __init__(self, reader: socket.socket) -> None:
        reader.setblocking(False)
        reader.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        reader.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # The system ends the connection if it takes nothing of what waits for it.
        reader.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, round(1000 * HANGING_S))
        self._socket, self._rest = reader, b""

    def send(self, line: bytes) -> bool:
        """Send `line` if there is room for it; return whether it was begun. Raises OSError if the reader is gone."""
        left = self._rest + line
        took = 0
        with suppress(BlockingIOError):
            while took < len(left):
                took += self._socket.send(left[took:])
        sent = took > len(self._rest)
        # Of a line of which nothing was sent, nothing is kept: it is lost, and the next one starts afresh.
        self._rest = left[took:] if sent else self._rest[took:]
        return sent

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


def open_tcp(place: str, *, public: bool = False) -> SocketLines:
    """Return a sink on a TCP port: "127.0.0.1:7777", "localhost:7777", "[::1]:7777" or, on 127.0.0.1, "7777".

    Anyone who can connect can read, so only addresses of this machine are accepted unless `public`. Port 0 means any
    free one. Raises SinkError, or SettingError if `place` is not such an address.
    """
    where = f"tcp:{place}" + "?public" * public
    return SocketLines(listen(place, where, "tcp:127.0.0.1:7777", public=public), where)


def listen(place: str, where: str, example: str, *, public: bool = True) -> socket.socket:
    """Return a socket that listens at `place`; arguments and errors are those of `resolve`.

    Raises SinkError if it cannot be opened.
    """
    family, address = resolve(place, where, example, public=public)
    dual = family == socket.AF_INET6 and socket.has_dualstack_ipv6()
    try:
        return socket.create_server(address, family=family, backlog=_BACKLOG, dualstack_ipv6=dual)
    except OSError as reason:
        hint = ": another process serves that port; use another" if reason.errno == errno.EADDRINUSE else ""
        raise SinkError(f"{where} cannot be opened: {os.strerror(reason.errno or 0)}{hint}") from None


def resolve(
    place: str, where: str, example: str, *, public: bool = True
) -> tuple[socket.AddressFamily, tuple[str, int]]:
    """Return the family and the address, host and port first, of HOST:PORT, [HOST]:PORT or a PORT of 127.0.0.1.

    Raises SettingError if `place` is not an address, or, unless `public`, one that other machines can read; messages
    use `where` and `example`.
    """
    found = re.fullmatch(r"(?:(?:\[([^][]+)\]|([^][:]+)):)?([0-9]{1,5})", place)
    if not found or int(found[3]) > 65535:
        raise SettingError(f"{where} is not an address: write it as {example}, with a port from 0 to 65535")
    host = found[1] or found[2] or "127.0.0.1"
    try:
        family, _, _, _, address = socket.getaddrinfo(host, int(found[3]), type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError):
        raise SettingError(f"{where}: there is no host {host}: use 127.0.0.1") from None
    if not public and not ipaddress.ip_address(str(address[0]).partition("%")[0]).is_loopback:
        bare = where.partition("?")[0]
        raise SettingError(
            f"{bare}: other machines could read it there: use 127.0.0.1, or write {bare}?public to let them"
        )
    return family, address  # type: ignore[return-value]


MEMBER = SinkKind(
    "tcp",
    "127.0.0.1:PORT",
    "JSON lines to all who connect to a port of this machine; with public also to other machines",
    lambda where: open_tcp(where.place, public="public" in where.options),
    ("public",),
    rank=2,
)
