"""The bytes of the kinds of MCAP records that a recording has (MCAP specification, section Records).

The `mcap` package knows them, too. But it needs compressors of 30 MB, which no recording uses.
"""

from collections.abc import Mapping
from enum import IntEnum
from struct import Struct
from typing import Any

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
