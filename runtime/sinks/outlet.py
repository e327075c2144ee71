"""Whole lines into a file descriptor that may be slow: a line goes out entirely or not at all, and nobody waits."""

import os
import select
from collections.abc import Callable

# What a descriptor that is writable takes at once without blocking, even where it is set to block (POSIX: PIPE_BUF).
_PIECE = select.PIPE_BUF


# Writes some of the bytes and returns how many. Raises BlockingIOError: none now; any other OSError: never again.
Writer = Callable[[bytes], int]


class Outlet:
    """One reader's end: at most the rest of one line waits here, what else waits stands in the system's own buffer.

    written   how many bytes it has taken
    """

    __slots__ = ("_rest", "_write", "written")

    def __init__(self, write: Writer) -> None:
        self._write = write
        self._rest = b""
        self.written = 0

    @property
    def waiting(self) -> int:
        """How many bytes of the newest line are still to be written."""
        return len(self._rest)

    def send(self, line: bytes) -> bool:
        """Send `line` if the reader keeps up; return whether it went out or began to. Raises OSError if it is gone."""
        if self._rest and not self._push(self._rest):
            return False
        self._push(line)
        # Nothing of this line went out: it is lost, and the next one starts afresh.
        if len(self._rest) == len(line):
            self._rest = b""
            return False
        return True

    def _push(self, data: bytes) -> bool:
        """Write what can be written of `data` now; keep the rest."""
        self._rest = data
        try:
            while self._rest:
                taken = self._write(self._rest)
                self.written += taken
                self._rest = self._rest[taken:]
        except BlockingIOError:
            return False
        return True


def patient_writer(descriptor: int) -> Writer:
    """Return a writer for a descriptor that is shared with others, and so must not be set to non-blocking."""
    poll = select.poll()
    poll.register(descriptor, select.POLLOUT)

    def write(data: bytes) -> int:
        if not any(event & (select.POLLOUT | select.POLLERR | select.POLLHUP) for _, event in poll.poll(0)):
            raise BlockingIOError
        return os.write(descriptor, data[:_PIECE])

    return write
