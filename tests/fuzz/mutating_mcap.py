"""Mutants of recordings: records changed and added, with their lengths and checksums right again.

MCAP specification: https://mcap.dev/spec
"""

from random import Random
from struct import Struct, error
from typing import NamedTuple
from zlib import crc32

from mutating import INTEGERS, TEXTS, altered, json_file

from thenar.runtime.errors import FormatError
from thenar.runtime.recording.layout import decode_text, encode_bytes, encode_text
from thenar.runtime.recording.mcap import MAGIC

_OPENING = Struct("<BQ")
_LENGTH = Struct("<I")
_MESSAGE = Struct("<HIQQ")
_MESSAGE_OP, _METADATA_OP, _DATA_END_OP, _FOOTER_OP = 5, 12, 15, 2
# What is repeated fills no more: it is held in memory to be written.
_LARGEST = 2_000_000


class Record(NamedTuple):
    """A record of an MCAP file."""

    opcode: int
    content: bytes


def mcap_file(data: bytes, random: Random) -> bytes:
    """Change a recording: what its records hold, their kinds and order; its bytes now and then."""
    try:
        records = records_of(data)
    except error:
        return altered(data, random)
    if not records or random.random() < 0.1:
        return altered(data, random)
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        _change(records, random)
    sound = random.random() < 0.9
    return joined(records, sound)


def records_of(data: bytes) -> list[Record]:
    found, at = [], len(MAGIC)
    while at < len(data) - len(MAGIC):
        opcode, length = _OPENING.unpack_from(data, at)
        at += _OPENING.size
        found.append(Record(opcode, data[at : at + length]))
        at += length
    return found


def joined(records: list[Record], sound: bool = True) -> bytes:
    """Return the records as a file; with `sound`, its end and the checksum of its data are right."""
    data = bytearray(MAGIC)
    for opcode, content in records:
        if opcode == _DATA_END_OP and sound:
            content = _LENGTH.pack(crc32(data))
        data += _OPENING.pack(opcode, len(content)) + content
    return bytes(data) + (MAGIC if sound else b"")


def _change(records: list[Record], random: Random) -> None:
    at = random.randrange(len(records))
    record = records[at]
    match random.randrange(9):
        case 0:
            records[at] = record._replace(opcode=random.choice((0, 1, 3, 4, 5, 6, 9, 12, 15, 0x7F, 0x80, 255)))
        case 1:
            records.insert(at, records[random.randrange(len(records))])
        case 2 if len(records) > 1:
            del records[at]
        case 3:
            other = random.randrange(len(records))
            records[at], records[other] = records[other], record
        case 4:
            records[at:at] = [record] * _times(record.content, random.choice((2, 500)))
        case _:
            records[at] = record._replace(content=_content(record, random))


def _times(content: bytes, times: int) -> int:
    return max(1, min(times, _LARGEST // max(len(content), 1)))


def _content(record: Record, random: Random) -> bytes:
    if record.opcode == _MESSAGE_OP and len(record.content) >= _MESSAGE.size:
        return _message(record.content, random)
    if record.opcode == _METADATA_OP:
        return _metadata(record.content, random)
    if record.opcode == _FOOTER_OP:
        return record.content[: random.randrange(len(record.content) + 1)]
    return altered(record.content, random)


def _message(content: bytes, random: Random) -> bytes:
    channel, sequence, logged, published = _MESSAGE.unpack_from(content)
    data = content[_MESSAGE.size :]
    match random.randrange(6):
        case 0:
            channel = random.choice((0, 1, 2, 3, 4, 5, 6, 65535))
        case 1:
            logged = random.choice(INTEGERS) % 2**64
        case 2:
            published = random.choice(INTEGERS) % 2**64
        case _:
            try:
                data = encode_text(json_file(decode_text(data), random))
            except FormatError:
                data = random.choice((_states, altered))(data, random)
    return _MESSAGE.pack(channel, sequence, logged, published) + data


def _states(data: bytes, random: Random) -> bytes:
    """Return the bytes of a frame in which every device and switch says something else."""
    length = random.choice((len(data) - 16, len(data) - 16, 0, 40))
    return encode_bytes(bytes(random.randrange(random.choice((2, 8, 256))) for _ in range(max(length, 0))))


def _metadata(content: bytes, random: Random) -> bytes:
    """Change one key or value of a metadata record's map; values are texts or JSON."""
    try:
        name, at = _text(content, 0)
        pairs, at = [], at + _LENGTH.size
        while at < len(content):
            key, at = _text(content, at)
            value, at = _text(content, at)
            pairs.append([key, value])
    except error:
        return altered(content, random)
    pair = random.choice(pairs or [[b"version", b"1"]])
    match random.randrange(8):
        case 0:
            pair[0] = random.choice(TEXTS).encode("utf-8", "surrogatepass")
        case 1:
            pair[1] = random.choice(TEXTS).encode("utf-8", "surrogatepass")
        case 2:
            pairs.remove(pair) if pair in pairs else pairs.append(pair)
        case 3:
            name = altered(name, random)
        case _:
            pair[1] = json_file(pair[1], random)
    return _packed(name) + _packed(b"".join(_packed(text) for pair in pairs for text in pair))


def _text(content: bytes, at: int) -> tuple[bytes, int]:
    (length,) = _LENGTH.unpack_from(content, at)
    end = at + _LENGTH.size + length
    return content[at + _LENGTH.size : end], end


def _packed(text: bytes) -> bytes:
    return _LENGTH.pack(len(text)) + text
