"""Ports of lines: a serial port, TCP, UDP, Bluetooth or stdin, all read in the same way.

/dev/ttyUSB0          a serial port
tcp://HOST:PORT       a server that sends lines to whoever connects
udp://HOST:PORT       datagrams that come to this port; HOST is this computer's own address: 127.0.0.1, or 0.0.0.0
for all; a datagram holds one line or more; datagrams of a second sender are left out
ble://NAME            what a peripheral of Bluetooth Low Energy notifies, see `ble`
-                     standard input
"""

import errno
import os
import re
import select
import socket
import struct
import sys
from collections.abc import Sequence
from time import monotonic_ns, time_ns

from .ble import BLE, BleLine
from .closing import Closing
from .errors import DeviceError, SettingError
from .ports import port_fault
from .serial_line import SerialLine

_CHUNK = 65_536
_CONNECT_S = 2.0
# Linux dates every datagram on arrival, as a timespec of the clock of the date; Python does not name the option.
_TIMESTAMPS = 35 if sys.platform == "linux" else None
_TIMESPEC = struct.Struct("@ll")
# Labels of a host's name are not empty, and at most 63 characters long: getaddrinfo raises UnicodeError for others.
_HOST = r"[A-Za-z0-9_-]{1,63}(?:\.[A-Za-z0-9_-]{1,63})*\.?"
_NET = re.compile(rf"(tcp|udp)://(\[[0-9A-Fa-f:.%]+\]|{_HOST}):(\d{{1,5}})/?")
OTHER_PORTS = ("lsl:", "ros:", "mqtt:", "osc:")  # of rows that other readers open
_WAYS = (
    "lines come from a serial port such as /dev/ttyUSB0, tcp://HOST:PORT, udp://HOST:PORT, ble://NAME "
    "or - (standard input)"
)


def line_port_fault(port: str) -> str:
    """Return why `port` cannot deliver lines, or ""; OTHER_PORTS are other readers'."""
    if port == "-" or port.startswith(OTHER_PORTS):
        return ""
    if port.startswith(("tcp:", "udp:")):
        found = _NET.fullmatch(port)
        return "" if found and 0 < int(found[3]) < 65536 else f"is not an address: {_WAYS}"
    if port.startswith("ble:"):
        return "" if BLE.fullmatch(port) else "names no peripheral: write ble://NAME, ble://ADDRESS or ble://NAME/UUID"
    if "://" in port and not port.startswith("socket://"):
        return f"is not a supported port: {_WAYS}"
    return port_fault(port)


def is_serial(port: str) -> bool:
    """Return whether a port is a serial line's: a device, not standard input or an address."""
    return not (port == "-" or re.match("[a-z0-9]+:", port))


def open_transport(port: str, baud: int) -> "Transport":
    """Return the open port. Raises DeviceError if a retry may help, SettingError if it does not."""
    if port == "-":
        return Descriptor(port, None)
    if port.startswith("ble:"):
        return BleLine(port)
    try:
        if found := _NET.fullmatch(port):
            host, number = found[2].strip("[]"), int(found[3])
            return Datagrams(port, _bound(host, number)) if found[1] == "udp" else Descriptor(port, _tcp(host, number))
    except OSError as reason:
        raise DeviceError(f"{port}: {_advice(port, reason)}") from reason
    return SerialLine(port, baud)


def _advice(port: str, reason: OSError) -> str:
    said = reason.strerror or str(reason)
    if reason.errno == errno.EACCES:
        return f"{said}: use a port above 1023"
    if port.startswith("udp:"):
        return f"{said}: use an address of this computer as host, and close other programs that have the port"
    return f"{said}: is the sender running, and does it listen?"


def _tcp(host: str, port: int) -> socket.socket:
    line = socket.create_connection((host, port), _CONNECT_S)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    return line


def _bound(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    line = socket.socket(family, socket.SOCK_DGRAM)
    try:
        line.bind((host, port))
        if _TIMESTAMPS is not None:
            line.setsockopt(socket.SOL_SOCKET, _TIMESTAMPS, 1)
    except OSError:
        line.close()
        raise
    return line


class Descriptor(Closing):
    """A stream socket, or standard input if there is none."""

    def __init__(self, port: str, line: socket.socket | None) -> None:
        self._port, self._line = port, line
        if line is None and sys.stdin is None:
            raise SettingError("standard input is closed: no lines can come from it")
        self._descriptor = sys.stdin.fileno() if line is None else line.fileno()

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes received until the timeout. Raises DeviceError if the other end is gone."""
        try:
            ready, _, _ = select.select([self._descriptor], [], [], max(0.0, timeout_s))
            if not ready:
                return b""
            data = os.read(self._descriptor, _CHUNK)
        except (OSError, ValueError) as reason:  # ValueError: closed meanwhile
            raise DeviceError(f"{self._port}: it is gone ({reason})") from reason
        if not data:
            raise DeviceError(f"{self._port}: {'the input has ended' if self._line is None else 'the sender hung up'}")
        return data

    def close(self) -> None:
        """Close the socket; standard input stays open."""
        if self._line is not None:
            self._line.close()


class Datagrams(Closing):
    """A socket of datagrams."""

    def __init__(self, port: str, line: socket.socket) -> None:
        self._port, self._line = port, line

    def read(self, timeout_s: float) -> tuple[bytes, str, int] | None:
        """Return the next datagram, its sender's address, and when it came, by the monotonic clock; None: none came."""
        try:
            ready, _, _ = select.select([self._line], [], [], max(0.0, timeout_s))
            if not ready:
                return None
            data, notes, _, (host, port, *_) = self._line.recvmsg(_CHUNK, socket.CMSG_SPACE(_TIMESPEC.size))
        except (OSError, ValueError) as reason:  # ValueError: closed meanwhile
            raise DeviceError(f"{self._port}: it is gone ({reason})") from reason
        waited_us = _waited_us(notes)
        return data, f"[{host}]:{port}" if ":" in host else f"{host}:{port}", monotonic_ns() // 1000 - waited_us

    def close(self) -> None:
        """Close the socket."""
        self._line.close()


def _waited_us(notes: Sequence[tuple[int, int, bytes]]) -> int:
    """Return for how long a datagram has been waiting, as far as the system says when it came."""
    for level, kind, data in notes:
        if (level, kind, len(data)) == (socket.SOL_SOCKET, _TIMESTAMPS, _TIMESPEC.size):
            seconds, nanoseconds = map(int, _TIMESPEC.unpack(data))
            # The date may have been set since.
            return max(0, time_ns() - seconds * 1_000_000_000 - nanoseconds) // 1000
    return 0


Transport = SerialLine | Descriptor | Datagrams | BleLine
