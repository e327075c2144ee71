"""The far end of a serial line: a pty that any serial client opens by a name of its own, paced like a wire."""

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from threading import Lock
from time import monotonic
from types import TracebackType
from typing import Self

from ..errors import DeviceError
from .pacing import BITS_PER_BYTE, Outgoing
from .pty_wire import PtyWire

_MOST_WAITING = 4096


class PtyLine:
    """A serial line whose near end is the port `link`.

    link   where the port shall stand: a symbolic link to the pty, made whole at once, removed on close
    baud   bits a second, ten of them a byte, both ways; a client may set any other rate on its side
    paced  False: bytes take no time

    `receive` is called from the line's own thread with what the client sent; `damage` makes of every message that goes
    out what a bad cable would, nothing at all included; `delay_s` is how much later than it was sent a message goes
    out. All may be set at any time. Of messages that wait for the line, or for a client that does not read, 4096 bytes
    are kept, the newest; older ones are dropped whole.

    Raises DeviceError where no link can be made or the system has no pty left.
    """

    def __init__(self, link: Path, baud: int = 115200, *, paced: bool = True) -> None:
        self.link, self.baud = link, baud
        self.receive: Callable[[bytes], None] | None = None
        self.sent_bytes = 0
        self.delay_s = 0.0
        self._outgoing = Outgoing(BITS_PER_BYTE / baud if paced else 0.0, _MOST_WAITING)
        self._unplugged = 0
        self._lock = Lock()
        self._wire: PtyWire | None = None
        self.replug()

    @property
    def damage(self) -> Callable[[bytes], bytes] | None:
        """What happens to every message on its way out."""
        return self._outgoing.damage

    @damage.setter
    def damage(self, damage: Callable[[bytes], bytes] | None) -> None:
        self._outgoing.damage = damage

    @property
    def dropped_messages(self) -> int:
        """How many messages never went out: too many waited, or the line was unplugged."""
        return self._outgoing.dropped + self._unplugged

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
        self._outgoing.put(monotonic() + self.delay_s, data)
        wire.wake()

    def unplug(self) -> None:
        """Take the port away, as a pulled USB plug does: an open client sees it die, and the link is gone."""
        with self._lock:
            wire, self._wire = self._wire, None
        if wire is not None:
            _unlink(self.link, wire.path)
            wire.close()

    def replug(self) -> None:
        """Put a new port under the same link. What still waited for the old one is forgotten."""
        with self._lock:
            if self._wire is None:
                self._outgoing.clear()
                self._wire = self._plug()

    def close(self) -> None:
        """Remove the port for good."""
        self.unplug()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _plug(self) -> PtyWire:
        try:
            wire = PtyWire(self._outgoing, self._heard, self._sent)
        except OSError as error:
            raise DeviceError(f"no pty for {self.link}: {error.strerror}; is /dev/pts mounted and not full?") from error
        try:
            _link(self.link, wire.path)
        except OSError:
            wire.close()
            raise
        return wire

    def _heard(self, data: bytes) -> None:
        receive = self.receive  # another thread may take it away meanwhile
        if receive is not None:
            receive(data)

    def _sent(self, count: int) -> None:
        self.sent_bytes += count


def _link(link: Path, target: str) -> None:
    """Let `link` point to `target`, in place of a link that an earlier run left to a pty, but of nothing else."""
    if (link.exists() or link.is_symlink()) and not _leads_to_a_pty(link):
        raise DeviceError(f"{link} exists and is no emulated port: remove it, or name another place")
    fresh = link.with_name(f".{link.name}.{os.getpid()}")
    try:
        fresh.symlink_to(target)
        fresh.replace(link)
    except OSError as error:
        fresh.unlink(missing_ok=True)
        raise DeviceError(f"{link}: no port can be linked there: {error.strerror}") from error


def _leads_to_a_pty(link: Path) -> bool:
    return link.is_symlink() and str(link.readlink()).startswith("/dev/pts/")


def _unlink(link: Path, target: str) -> None:
    """Remove `link` unless it has come to mean another port in the meantime."""
    with contextlib.suppress(OSError):
        if str(link.readlink()) == target:
            link.unlink()
