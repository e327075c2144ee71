"""A scanner board over Wi-Fi: one frame a UDP datagram, at udp://HOST:PORT. docs/reference/devices.md has the
layout.

A network drops, duplicates and reorders datagrams. So each carries a number of 32 bits, and one is accepted only if it
is newer than all before it (RFC 1982): a late one was overtaken by a newer one, and is out of date. The frame's own
number of 8 bits would confuse a frame that is 200 late with one that is 56 early.

A board draws a random number whenever it boots, a host whenever it opens the board. They distinguish datagrams from
earlier ones, and nobody can forge a datagram without seeing others.
"""

import logging
import re
import secrets
import select
import socket
from collections import deque
from dataclasses import dataclass
from struct import Struct
from time import monotonic

from .errors import DeviceError, SettingError
from .names import shortened
from .ports import port_fault
from .scanner_link import Break, Received, ScannerLink
from .scanner_protocol import MAX_PAYLOAD, OVERHEAD, Frame, FrameCounts, FrameDecoder

_LOG = logging.getLogger(__name__)

# 'T', the version, and from the board session, boot, number, heard, heard before; from the host session, number.
_MARK, _VERSION = 0x54, 1
FROM_BOARD, TO_BOARD = Struct("<BBIIIII"), Struct("<BBII")
_MODULUS, _HALF = 1 << 32, 1 << 31
_HEARD = 32
# How many of the newest numbers are remembered, to distinguish a repeated datagram from a late one.
_WINDOW = 256
_EARLIER = 8  # boots

_NET = re.compile(r"udp://(\[[0-9A-Fa-f:.]+(?:%[A-Za-z0-9._-]+)?\]|[A-Za-z0-9._-]+):(\d{1,5})/?")
_AGAIN_S = 0.1  # a setting that was not acknowledged is repeated after this time
_SILENT_S = 4.0  # a board that sends nothing for this time may have another address by now
_AT_ONCE = 64


def is_datagram_port(port: str) -> bool:
    """Return whether `port` is intended as udp://HOST:PORT."""
    return port.lower().startswith("udp:")


def scanner_port_fault(port: str) -> str:
    """Return why no scanner board can be at `port`, or ""."""
    if not is_datagram_port(port):
        return port_fault(port)
    found = _NET.fullmatch(port)
    return "" if found and 0 < int(found[2]) < 65_536 else "is not an address: a board on Wi-Fi is at udp://HOST:PORT"


@dataclass(slots=True)
class DatagramCounts:
    """Counts of datagrams that are not valid frames in order.

    missing   datagrams overtaken by a later one      late     missing ones that arrived afterwards
    repeated  that arrived a second time              foreign  not from this board
    """

    missing: int = 0
    late: int = 0
    repeated: int = 0
    foreign: int = 0


class Datagrams:
    """Wraps and unwraps frames in datagrams of one session, without a network. No input raises."""

    def __init__(self, session: int, frames: FrameCounts | None = None, counts: DatagramCounts | None = None) -> None:
        self.frames = FrameCounts() if frames is None else frames
        self.counts = DatagramCounts() if counts is None else counts
        self._session = session
        self._sent = 0
        self._boot: int | None = None
        self._earlier: deque[int] = deque(maxlen=_EARLIER)
        self._newest = self._seen = 0
        self._heard: int | None = None
        self._heard_before = 0

    def wrap(self, frame: bytes = b"") -> tuple[int, bytes]:
        """Return the number of the next datagram, and the datagram of `frame`; an empty frame is a farewell."""
        self._sent = (self._sent + 1) % _MODULUS
        return self._sent, TO_BOARD.pack(_MARK, _VERSION, self._session, self._sent) + frame

    def acknowledged(self, number: int) -> bool:
        """Return whether the board has acknowledged datagram `number`."""
        if self._heard is None:
            return False
        back = (self._heard - number) % _MODULUS
        return back == 0 or (back <= _HEARD and bool(self._heard_before >> (back - 1) & 1))

    def take(self, datagram: bytes) -> list[Received]:
        """Return the frame of `datagram`, after a break if there was one; nothing if it is late or foreign."""
        frame = self._frame(datagram)
        if frame is None:
            self.counts.foreign += 1
            return []
        _, _, _, boot, number, heard, before = FROM_BOARD.unpack_from(datagram)
        if boot != self._boot:
            if boot in self._earlier:
                self.counts.late += 1
                return []
            gap = self._booted(boot)
        else:
            ahead = (number - self._newest) % _MODULUS
            if not 0 < ahead < _HALF:
                self._late((self._newest - number) % _MODULUS)
                return []
            self.counts.missing += ahead - 1
            self._seen = self._seen << ahead & (1 << _WINDOW) - 1 if ahead < _WINDOW else 0
            gap = [Break.MISSING] if ahead > 1 else []
        self._newest, self._seen = number, self._seen | 1
        self._heard, self._heard_before = heard, before
        self.frames.frames += 1
        return [*gap, frame]

    def _booted(self, boot: int) -> list[Received]:
        again = self._boot is not None
        if self._boot is not None:
            self._earlier.append(self._boot)
        self._boot, self._seen = boot, 0
        return [Break.RESTARTED] if again else []

    def _late(self, back: int) -> None:
        if back < _WINDOW and self._seen >> back & 1:
            self.counts.repeated += 1
        else:
            self.counts.late += 1
            self._seen |= 1 << back if back < _WINDOW else 0

    def _frame(self, datagram: bytes) -> Frame | None:
        """Return the frame of a datagram of this session, None if it is foreign or not exactly one valid frame."""
        head = FROM_BOARD.size
        if not head + OVERHEAD <= len(datagram) <= head + MAX_PAYLOAD + OVERHEAD:
            return None
        mark, version, session, _, number, _, _ = FROM_BOARD.unpack_from(datagram)
        ends = datagram.find(0, head)
        if (mark, version, session) != (_MARK, _VERSION, self._session) or ends != len(datagram) - 1:
            return None
        found = FrameDecoder().received(datagram[head:])
        if len(found) != 1 or found[0] is None or found[0].sequence != number & 0xFF:
            return None
        return found[0]


