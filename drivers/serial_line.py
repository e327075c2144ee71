"""A serial line on any transport: a port, a pty or socket://HOST:PORT.

8 data bits, no parity, one stop bit, no handshake; DTR and RTS stay as opening leaves them. Every wait has a limit, and
every error of pySerial or the kernel about a lost line becomes a `DeviceError`.
"""

import errno
import os
import select
from time import monotonic
from typing import TYPE_CHECKING

from .closing import Closing
from .errors import DeviceError, SettingError
from .logs import logger
from .names import shortened
from .ports import check_node, port_fault

if TYPE_CHECKING:
    from serial import Serial

_LOG = logger(__name__)

BITS_A_BYTE = 10  # a start bit, 8 data bits, a stop bit
_CHUNK = 4096
# A line accepts a command of a few bytes at once; one that has not done so within this time is dead.
_WRITE_TIMEOUT_S = 1.0
# How often an open line checks that its name still refers to the open port.
_LOOK_S = 0.2

_ADVICE = {
    errno.ENOENT: "there is no such port: is the cable plugged in? `ls /dev/serial/by-id` lists the ports",
    errno.EACCES: "no permission: add yourself to the port's group (`sudo usermod -aG dialout $USER`), log in again",
    errno.EAGAIN: "another program has it open: close that first",
    errno.EBUSY: "another program has it open: close that first",
}


class SerialLine(Closing):
    """An open serial line. Closing it twice is harmless; a context manager closes it at its end.

    One thread may read while another writes.
    """

    def __init__(self, url: str, baud: int) -> None:
        """Open `url`, exclusively if the system supports it.

        Raises DeviceError if that fails, SettingError for a baud rate below 1 or a text that does not name a port.
        """
        if fault := port_fault(url):
            raise SettingError(f"{shortened(repr(url))} {fault}")
        if baud < 1:
            raise SettingError(f"{url}: a baud rate is at least 1, not {baud}")
        self.url, self.baud = url, baud
        self._port = _opened(url, baud)
        self._descriptor = self._port.fileno()
        self._node = _node(self._descriptor)
        self._look_at = 0.0 if self._node else float("inf")
        _lower_latency(self._port)

    def read(self, timeout_s: float) -> bytes:
        """Wait for bytes until the timeout and return them; b"" if none came.

        Raises DeviceError as soon as the line is known to be gone, or when its name refers to another port: then the
        open port is no longer the intended one.
        """
        if monotonic() >= self._look_at:
            self._look()
        try:
            return self._when_ready(timeout_s)
        except (OSError, TypeError, ValueError) as reason:  # TypeError, ValueError: closed meanwhile by another thread
            raise self._gone(reason) from reason

    def write(self, data: bytes) -> None:
        """Send `data`. Raises DeviceError if the line is gone or has accepted nothing for a second."""
        try:
            self._port.write(data)
        except (OSError, TypeError, ValueError) as reason:
            raise self._gone(reason) from reason

    def drain(self, seconds: float) -> bytes:
        """Read for `seconds` and return the last bytes, to be discarded. Raises DeviceError as `read` does."""
        end, drained = monotonic() + seconds, b""
        while (left := end - monotonic()) > 0:
            drained = (drained + self.read(left))[-_CHUNK:]
        return drained

    def close(self) -> None:
        """Close the line; written bytes have already been handed to the system."""
        self._descriptor = -1  # never read another file that gets the same number
        self._port.close()

    def check_plugged(self) -> None:
        """Raise DeviceError if the opened node has been removed, which reading may not show yet."""
        if self._node is not None and _node(self.url) is None:
            raise self._gone("its device node was removed")

    def _look(self) -> None:
        self._look_at = monotonic() + _LOOK_S
        if _node(self.url) not in (None, self._node):
            raise DeviceError(f"{self.url}: it now refers to another port than the one that was opened")

    def _when_ready(self, timeout_s: float) -> bytes:
        ready, _, _ = select.select([self._descriptor], [], [], max(0.0, timeout_s))
        if not ready:
            return b""
        try:
            data = os.read(self._descriptor, _CHUNK)  # pySerial would wait again, in ten calls
        except BlockingIOError:
            return b""
        if not data:
            raise OSError("the other end has hung up")
        return data

    def _gone(self, reason: Exception | str) -> DeviceError:
        return DeviceError(f"{self.url}: the serial line is gone ({reason}): check cable and power")


def sending_us(size: int, baud: int) -> float:
    """Return the time of `size` bytes on the line, in microseconds: 8 data bits, a start bit, a stop bit each."""
    return size * BITS_A_BYTE * 1e6 / baud


def _opened(url: str, baud: int) -> "Serial":
    from serial import serial_for_url

    if "://" not in url:
        check_node(url)
    try:
        return serial_for_url(url, baud, timeout=0, write_timeout=_WRITE_TIMEOUT_S, exclusive=True)
    except Exception as reason:  # termios.error is not an OSError, and each kind of URL raises different errors
        advice = _ADVICE.get(getattr(reason, "errno", None) or 0, f"cannot be opened at {baud} baud ({reason})")
        raise DeviceError(f"{url}: {advice}") from reason


def _node(port: str | int) -> int | None:
    """Return the device number behind a path or a descriptor, None if it is not a device."""
    try:
        return os.stat(port).st_rdev or None  # noqa: PTH116 - of a descriptor, too
    except (OSError, ValueError):
        return None


def _lower_latency(port: "Serial") -> None:
    """Set an FTDI adapter to deliver bytes at once, without its wait of 16 ms for more."""
    if hasattr(port, "set_low_latency_mode"):
        try:
            port.set_low_latency_mode(True)
        except (OSError, ValueError) as reason:  # another kind of adapter: no harm done
            _LOG.debug("%s: %s", port.port, reason)
