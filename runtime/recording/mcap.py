"""The bytes of the kinds of MCAP records that a recording has (MCAP specification, section Records), and the records of
a file, one after the other, up to the last whole one.

The `mcap` package knows them, too. But it needs compressors of 30 MB, which no recording uses. No length in a file is
trusted. Every byte counts in the checksums, including those of unknown records and of those too long to be kept.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from io import SEEK_END
from pathlib import Path
from struct import Struct
from typing import Any, BinaryIO
from zlib import crc32

from ..errors import FormatError
from ..files import open_file

MAGIC = b"\x89MCAP0\r\n"
# Longer than any record of ours. Parsed as JSON a record takes about twenty times its length.
LARGEST_RECORD = 16 << 20
_PIECE = 1 << 20
_OPENING = Struct("<BQ")
_NUMBERS = {letter: Struct(f"<{letter}") for letter in "HIQ"}


class Opcode(IntEnum):
    """The kinds of records."""

    HEADER = 1
    FOOTER = 2
    SCHEMA = 3
    CHANNEL = 4
    MESSAGE = 5
    CHUNK = 6
    MESSAGE_INDEX = 7
    CHUNK_INDEX = 8
    ATTACHMENT = 9
    ATTACHMENT_INDEX = 10
    STATISTICS = 11
    METADATA = 12
    METADATA_INDEX = 13
    SUMMARY_OFFSET = 14
    DATA_END = 15


# The fields of a record in order: H, I and Q are unsigned numbers of 16, 32 and 64 bits, s is a text, b are bytes, m is
# a map from texts to texts, c one from numbers of 16 bits to numbers of 64.
_FIELDS = {
    Opcode.HEADER: "ss",  # profile, library
    Opcode.FOOTER: "QQI",  # where the summary begins, and its offsets; CRC-32 of the summary
    Opcode.SCHEMA: "Hssb",  # id, name, encoding, data
    Opcode.CHANNEL: "HHssm",  # id, id of its schema, topic, encoding of its messages, metadata
    Opcode.STATISTICS: "QHIIIIQQc",  # messages, schemas, channels, attachments, metadata, chunks, first and last time,
    # messages of each channel
    Opcode.METADATA: "sm",  # name, content
    Opcode.METADATA_INDEX: "QQs",  # offset, length, name
    Opcode.DATA_END: "I",  # CRC-32 of the data section
}


def encode(opcode: Opcode, *values: Any) -> bytes:
    """Return a record with these values of its fields."""
    content = b"".join(_encoded(kind, value) for kind, value in zip(_FIELDS[opcode], values, strict=True))
    return _OPENING.pack(opcode, len(content)) + content


def _encoded(kind: str, value: Any) -> bytes:
    if kind in _NUMBERS:
        return _NUMBERS[kind].pack(value)
    if kind in "sb":
        data: bytes = value.encode() if kind == "s" else value
        return _NUMBERS["I"].pack(len(data)) + data
    key, item = _PAIRS[kind]
    return _encoded("b", b"".join(_encoded(key, name) + _encoded(item, of) for name, of in value.items()))


_PAIRS: Mapping[str, tuple[str, str]] = {"m": ("s", "s"), "c": ("H", "Q")}


def decode(opcode: Opcode, content: bytes) -> tuple[list[Any], int]:
    """Return the values of the fields of a record with this content, and the number of bytes left over.

    Raises ValueError if the content is no such record.
    """
    values, at = [], 0
    for kind in _FIELDS[opcode]:
        value, at = _decoded(kind, content, at)
        values.append(value)
    return values, len(content) - at


def _decoded(kind: str, content: bytes, at: int) -> tuple[Any, int]:
    """Return the value that begins at a place, and the place after it."""
    if kind in _NUMBERS:
        data, at = _cut(content, at, _NUMBERS[kind].size)
        return _NUMBERS[kind].unpack(data)[0], at
    length, at = _decoded("I", content, at)
    data, at = _cut(content, at, length)
    if kind in "sb":
        return (data.decode() if kind == "s" else data), at
    key, item = _PAIRS[kind]
    pairs, place = {}, 0
    while place < len(data):
        name, place = _decoded(key, data, place)
        pairs[name], place = _decoded(item, data, place)
    return pairs, at


def _cut(content: bytes, at: int, length: int) -> tuple[bytes, int]:
    if len(content) - at < length:
        raise ValueError(f"{length} bytes are missing or cut at byte {at}")
    return content[at : at + length], at + length


@dataclass(frozen=True, slots=True)
class RawRecord:
    """A whole record: its place and its content.

    content        None if it is too long
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

    A section begins with the file, another one after the end of the data.
    """

    def __init__(self, path: Path) -> None:
        """Raises FormatError if the file is no regular one or does not begin as MCAP does, OSError as it comes."""
        self.end: End | None = None
        self._crc = crc32(MAGIC)
        self._path = path
        with open_file(path, FormatError) as file:
            self.size = file.seek(0, SEEK_END)
            file.seek(0)
            if file.read(len(MAGIC)) != MAGIC:
                raise FormatError(f"{path.name} does not begin like an MCAP file: it is another kind of file, or empty")

    def __iter__(self) -> Iterator[RawRecord]:
        with open_file(self._path, FormatError) as file:
            file.seek(len(MAGIC))
            while (record := self._next(file)) is not None:
                yield record
                if record.opcode == Opcode.DATA_END:
                    self._crc = 0
                if record.opcode == Opcode.FOOTER:
                    whole, closed = record.end + len(MAGIC), file.read(len(MAGIC)) == MAGIC
                    if closed:
                        more = "bytes follow the end of the recording" if whole < self.size else ""
                        self.end = End(True, whole, self.size, more)
                    else:
                        self.end = End(False, record.end, self.size, "its last 8 bytes are missing or damaged")
                    return

    def _next(self, file: BinaryIO) -> RawRecord | None:
        offset = file.tell()
        opening = file.read(_OPENING.size)
        if reason := self._fault(offset, opening):
            self.end = End(False, offset, self.size, reason)
            return None
        opcode, length = _OPENING.unpack(opening)
        before = self._crc
        self._crc = crc32(opening, before)
        content = self._content(file, length)
        end = offset + _OPENING.size + length
        if file.tell() != end:
            self.end = End(False, offset, self.size, "the file became shorter while it was read")
            return None
        return RawRecord(offset, opcode, content, end, before, self._crc)

    def _content(self, file: BinaryIO, length: int) -> bytes | None:
        """Return the next `length` bytes, or nothing if they are too many. These count all the same."""
        if length <= LARGEST_RECORD:
            content = file.read(length)
            self._crc = crc32(content, self._crc)
            return content
        while length and (piece := file.read(min(length, _PIECE))):
            self._crc = crc32(piece, self._crc)
            length -= len(piece)
        return None

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
