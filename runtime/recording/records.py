"""The records of an MCAP file, one after the other, up to the last whole one. No length in the file is trusted.

Every byte counts in the checksums, including those of unknown records and of those too long to be kept.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from io import SEEK_END
from pathlib import Path
from struct import Struct
from typing import BinaryIO
from zlib import crc32

from ..errors import McapError
from ..files import open_file
from .layout import LARGEST_RECORD, MAGIC
from .mcap import Opcode

_OPENING = Struct("<BQ")
_PIECE = 1 << 20
_READ = frozenset(
    {
        Opcode.HEADER,
        Opcode.SCHEMA,
        Opcode.CHANNEL,
        Opcode.MESSAGE,
        Opcode.METADATA,
        Opcode.DATA_END,
        Opcode.FOOTER,
    }
)


@dataclass(frozen=True, slots=True)
class RawRecord:
    """A whole record: its place and its content.

    content        None if it is of no use here, or too long
    before, after  CRC-32 of all bytes from the beginning of its section to its own beginning, and to its end
    """

    offset: int
    opcode: int
    content: bytes | None
    end: int
    before: int
    after: int


@dataclass(frozen=True, slots=True)
class End:
    """How a file ends: closed properly or not; the last whole record ends at byte `whole` of `size`; and the reason."""

    closed: bool
    whole: int
    size: int
    reason: str = ""


class RecordStream:
    """Iterates over the whole records of `path`; `end` is known afterwards. Memory use is bounded for any file.

    A section begins with the file; another one wherever `begin_section` is called.
    """

    def __init__(self, path: Path) -> None:
        """Raises McapError if the file is no regular one or does not begin as MCAP does, OSError as it comes."""
        self.end: End | None = None
        self._crc = crc32(MAGIC)
        self._path = path
        with open_file(path, McapError) as file:
            self.size = file.seek(0, SEEK_END)
            file.seek(0)
            if file.read(len(MAGIC)) != MAGIC:
                raise McapError(f"{path.name} does not begin like an MCAP file: it is another kind of file, or empty")

    def __iter__(self) -> Iterator[RawRecord]:
        return self.since(len(MAGIC))

    def since(self, offset: int) -> Iterator[RawRecord]:
        """Iterate from `offset` on, where a record is known to begin."""
        with open_file(self._path, McapError) as file:
            file.seek(offset)
            while (record := self._next(file)) is not None:
                yield record
                if record.opcode == Opcode.FOOTER:
                    self.end = self._ended(record.end, file.read(len(MAGIC)))
                    return

    def begin_section(self) -> None:
        """Start the checksum after the newest record."""
        self._crc = 0

    def _next(self, file: BinaryIO) -> RawRecord | None:
        offset = file.tell()
        opening = file.read(_OPENING.size)
        if reason := self._fault(offset, opening):
            self.end = End(False, offset, self.size, reason)
            return None
        opcode, length = _OPENING.unpack(opening)
        before = self._crc
        self._crc = crc32(opening, before)
        content = self._content(file, opcode, length)
        end = offset + _OPENING.size + length
        if file.tell() != end:
            self.end = End(False, offset, self.size, "the file became shorter while it was read")
            return None
        return RawRecord(offset, opcode, content, end, before, self._crc)

    def _content(self, file: BinaryIO, opcode: int, length: int) -> bytes | None:
        """Return the next `length` bytes, or nothing for a record that is skipped. Its bytes count all the same."""
        if opcode in _READ and length <= LARGEST_RECORD:
            content = file.read(length)
            self._crc = crc32(content, self._crc)
            return content
        while length and (piece := file.read(min(length, _PIECE))):
            self._crc = crc32(piece, self._crc)
            length -= len(piece)
        return None

    def _ended(self, whole: int, magic: bytes) -> End:
        if magic != MAGIC:
            return End(False, whole, self.size, "its last 8 bytes are missing or damaged")
        whole += len(MAGIC)
        return End(True, whole, self.size, "bytes follow the end of the recording" if whole < self.size else "")

    def _fault(self, offset: int, opening: bytes) -> str:
        """Return why no whole record begins at `offset` with the bytes `opening`, or nothing."""
        if len(opening) < _OPENING.size:
            return "a record is cut in its first bytes" if opening else "it was never closed"
        opcode, length = _OPENING.unpack(opening)
        left = self.size - offset - _OPENING.size
        if opcode == 0:
            return "no record begins there"
        return f"a record claims {length} bytes and {left} are left" if length > left else ""


def kind_of(opcode: int) -> str:
    """Return the name of a kind of record."""
    try:
        return Opcode(opcode).name.lower().replace("_", " ")
    except ValueError:
        return f"record of unknown kind {opcode:#04x}"
