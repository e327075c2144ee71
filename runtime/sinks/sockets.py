"""JSON lines to all readers of a socket, which is a path in the file system or a port of this machine.

Everything happens inside `publish`, without threads and without waiting: new readers are accepted, and each gets the
line if it keeps up. A slow reader loses whole lines, which shows as gaps in `number`, and delays nobody. Only the rest
of one line waits for it, and the system's buffer, which is kept small so that it does not read the past.

Places are limited. A reader that takes nothing for five seconds is dropped.
"""

import errno
import ipaddress
import os
import re
import select
import socket
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from thenar.drivers.errors import SettingError

from ..detail import Details
from ..preshape import Preshape
from ..published import HealthReport, JointAngles, LiveGrasp
from .base import Sink, SinkError, SinkKind, SinkReport
from .jsonl import encode, encode_detail, encode_header, encode_health

if TYPE_CHECKING:
    from ..build import Build
    from ..live.recogniser import Moment

_BACKLOG = 16
MAX_READERS = 32
# Per remote machine, so that none can take every place.
MAX_OF_ONE = 8
# A reader that takes no byte for this long hangs.
HANGING_S = 5.0
# About fifty lines; the kernel doubles it for its own bookkeeping.
SEND_BUFFER = 16384
# Readers accepted per frame, so that many at once do not delay it.
_KNOCKS = 16
# People cannot follow faster changes.
_DETAIL_US = 10_000
_HERE = frozenset({"127.0.0.1", "::1"})


class SocketLines(Sink):
    """Serves the readers of a listening socket, which it takes over; `tidy` is called once, at the end."""

    def __init__(
        self,
        listener: socket.socket,
        where: str,
        tidy: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = monotonic,
        detail: bool = False,
    ) -> None:
        """Serve `listener`; `clock` gives seconds. With `detail`, readers also get the details of grasps."""
        listener.setblocking(False)
        self._listener = listener
        self._listener_poll = select.poll()
        self._listener_poll.register(listener, select.POLLIN)
        self._where = where
        self._tidy = tidy
        self._clock = clock
        self._readers: list[_Reader] = []
        self._sent = self._lost = self._dropped = 0
        self._error = ""
        self._joints: tuple[str, ...] = ()
        self._header = b""
        self._details: Details | None = None
        self._build, self._detail_us = "" if detail else None, 0

    def begin(self, build: "Build") -> None:
        """Take the build that recognises."""
        if self._build is not None:
            self._build, self._details = build.manifest.checksum, Details(build)

    @property
    def address(self) -> tuple[str, int] | str:
        """The address of the socket: host and port, or the path."""
        name: tuple[str, int] | str = self._listener.getsockname()
        return name if isinstance(name, str) else name[:2]

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Accept new readers, and send every reader the line, after a header if the joints are others than before."""
        self._accept_clients()
        if angles is not None and angles.names != self._joints:
            self._joints, self._header = angles.names, encode_header(angles)
            self._send_all(self._header)
        if self._readers:
            self._send_all(encode(grasp, preshape, angles))

    def moment(self, moment: "Moment") -> None:
        """Send every reader the line of the grasp's details, at most a hundred times a second."""
        details, grasp = self._details, moment.grasp
        if details is not None and self._readers and not 0 <= grasp.time_us - self._detail_us < _DETAIL_US:
            self._detail_us = grasp.time_us
            self._send_all(encode_detail(details(moment), grasp.number, self._build or ""))

    def health(self, report: HealthReport) -> None:
        """Accept new readers, and send every reader the report's line."""
        self._accept_clients()
        if self._readers:
            self._send_all(encode_health(report))

    def _accept_clients(self) -> None:
        if self._listener.fileno() < 0 or not self._listener_poll.poll(0):
            return
        try:
            with suppress(BlockingIOError):
                for _ in range(_KNOCKS):
                    self._add_client(*self._listener.accept())
        except OSError as reason:  # gone before it was accepted, or no descriptors left
            self._error = reason.strerror or str(reason)

    def _add_client(self, reader: socket.socket, peer: Any) -> None:
        host = _host(reader, peer)
        if self._has_room(host):
            self._readers.append(_Reader(reader, host))
            if self._header:
                self._send(self._readers[-1], self._header, self._clock())
        else:
            reader.close()

    def _has_room(self, host: str) -> bool:
        """Return whether one more reader of `host` has a place."""
        if host and sum(reader.host == host for reader in self._readers) >= MAX_OF_ONE:
            full = f"more than {MAX_OF_ONE} readers on {host}"
        elif len(self._readers) >= MAX_READERS:
            full = f"more than {MAX_READERS} readers"
        else:
            return True
        self._error = f"{full}: the newest were rejected"
        return False

    def _send_all(self, line: bytes) -> None:
        now_s = self._clock()
        for reader in tuple(self._readers):
            sent = self._send(reader, line, now_s)
            self._sent += sent
            self._lost += not sent

    def _send(self, reader: "_Reader", line: bytes, now_s: float) -> bool:
        try:
            sent = reader.send(line, now_s)
        except OSError:
            self._readers.remove(reader)
            reader.close()
            return False
        if reader.hangs(now_s):
            self._readers.remove(reader)
            reader.close()
            self._dropped += 1
            self._error = f"a reader that took nothing for {HANGING_S:g} s was dropped"
        return sent

    def report(self) -> SinkReport:
        """Return the state of this sink."""
        return SinkReport(self._where, len(self._readers), self._sent, self._lost, self._error, dropped=self._dropped)

    def close(self) -> None:
        """Close the socket and every reader's."""
        if self._listener.fileno() < 0:
            return
        self._listener.close()
        for reader in self._readers:
            reader.close()
        self._readers.clear()
        self._tidy()


