"""JSON lines to a file: stdout, a pipe, a file on disk, or anything else that takes bytes.

Lines describe grasps, and now and then the glove's health and the hand's progress in a task. Readers distinguish them
by `kind`; msgspec does so automatically: `msgspec.json.decode(line, type=GraspLine | HealthLine | ProgressLine)`.

A line is sent whole or not at all, and a slow descriptor delays nobody.
"""

import os
import select
import stat
import sys
from collections.abc import Callable
from contextlib import suppress
from io import UnsupportedOperation
from pathlib import Path
from typing import BinaryIO

from msgspec import json, structs

from ..detail import Detail
from ..preshape.selector import Preshape
from ..published import HealthReport, JointAngles, LiveGrasp
from ..task import Progress, ProgressLine
from .base import Sink, SinkError, SinkKind, SinkPlace, SinkReport


class GraspLine(LiveGrasp, frozen=True, tag_field="kind", tag="grasp"):
    """The fields of `LiveGrasp`, followed by the preshape and the angles, null if there are none."""

    preshape: Preshape | None = None
    angles: JointAngles | None = None


class DetailLine(Detail, frozen=True, tag_field="kind", tag="detail"):
    """The fields of `Detail`, the `number` of the grasp line that it belongs to, and the build's checksum."""

    number: int = 0
    build: str = ""


class HealthLine(HealthReport, frozen=True, tag_field="kind", tag="health"):
    """The fields of `HealthReport`."""


_encode = json.Encoder().encode
_GRASP, _PRESHAPE, _ANGLES = b'{"kind":"grasp",', b',"preshape":', b',"angles":'


