"""Lines that a running command prints: no reader of them delays it."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from io import UnsupportedOperation
from typing import Any, TextIO

from thenar.runtime.writer_thread import WriterThread

# Lines, or drawings of the live view, that wait for a slow reader.
_MOST_WAITING = 1024


class _Unblocked:
    """Writes to the descriptor of a stream on a separate thread; what its reader does not take in time is lost.

    It writes past the stream, whose lock a hanging write would hold when the program ends.
    """

    def __init__(self, stream: TextIO, longest_us: int | None) -> None:
        self._stream, self._file, self._longest_us = stream, stream.fileno(), longest_us
        self.thread = WriterThread("notices", _MOST_WAITING)

    def write(self, text: str) -> int:
        data = text.encode(self._stream.encoding, self._stream.errors or "strict")
        self.thread.put(partial(_write_all, self._file, data), self._longest_us)
        return len(text)

    def flush(self) -> None:
        """Do nothing: the thread writes at once."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _write_all(file: int, data: bytes) -> None:
    with suppress(OSError):  # nobody can read it: the terminal was closed, or the disk is full
        while data:
            data = data[os.write(file, data) :]


@contextmanager
def unblocked(name: str, longest_us: int | None = None) -> Iterator[None]:
    """Let nothing that is printed on sys.`name` wait for its reader; what waits for more than `longest_us` is lost.

    If the reader hangs at the end, the stream stays so: the rest of the program can end.
    """
    stream = getattr(sys, name)
    try:
        ours = _Unblocked(stream, longest_us)
    except (AttributeError, UnsupportedOperation):  # closed, or held in memory
        yield
        return
    stream.flush()
    setattr(sys, name, ours)
    try:
        yield
    finally:
        if ours.thread.close():
            setattr(sys, name, stream)