class _Reader:
    """A reader of the lines, and the `host` it is on, "" for this one; the rest of one line may wait for it here."""

    __slots__ = ("_rest", "_socket", "_stalled_s", "host")

    def __init__(self, reader: socket.socket, host: str) -> None:
        reader.setblocking(False)
        reader.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        if reader.family != socket.AF_UNIX:
            reader.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.host = host
        self._socket, self._rest = reader, b""
        self._stalled_s: float | None = None

    def send(self, line: bytes, now_s: float) -> bool:
        """Send `line` if there is room for it; return whether it was begun. Raises OSError if the reader is gone."""
        left = self._rest + line
        took = 0
        with suppress(BlockingIOError):
            while took < len(left):
                took += self._socket.send(left[took:])
        if took:
            self._stalled_s = None
        elif self._stalled_s is None:
            self._stalled_s = now_s
        sent = took > len(self._rest)
        # Of a line of which nothing was sent, nothing is kept: it is lost, and the next one starts afresh.
        self._rest = left[took:] if sent else self._rest[took:]
        return sent

    def hangs(self, now_s: float) -> bool:
        """Return whether lines were offered for the whole limit without a byte taken."""
        return self._stalled_s is not None and now_s - self._stalled_s >= HANGING_S

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


def _host(reader: socket.socket, peer: Any) -> str:
    """Return the key of a reader's machine: its address, for IPv6 its 64-bit network; "" for this machine."""
    if reader.family == socket.AF_UNIX:
        return ""
    address = ipaddress.ip_address(peer[0].partition("%")[0])
    mapped = getattr(address, "ipv4_mapped", None)
    address = address if mapped is None else mapped
    if str(address) in _HERE:
        return ""
    return str(address if address.version == 4 else ipaddress.ip_network((address, 64), strict=False))


def open_unix(path: str, clock: Callable[[], float] = monotonic, *, detail: bool = False) -> SocketLines:
    """Return a sink on a Unix socket at `path`.

    A socket left behind by a killed process is replaced; anything else at that path stays. Raises SinkError, or
    SettingError if the path is not valid for a socket.
    """
    where = f"unix:{path}"
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        _make_way(path, where)
        listener.bind(path)
        listener.listen(_BACKLOG)
        made = Path(path).lstat()
    except OSError as reason:
        listener.close()
        raise _unix_error(where, reason) from None
    except ValueError:
        listener.close()
        raise SettingError(f"{where}: no file can have that name") from None

    def tidy() -> None:
        if _same(path, made):
            Path(path).unlink()

    return SocketLines(listener, where, tidy, clock, detail)


def _make_way(path: str, where: str) -> None:
    """Remove a dead socket from `path`. Raises SinkError if anything else is there."""
    try:
        found = Path(path).lstat()
    except FileNotFoundError:
        return
    if not stat.S_ISSOCK(found.st_mode):
        raise SinkError(f"{where}: another file has that name, and it is kept: use another name")
    if not _refuses(path):
        raise SinkError(f"{where} is in use: another process serves it; stop that one or use another name")
    if _same(path, found):
        Path(path).unlink()


