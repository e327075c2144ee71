"""A serial line, whatever carries it: a port, a pty, socket://HOST:PORT or rfc2217://HOST:PORT.

8 data bits, no parity, one stop bit, no handshake; DTR and RTS stay as opening leaves them. Nothing here waits without
a limit, and whatever pySerial or the kernel says of a line that is gone becomes a `DeviceError`.
"""

import errno
import logging
import os
import select
from time import monotonic
from typing import TYPE_CHECKING

from .closing import Closing
from .errors import DeviceError, SettingError
from .names import shortened
from .ports import check_node, port_fault

if TYPE_CHECKING:
    from serial import Serial

_LOG = logging.getLogger(__name__)

BITS_A_BYTE = 10  # a start bit, 8 data bits, a stop bit
_CHUNK = 4096
# A line takes a command of a few bytes at once; one that has not within this time takes none any more.
_WRITE_TIMEOUT_S = 1.0
# A port without a file descriptor is asked again this often: its reading may be that much late in giving up.
_SLICE_S = 0.005
# How often an open line looks whether its name still leads to the port that it has open.
_LOOK_S = 0.2

_ADVICE = {
    errno.ENOENT: "there is no such port: is the cable plugged in? `ls /dev/serial/by-id` shows what is",
    errno.EACCES: "no permission: add yourself to the port's group (`sudo usermod -aG dialout $USER`), log in again",
    errno.EAGAIN: "another program has it open: close that first",
    errno.EBUSY: "another program has it open: close that first",
}


class Pieces:
    """Splits a stream at 00, which ends a frame and can stand nowhere else: the one sure place to fall back into step.

    Of a piece longer than `longest` the first `longest` + 1 bytes are kept, so that its length tells; a stream without
    zeros never fills the memory.
    """

    def __init__(self, longest: int) -> None:
        self._keep = longest + 1
        self._rest = b""

    def feed(self, chunk: bytes) -> list[bytes]:
        """Return the pieces that `chunk` ends, in order, without their zeros; empty ones too."""
        pieces = chunk.split(b"\0")
        pieces[0] = self._rest + pieces[0]
        self._rest = pieces.pop()[: self._keep]
        return [piece[: self._keep] for piece in pieces]


class SerialLine(Closing):
    """An open serial line. Closing it twice does no harm; a context manager closes it at its end.

    One thread may read while another writes.
    """

    def __init__(self, url: str, baud: int) -> None:
        """Open `url`, for this program alone where the system can see to that.

        Raises DeviceError if that fails, SettingError for a baud rate below 1 and a text that names no port.
        """
        if fault := port_fault(url):
            raise SettingError(f"{shortened(repr(url))} {fault}")
        if baud < 1:
            raise SettingError(f"{url}: a baud rate is at least 1, not {baud}")
        self.url, self.baud = url, baud
        self._port = _opened(url, baud)
        self._sliced = not _has_descriptor(self._port)
        if self._sliced:
            self._port.timeout = _SLICE_S
        self._descriptor = -1 if self._sliced else self._port.fileno()
        self._node = None if self._sliced else _node(self._descriptor)
        self._look_at = 0.0 if self._node else float("inf")
        _lower_latency(self._port)

    def read(self, timeout_s: float) -> bytes:
        """Return what has come in, after waiting for something until the timeout: b"" if nothing came.

        Raises DeviceError when the line is gone, as soon as that shows, or when its name has come to lead to another
        port: the one that is open is then no longer the one that was meant.
        """
        if monotonic() >= self._look_at:
            self._look()
        try:
            return self._in_slices(timeout_s) if self._sliced else self._when_ready(timeout_s)
        except (OSError, TypeError, ValueError) as reason:  # the latter two: closed meanwhile by another thread
            raise self._gone(reason) from reason

    def write(self, data: bytes) -> None:
        """Send `data`. Raises DeviceError when the line is gone, or has taken nothing for a second."""
        try:
            self._port.write(data)
        except (OSError, TypeError, ValueError) as reason:
            raise self._gone(reason) from reason

    def drain(self, seconds: float) -> bytes:
        """Read for so long and return what came, to be thrown away. Raises DeviceError as `read` does."""
        end, drained = monotonic() + seconds, b""
        while (left := end - monotonic()) > 0:
            drained = (drained + self.read(left))[-_CHUNK:]
        return drained

    def close(self) -> None:
        """Close the line; what was written is given to the system already."""
        self._descriptor = -1  # nobody reads what another file of the same number holds
        self._port.close()

    def check_plugged(self) -> None:
        """Raise DeviceError if the node that was opened has been removed, which reading may not show yet."""
        if self._node is not None and _node(self.url) is None:
            raise self._gone("its device node was removed")

    def _look(self) -> None:
        self._look_at = monotonic() + _LOOK_S
        if _node(self.url) not in (None, self._node):
            raise DeviceError(f"{self.url}: it has come to be another port than the one that was opened")

    def _when_ready(self, timeout_s: float) -> bytes:
        ready, _, _ = select.select([self._descriptor], [], [], max(0.0, timeout_s))
        if not ready:
            return b""
        try:
            data = os.read(self._descriptor, _CHUNK)  # pySerial would wait once more, in ten calls
        except BlockingIOError:
            return b""
        if not data:
            raise OSError("the other end has hung up")
        return data

    def _in_slices(self, timeout_s: float) -> bytes:
        end = monotonic() + timeout_s
        # pySerial waits for the one byte at most a slice; what came with it is there then.
        while not (first := self._port.read(1)):
            if monotonic() >= end:
                return b""
        waiting = min(self._port.in_waiting, _CHUNK)
        return first + (self._port.read(waiting) if waiting else b"")

    def _gone(self, reason: Exception | str) -> DeviceError:
        return DeviceError(f"{self.url}: the serial line is gone ({reason}): check cable and power")


def _opened(url: str, baud: int) -> "Serial":
    from serial import serial_for_url

    if "://" not in url:
        check_node(url)
    # pySerial knows no write timeout there; that connection's own is 5 s.
    write_timeout = None if url.lower().startswith("rfc2217:") else _WRITE_TIMEOUT_S
    try:
        return serial_for_url(url, baud, timeout=0, write_timeout=write_timeout, exclusive=True)
    except Exception as reason:  # termios.error is no OSError, and every kind of URL raises errors of its own
        advice = _ADVICE.get(getattr(reason, "errno", None) or 0, f"cannot be opened at {baud} baud ({reason})")
        raise DeviceError(f"{url}: {advice}") from reason


def _node(port: str | int) -> int | None:
    """Return the device number behind a path or a descriptor, None if it is no device."""
    try:
        return os.stat(port).st_rdev or None  # noqa: PTH116 - of a descriptor, too
    except (OSError, ValueError):
        return None


def _has_descriptor(port: "Serial") -> bool:
    try:
        port.fileno()
    except OSError:  # io.UnsupportedOperation
        return False
    return True


def _lower_latency(port: "Serial") -> None:
    """Ask an FTDI adapter not to wait 16 ms for more bytes before it hands over what it has."""
    if hasattr(port, "set_low_latency_mode"):
        try:
            port.set_low_latency_mode(True)
        except (OSError, ValueError) as reason:  # another kind of adapter: nothing lost
            _LOG.debug("%s: %s", port.port, reason)