class DatagramLink(ScannerLink):
    """The link to a board at udp://HOST:PORT. The socket is connected, so it receives only from there.

    A setting is repeated every 0.1 s until the board acknowledges it.
    """

    def __init__(self, url: str, frames: FrameCounts, counts: DatagramCounts) -> None:
        """Find the host. Raises DeviceError if there is none of that name, SettingError for a malformed address."""
        if fault := scanner_port_fault(url):
            raise SettingError(f"{shortened(repr(url))} {fault}")
        found = _NET.fullmatch(url)
        assert found is not None
        self.url, self.received_bytes = url, 0
        self._datagrams = Datagrams(secrets.randbits(32), frames, counts)
        self._unacknowledged: dict[int, tuple[bytes, int, float]] = {}
        self._waited_s = 0.0
        self._socket = _connected(url, found[1].strip("[]"), int(found[2]))

    def send(self, data: bytes, setting: int | None = None) -> None:
        """Send a frame. Repeat one with a `setting` (its kind) until it is acknowledged or replaced by another."""
        number, datagram = self._datagrams.wrap(data)
        if setting is not None:
            self._unacknowledged[setting] = data, number, monotonic() + _AGAIN_S
        self._write(datagram)

    def receive(self, timeout_s: float) -> list[Received]:
        """Wait for frames until the timeout, and return them."""
        self._send_again()
        began = monotonic()
        received = self._read_all() if self._ready(timeout_s) else []
        if received:
            self._waited_s = 0.0
        else:
            self._waited_s += monotonic() - began
        if self._waited_s > _SILENT_S:
            raise DeviceError(
                f"{self.url}: the board has sent nothing for {_SILENT_S:g} s: check its power and its Wi-Fi"
            )
        return received

    def close(self) -> None:
        """Send a farewell, so that the board accepts another host at once. Closing twice is harmless."""
        if self._socket.fileno() >= 0:
            try:
                self._socket.send(self._datagrams.wrap()[1])
            except OSError as reason:
                _LOG.debug("%s: %s", self.url, reason)
        self._socket.close()

    def _send_again(self) -> None:
        now = monotonic()
        for setting, (data, number, due) in list(self._unacknowledged.items()):
            if self._datagrams.acknowledged(number):
                del self._unacknowledged[setting]
            elif now >= due:
                self.send(data, setting)

    def _ready(self, timeout_s: float) -> bool:
        due = min((due for _, _, due in self._unacknowledged.values()), default=float("inf"))
        try:
            return bool(select.select([self._socket], [], [], max(0.0, min(timeout_s, due - monotonic())))[0])
        except (OSError, ValueError) as reason:  # closed meanwhile by another thread
            raise self._gone(reason) from reason

    def _read_all(self) -> list[Received]:
        received: list[Received] = []
        for _ in range(_AT_ONCE):
            try:
                datagram = self._socket.recv(FROM_BOARD.size + MAX_PAYLOAD + OVERHEAD + 1)
            except BlockingIOError:
                break
            except ConnectionRefusedError:  # no listener: the board is starting
                continue
            except OSError as reason:
                raise self._gone(reason) from reason
            self.received_bytes += len(datagram)
            received += self._datagrams.take(datagram)
        return received

    def _write(self, datagram: bytes) -> None:
        try:
            self._socket.send(datagram)
        except (BlockingIOError, ConnectionRefusedError):
            pass  # lost like any other; ConnectionRefusedError reports an earlier one
        except OSError as reason:
            raise self._gone(reason) from reason

    def _gone(self, reason: Exception) -> DeviceError:
        return DeviceError(f"{self.url}: the network does not lead to the board ({reason}): check both ends")


def _connected(url: str, host: str, port: int) -> socket.socket:
    try:
        (family, kind, protocol, _, address), *_ = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
        connected = socket.socket(family, kind, protocol)
    except (OSError, UnicodeError) as reason:
        raise DeviceError(
            f"{url}: there is no {host} ({reason}): write the board's address, as its router shows"
        ) from reason
    try:
        connected.setblocking(False)
        connected.connect(address)
    except OSError as reason:
        connected.close()
        raise DeviceError(f"{url}: the network does not lead there ({reason})") from reason
    return connected
