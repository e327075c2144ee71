"""The records of an MCAP file, one after the other, up to the last whole one. No length in the file is believed."""

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from struct import Struct
from typing import BinaryIO

from mcap.opcode import Opcode

from .errors import McapError
from .layout import MAGIC

_OPENING = Struct("<BQ")
# More than any record of ours or any usual chunk holds; a longer one is passed over unread.
LARGEST_READ = 64 << 20
_READ = frozenset(
    {Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.METADATA, Opcode.CHUNK, Opcode.DATA_END}
)


@dataclass(frozen=True, slots=True)
class RawRecord:
    """A whole record: where it begins and what it is. `content` is None where it was not worth reading."""

    offset: int
    opcode: int
    content: bytes | None
    end: int


@dataclass(frozen=True, slots=True)
class End:
    """How a file ends: closed properly or not; the last whole record ends at byte `whole` of `size`; and why there."""

    closed: bool
    whole: int
    size: int
    reason: str = ""


class RecordStream:
    """Iterates over the whole records of `path`; `end` is known afterwards. No file makes it take much memory."""

    def __init__(self, path: Path) -> None:
        """Raises McapError if the file does not begin as MCAP does, OSError as it comes."""
        self.end: End | None = None
        self.size = path.stat().st_size
        self._path = path
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise McapError(
                    f"{path.name} does not begin as an MCAP file does: it is another kind of file, or empty"
                )

    def __iter__(self) -> Iterator[RawRecord]:
        with self._path.open("rb") as file:
            file.seek(len(MAGIC))
            while (record := self._next(file)) is not None:
                yield record
                if record.opcode == Opcode.FOOTER:
                    closed = file.read(len(MAGIC)) == MAGIC
                    whole = record.end + len(MAGIC) * closed
                    self.end = End(closed, whole, self.size, "" if closed else "its last 8 bytes are missing")
                    return

    def _next(self, file: BinaryIO) -> RawRecord | None:
        offset = file.tell()
        opening = file.read(_OPENING.size)
        if reason := self._fault(offset, opening):
            self.end = End(False, offset, self.size, reason)
            return None
        opcode, length = _OPENING.unpack(opening)
        end = offset + _OPENING.size + length
        if opcode not in _READ or length > LARGEST_READ:
            file.seek(end)
            return RawRecord(offset, opcode, None, end)
        return RawRecord(offset, opcode, file.read(length), end)

    def _fault(self, offset: int, opening: bytes) -> str:
        """Return why no whole record begins at `offset` with the bytes `opening`, or nothing."""
        if len(opening) < _OPENING.size:
            return "a record is cut in its first bytes" if opening else "it was never closed"
        opcode, length = _OPENING.unpack(opening)
        left = self.size - offset - _OPENING.size
        if opcode == 0:
            return "no record begins there"
        return f"a record claims {length} bytes and {left} are left" if length > left else ""


def inside(chunk: bytes, offset: int) -> Iterator[RawRecord]:
    """Return the records inside a chunk's data, all of them said to be at the chunk's `offset`. Raises McapError."""
    file = BytesIO(chunk)
    while opening := file.read(_OPENING.size):
        opcode, length = _OPENING.unpack(opening) if len(opening) == _OPENING.size else (0, len(chunk))
        if length > len(chunk) - file.tell():
            raise McapError("is a chunk that ends inside a record")
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            raise McapError(f"is a chunk that holds a record of kind {opcode}, which no chunk may")
        yield RawRecord(offset, opcode, file.read(length), offset)