def encode(grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> bytes:
    """Return a frame's line, including its newline. UTF-8, no newline inside.

    The bytes equal those of a `GraspLine`, without making one.
    """
    parts = (_GRASP, _encode(grasp)[1:-1], _PRESHAPE, _encode(preshape), _ANGLES, _encode(angles), b"}\n")
    return b"".join(parts)


def encode_detail(detail: Detail, number: int, build: str) -> bytes:
    """Return a detail's line, including its newline."""
    return _encode(DetailLine(**structs.asdict(detail), number=number, build=build)) + b"\n"


def encode_health(report: HealthReport) -> bytes:
    """Return a report's line, including its newline."""
    return _encode(HealthLine(**{name: getattr(report, name) for name in report.__struct_fields__})) + b"\n"


def encode_task(progress: Progress) -> bytes:
    """Return the line of a task's progress, including its newline."""
    return _encode(ProgressLine(**structs.asdict(progress))) + b"\n"


# Bytes that a writable descriptor takes at once without blocking, even if it is set to block (POSIX: PIPE_BUF).
_PIECE = select.PIPE_BUF
# If an error is pending or the reader is gone, writing reports it.
_WRITABLE = select.POLLOUT | select.POLLERR | select.POLLHUP


# Writes some of the bytes and returns how many. Raises BlockingIOError: none now; any other OSError: never again.
Writer = Callable[[bytes], int]


class Outlet:
    """One reader's end: at most the rest of one line waits here; the rest waits in the system's buffer.

    written   number of bytes that it has taken
    """

    __slots__ = ("_rest", "_write", "written")

    def __init__(self, write: Writer) -> None:
        self._write = write
        self._rest = b""
        self.written = 0

    @property
    def waiting(self) -> int:
        """The number of bytes of the newest line that are not written yet."""
        return len(self._rest)

    def forget(self) -> None:
        """Drop what waits."""
        self._rest = b""

    def send(self, line: bytes) -> bool:
        """Send `line` if the reader keeps up; return whether it was at least begun. Raises OSError if it is gone."""
        for data in (self._rest, line):
            self._rest = data
            try:
                while self._rest:
                    taken = self._write(self._rest)
                    self.written += taken
                    self._rest = self._rest[taken:]
            except BlockingIOError:
                if data is not line:
                    return False
        # Nothing of this line was sent: it is lost, and the next one starts afresh.
        if line and len(self._rest) == len(line):
            self._rest = b""
            return False
        return True


def patient_writer(descriptor: int) -> Writer:
    """Return a writer for a shared descriptor, which must not be set to non-blocking."""
    poll = select.poll()
    poll.register(descriptor, select.POLLOUT)

    def write(data: bytes) -> int:
        events = poll.poll(0)
        if not events or not events[0][1] & _WRITABLE:
            raise BlockingIOError
        return os.write(descriptor, data[:_PIECE])

    return write


class JsonLines(Sink):
    """Writes one line per frame to `file`.

    A pipe with a slow reader loses whole lines and delays nobody; with `wait` it waits instead, which is right for a
    replay and wrong for a live glove. A reader that is gone (`head`) is noted in the report. A full disk loses lines
    until it has room again.
    """

    __slots__ = ("_error", "_file", "_gone", "_lost", "_outlet", "_owned", "_sent", "_where")

    def __init__(self, file: BinaryIO, *, wait: bool = False, where: str = "jsonl", owned: bool = False) -> None:
        """Write into `file`, which `close` closes only if it is `owned`."""
        self._file = file
        self._outlet = Outlet(_writer(file, wait))
        self._owned = owned
        self._where = where
        self._sent = self._lost = 0
        self._error, self._gone = "", False

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Write one line, or lose it."""
        self._send(encode(grasp, preshape, angles))

    def health(self, report: HealthReport) -> None:
        """Write one line, or lose it."""
        self._send(encode_health(report))

    def task(self, progress: Progress) -> None:
        """Write one line, or lose it."""
        self._send(encode_task(progress))

    def _send(self, line: bytes) -> None:
        sent = False
        if not self._gone:
            try:
                sent = self._outlet.send(line)
            except (OSError, ValueError) as reason:  # ValueError: somebody closed the file
                self._error = getattr(reason, "strerror", None) or str(reason)
                self._gone = isinstance(reason, BrokenPipeError)
                self._take_back(len(line) - self._outlet.waiting)
        if line:
            self._sent += sent
            self._lost += not sent

    def _take_back(self, torn: int) -> None:
        """Cut off the part of a line that still fitted on a full disk, unless another process has written after it."""
        if not self._owned:
            return
        with suppress(OSError, ValueError):
            descriptor = self._file.fileno()
            end = os.lseek(descriptor, 0, os.SEEK_CUR)
            if os.fstat(descriptor).st_size == end:
                os.ftruncate(descriptor, end - torn)
                self._outlet.forget()

    def report(self) -> SinkReport:
        """Return how this sink is doing."""
        return SinkReport(self._where, None, self._sent, self._lost, self._error, gone=self._gone)

    def close(self) -> None:
        """Finish the line that was begun, if the reader allows, and close the file if it was opened here."""
        self._send(b"")
        if self._owned:
            self._file.close()


def _writer(file: BinaryIO, wait: bool) -> Writer:
    def write(data: bytes) -> int:
        written = file.write(data)
        file.flush()
        return written

    if wait:
        return write
    try:
        descriptor = file.fileno()
    except (AttributeError, UnsupportedOperation):  # held in memory
        return write
    file.flush()
    return patient_writer(descriptor)


def _open(place: SinkPlace) -> JsonLines:
    """Return JSON lines on stdout ("-") or at the end of a file or named pipe. Raises SinkError."""
    where, path, wait = place.text, place.place, place.wait
    if path == "-":
        return JsonLines(sys.stdout.buffer, wait=wait, where=where)
    try:
        # A named pipe without a reader would block the open forever.
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
    """End a line that its writer left incomplete when it was killed, so that the next one begins on a new line."""
    found = os.fstat(descriptor)
    if not (stat.S_ISREG(found.st_mode) and found.st_size):
        return
    with Path(path).open("rb") as file:
        file.seek(-1, os.SEEK_END)
        whole = file.read(1) == b"\n"
    if not whole:
        os.write(descriptor, b"\n")


MEMBER = SinkKind("jsonl", "FILE", "JSON lines at the end of a file; - is stdout", _open)