def _refuses(path: str) -> bool:
    """Return whether nobody listens at `path` any more."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as knock:
        knock.setblocking(False)
        return knock.connect_ex(path) == errno.ECONNREFUSED


def _same(path: str, made: os.stat_result) -> bool:
    try:
        return os.path.samestat(Path(path).lstat(), made)
    except OSError:
        return False


def _unix_error(where: str, reason: OSError) -> Exception:
    if isinstance(reason, SinkError):
        return reason
    if reason.errno is None:  # "AF_UNIX path too long" carries no number
        return SettingError(f"{where}: {reason}: a socket's path has at most 107 bytes")
    hint = ": create its folder first" if reason.errno == errno.ENOENT else ""
    return SinkError(f"{where} cannot be opened: {reason.strerror}{hint}")


def open_tcp(
    place: str, *, public: bool = False, clock: Callable[[], float] = monotonic, detail: bool = False
) -> SocketLines:
    """Return a sink on a TCP port: "127.0.0.1:7777", "localhost:7777", "[::1]:7777" or, on 127.0.0.1, "7777".

    Anyone who can connect can read, so only addresses of this machine are accepted unless `public`. Port 0 means any
    free one. Raises SinkError, or SettingError if `place` is not such an address.
    """
    where = f"tcp:{place}" + "?public" * public
    family, address = resolve(place, where, "tcp:127.0.0.1:7777")
    check_readers(address, f"tcp:{place}", public=public)
    return SocketLines(_listener(family, address, where), where, clock=clock, detail=detail)


def check_readers(address: tuple[str, int], where: str, *, public: bool) -> None:
    """Raise SettingError for an address that other machines can read, unless `public`; `where` is without options."""
    if not public and not ipaddress.ip_address(address[0].partition("%")[0]).is_loopback:
        raise SettingError(
            f"{where}: other machines could read it there: use 127.0.0.1, or write {where}?public to let them"
        )


def listen(place: str, where: str, example: str) -> socket.socket:
    """Return a socket that listens at `place`, in the syntax of `open_tcp`; messages use `where` and `example`.

    Raises SinkError, or SettingError if `place` is not an address.
    """
    return _listener(*resolve(place, where, example), where)


def _listener(family: socket.AddressFamily, address: tuple[str, int], where: str) -> socket.socket:
    listener = socket.socket(family, socket.SOCK_STREAM)
    try:
        # Without it the port stays taken for a minute after its last reader.
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(_BACKLOG)
    except OSError as reason:
        listener.close()
        hint = ": another process serves that port; use another" if reason.errno == errno.EADDRINUSE else ""
        raise SinkError(f"{where} cannot be opened: {reason.strerror}{hint}") from None
    return listener


def resolve(place: str, where: str, example: str) -> tuple[socket.AddressFamily, tuple[str, int]]:
    """Return the family and the address, host and port first, of HOST:PORT, [HOST]:PORT or a PORT of 127.0.0.1.

    Raises SettingError, with `where` and `example` as in `listen`.
    """
    found = re.fullmatch(r"(?:(?:\[([^][]+)\]|([^][:]+)):)?([0-9]{1,5})", place)
    if not found or int(found[3]) > 65535:
        raise SettingError(f"{where} is not an address: write it as {example}, with a port from 0 to 65535")
    host = found[1] or found[2] or "127.0.0.1"
    try:
        family, _, _, _, address = socket.getaddrinfo(host, int(found[3]), type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError):
        raise SettingError(f"{where}: there is no host {host}: use 127.0.0.1") from None
    return family, address  # type: ignore[return-value]


MEMBER = (
    SinkKind(
        "unix",
        "PATH",
        "JSON lines to all who connect to a socket",
        lambda where: open_unix(where.place, detail="detail" in where.options),
        ("detail",),
        rank=1,
    ),
    SinkKind(
        "tcp",
        "127.0.0.1:PORT",
        "the same on a port of this machine; with public also for other machines",
        lambda where: open_tcp(where.place, public="public" in where.options, detail="detail" in where.options),
        ("detail", "public"),
        rank=2,
    ),
)
