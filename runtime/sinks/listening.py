"""Sockets to listen on: a path in the file system, or a port of this machine."""

import errno
import ipaddress
import os
import re
import socket
import stat
from collections.abc import Callable
from pathlib import Path
from time import monotonic

from thenar.drivers.errors import SettingError

from .sink import SinkError
from .sockets import SocketLines

_BACKLOG = 16


def open_unix(path: str, clock: Callable[[], float] = monotonic) -> SocketLines:
    """Return lines on a Unix socket at `path`.

    The socket that a process left behind when it was killed is replaced; anything else that is there stays. Raises
    SinkError, or SettingError where no such path can be a socket's.
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

    return SocketLines(listener, where, tidy, clock)


def _make_way(path: str, where: str) -> None:
    """Remove a dead socket from `path`. Raises SinkError about anything else that is there."""
    try:
        found = Path(path).lstat()
    except FileNotFoundError:
        return
    if not stat.S_ISSOCK(found.st_mode):
        raise SinkError(f"{where}: there is something else of that name, which stays: take another name")
    if not _refuses(path):
        raise SinkError(f"{where} is in use: another process serves it; stop that one or take another name")
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
    hint = ": make its folder first" if reason.errno == errno.ENOENT else ""
    return SinkError(f"{where} cannot be opened: {reason.strerror}{hint}")


def open_tcp(place: str, *, public: bool = False, clock: Callable[[], float] = monotonic) -> SocketLines:
    """Return lines on a TCP port: "127.0.0.1:7777", "localhost:7777", "[::1]:7777" or, on 127.0.0.1, "7777".

    Whoever can connect reads along; so only addresses of this machine itself are taken unless `public`. Port 0 is any
    free one. Raises SinkError, or SettingError where `place` is not such an address.
    """
    where = f"tcp-public:{place}" if public else f"tcp:{place}"
    family, address = _resolve(place, where)
    if not public and not ipaddress.ip_address(address[0].partition("%")[0]).is_loopback:
        raise SettingError(
            f"{where}: other machines could read along there: take 127.0.0.1, or write tcp-public:{place} to let them"
        )
    listener = socket.socket(family, socket.SOCK_STREAM)
    try:
        # Without it the port stays taken for a minute after its last reader.
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(_BACKLOG)
    except OSError as reason:
        listener.close()
        hint = ": another process serves that port; take another" if reason.errno == errno.EADDRINUSE else ""
        raise SinkError(f"{where} cannot be opened: {reason.strerror}{hint}") from None
    return SocketLines(listener, where, clock=clock)


def _resolve(place: str, where: str) -> tuple[socket.AddressFamily, tuple[str, int]]:
    found = re.fullmatch(r"(?:(?:\[([^][]+)\]|([^][:]+)):)?([0-9]{1,5})", place)
    if not found or int(found[3]) > 65535:
        raise SettingError(f"{where} is no address: write it as tcp:127.0.0.1:7777, with a port from 0 to 65535")
    host = found[1] or found[2] or "127.0.0.1"
    try:
        family, _, _, _, address = socket.getaddrinfo(host, int(found[3]), type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError):
        raise SettingError(f"{where}: there is no host {host}: take 127.0.0.1") from None
    return family, address  # type: ignore[return-value]
