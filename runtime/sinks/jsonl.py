"""JSON lines to a file: stdout, a pipe, a file on disk, or anything else that takes bytes.

Lines describe grasps, and now and then the glove's health. A header before the first line with angles, and wherever the
joints change, names the joints. Readers distinguish lines by `kind`; msgspec does so
automatically: `msgspec.json.decode(line, type=Line)`.

A line is sent whole or not at all.
"""

import os
import stat
import sys
from abc import abstractmethod
from contextlib import suppress
from io import UnsupportedOperation
from typing import Any, BinaryIO, Literal

import msgspec
from msgspec import json, structs

from ..published import HealthReport, JointAngles, LiveGrasp, Preshape
from .base import Sink, SinkError, SinkKind, SinkPlace


class HeaderLine(msgspec.Struct, frozen=True, tag_field="kind", tag="header"):
    """The names of the joints whose angles are in the lines that follow."""

    joints: tuple[str, ...]


class GraspLine(LiveGrasp, frozen=True, tag_field="kind", tag="grasp"):
    """The fields of `LiveGrasp`, followed by the preshape and the angles in rad, null if there are none.

    Probabilities and angles have four decimals.
    """

    preshape: Preshape | None = None
    angles: tuple[float, ...] | None = None


class HealthLine(HealthReport, frozen=True, tag_field="kind", tag="health"):
    """The fields of `HealthReport`."""


Line = HeaderLine | GraspLine | HealthLine

# While nothing changes, in a live run.
_RATE_HZ = 10
_encode = json.Encoder().encode


def encode(grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> bytes:
    """Return a frame's line, including its newline. UTF-8, no newline inside."""
    grasp = structs.replace(
        grasp, probability=round(grasp.probability, 4), segment_probability=round(grasp.segment_probability, 4)
    )
    positions = None if angles is None else tuple(round(position, 4) for position in angles.positions_rad)
    values: list[Any] = [*structs.astuple(grasp), preshape, positions]
    return _encode(GraspLine(*values)) + b"\n"


def encode_header(angles: JointAngles) -> bytes:
    """Return the line that names the joints of these angles."""
    return _encode(HeaderLine(angles.names)) + b"\n"


def encode_health(report: HealthReport) -> bytes:
    """Return a report's line, including its newline."""
    return _encode(HealthLine(**{name: getattr(report, name) for name in report.__struct_fields__})) + b"\n"


class LineSink(Sink):
    """Sends lines: a header wherever the joints change, grasps, and the glove's health."""

    # Those that the last header named.
    joints: tuple[str, ...] = ()

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Send one line, after a header if the joints are others than before."""
        if angles is not None and angles.names != self.joints:
            self.joints = angles.names
            self.send("joints", encode_header(angles))
        self.send("grasp", encode(grasp, preshape, angles))

    def health(self, report: HealthReport) -> None:
        """Send the report's line."""
        self.send("health", encode_health(report))

    @abstractmethod
    def send(self, topic: Literal["joints", "grasp", "health"], line: bytes) -> None:
        """Send a line, or lose it."""


class JsonLines(LineSink):
    """Writes the lines to `file`, and waits for a slow reader, in a live run on its own thread (`Fanout`).

    A reader that is gone (`head`) is noted in the report. A full disk loses lines until it has room again.
    """

    def __init__(self, file: BinaryIO, *, where: str = "jsonl", owned: bool = False) -> None:
        """Write into `file`, which `close` closes only if it is `owned`."""
        file.flush()
        self._file = file
        self._rest = b""
        self._owned = owned
        self.where = where

    def send(self, topic: str, line: bytes) -> None:
        """Write the rest of a line that a full disk cut, then this line, or lose it."""
        left, sent = self._rest + line, False
        try:
            while left and not self.gone:
                left = left[self._write(left) :]
            self._rest, sent = b"", not self.gone
        except (OSError, ValueError) as reason:  # ValueError: somebody closed the file
            self.error = getattr(reason, "strerror", None) or str(reason)
            self.gone = isinstance(reason, BrokenPipeError)
            torn = len(line) - len(left)
            self._rest = left[: max(-torn, 0)] if torn <= 0 or self._takes_back(torn) else left
        if line:
            self.sent += sent
            self.lost += not sent

    def _write(self, data: bytes) -> int:
        try:
            descriptor = self._file.fileno()
        except (AttributeError, UnsupportedOperation):  # held in memory
            written = self._file.write(data)
            self._file.flush()
            return written
        # No lock is held while this waits: the interpreter may end meanwhile.
        return os.write(descriptor, data)

    def _takes_back(self, torn: int) -> bool:
        """Cut off the part of a line that still fitted on a full disk, unless another process has written after it."""
        if self._owned:
            with suppress(OSError, ValueError):
                descriptor = self._file.fileno()
                end = os.lseek(descriptor, 0, os.SEEK_CUR)
                if os.fstat(descriptor).st_size == end:
                    os.ftruncate(descriptor, end - torn)
                    return True
        return False

    def close(self) -> None:
        """Finish the line that was begun, if the reader allows, and close the file if it was opened here."""
        self.send("", b"")
        if self._owned:
            self._file.close()


def _open(place: SinkPlace) -> JsonLines:
    """Return JSON lines on stdout ("-") or at the end of a file or named pipe. Raises SinkError."""
    where, path = place.text, place.place
    if path == "-":
        return JsonLines(sys.stdout.buffer, where=where)
    try:
        # A named pipe without a reader would block the open forever.
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NONBLOCK, 0o666)
    except OSError as reason:
        from pathlib import Path

        hint = ": is its reader running?" if Path(path).is_fifo() else ""
        raise SinkError(f"{where} cannot be written: {reason.strerror}{hint}") from None
    try:
        _finish_line(descriptor, path)
    except OSError as reason:
        os.close(descriptor)
        raise SinkError(f"{where} cannot be written: {reason.strerror}") from None
    os.set_blocking(descriptor, True)
    return JsonLines(os.fdopen(descriptor, "wb", buffering=0), where=where, owned=True)


def _finish_line(descriptor: int, path: str) -> None:
    """End a line that its writer left incomplete when it was killed, so that the next one begins on a new line."""
    found = os.fstat(descriptor)
    if not (stat.S_ISREG(found.st_mode) and found.st_size):
        return
    from pathlib import Path

    with Path(path).open("rb") as file:
        file.seek(-1, os.SEEK_END)
        whole = file.read(1) == b"\n"
    if not whole:
        os.write(descriptor, b"\n")


MEMBER = SinkKind("jsonl", "FILE", "JSON lines at the end of a file; - is stdout", _open, rate=_RATE_HZ)
