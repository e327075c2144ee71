"""JSON lines into a file: stdout, a pipe, a file on disk, anything that takes bytes."""

import os
import stat
import sys
from contextlib import suppress
from io import UnsupportedOperation
from pathlib import Path
from typing import BinaryIO

from ..live.health import HealthReport
from ..live.published import LiveGrasp
from ..preshape.preshape import Preshape
from .angles import JointAngles
from .line import encode, encode_health
from .outlet import Outlet, Writer, patient_writer
from .sink import SinkError, SinkReport


class JsonLines:
    """One line a frame into `file`.

    A pipe whose reader is slow loses whole lines and holds nobody up; with `wait` it is the other way round, which is
    right for a replay and wrong for a live glove. A reader that is gone (`head`) is noted in the report.
    """

    __slots__ = ("_error", "_file", "_lost", "_outlet", "_owned", "_sent", "_where")

    def __init__(self, file: BinaryIO, *, wait: bool = False, where: str = "jsonl", owned: bool = False) -> None:
        """Write into `file`, which `close` closes only if it is `owned`."""
        self._file = file
        self._outlet = Outlet(_writer(file, wait))
        self._owned = owned
        self._where = where
        self._sent = self._lost = 0
        self._error = ""

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Write one line, or lose it."""
        self._count(encode(grasp, preshape, angles))

    def health(self, report: HealthReport) -> None:
        """Write one line, or lose it."""
        self._count(encode_health(report))

    def _count(self, line: bytes) -> None:
        sent = not self._error and self._send(line)
        self._sent += sent
        self._lost += not sent

    def _send(self, line: bytes) -> bool:
        try:
            return self._outlet.send(line)
        except (OSError, ValueError) as reason:  # ValueError: somebody closed the file
            self._error = getattr(reason, "strerror", None) or str(reason)
            self._take_back(len(line) - self._outlet.waiting)
            return False

    def _take_back(self, torn: int) -> None:
        """Cut off the part of a line that a full disk had room for, unless somebody else has written behind it."""
        if not (torn > 0 and self._owned):
            return
        with suppress(OSError, ValueError):
            descriptor = self._file.fileno()
            end = os.lseek(descriptor, 0, os.SEEK_CUR)
            if os.fstat(descriptor).st_size == end:
                os.ftruncate(descriptor, end - torn)

    def report(self) -> SinkReport:
        """Return how this sink is doing."""
        return SinkReport(self._where, None, self._sent, self._lost, self._error, over=bool(self._error))

    def close(self) -> None:
        """Finish the line that was begun, if the reader lets us, and close what was opened here."""
        if not self._error:
            self._send(b"")
        if self._owned:
            self._file.close()


def _writer(file: BinaryIO, wait: bool) -> Writer:
    def write(data: bytes) -> int:
        file.write(data)
        file.flush()
        return len(data)

    if wait:
        return write
    try:
        descriptor = file.fileno()
    except (AttributeError, UnsupportedOperation):  # held in memory
        return write
    file.flush()
    return patient_writer(descriptor)


def open_jsonlines(path: str, *, wait: bool = False) -> JsonLines:
    """Return JSON lines on stdout ("-") or at the end of a file or named pipe. Raises SinkError."""
    where = f"jsonl:{path}"
    if path == "-":
        return JsonLines(sys.stdout.buffer, wait=wait, where=where)
    try:
        # A named pipe that nobody reads would hold up a blocking open for ever.
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NONBLOCK, 0o666)
    except OSError as reason:
        hint = ": is its reader running?" if Path(path).is_fifo() else ""
        raise SinkError(f"{where} cannot be written: {reason.strerror}{hint}") from None
    try:
        _finish_line(descriptor, path)
    except OSError as reason:
        os.close(descriptor)
        raise SinkError(f"{where} cannot be written: {reason.strerror}") from None
    if wait:
        os.set_blocking(descriptor, True)
    return JsonLines(os.fdopen(descriptor, "wb", buffering=0), wait=wait, where=where, owned=True)


def _finish_line(descriptor: int, path: str) -> None:
    """End the line that whoever wrote the file last was killed in, so that the next one begins a line."""
    found = os.fstat(descriptor)
    if not (stat.S_ISREG(found.st_mode) and found.st_size):
        return
    with Path(path).open("rb") as file:
        file.seek(-1, os.SEEK_END)
        whole = file.read(1) == b"\n"
    if not whole:
        os.write(descriptor, b"\n")
