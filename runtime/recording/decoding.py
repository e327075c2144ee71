"""From the records of a recording to what was recorded."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from struct import Struct, error
from typing import Any
from zlib import crc32

import msgspec
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.exceptions import McapError as LibraryError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Metadata, Schema

from ..live.frames import GloveFrame, SwitchFrame
from ..live.published import LiveGrasp
from ..names import SHOWN, shortened
from .cdr import decode_bytes, decode_text
from .errors import McapError
from .frame_bytes import glove_frame, switch_frame
from .layout import CHANNELS, GLOVE, LARGEST_RECORD, RECOGNITION, SWITCHES, TRIALS, WRITER, Tail
from .records import RawRecord, inside, kind_of
from .session import METADATA, Label, Session, from_metadata

Entry = Session | SwitchFrame | GloveFrame | LiveGrasp | Label

_MESSAGE = Struct("<HIQQ")
_DECODERS: dict[int, Callable[[bytes], LiveGrasp | Label]] = {
    RECOGNITION: msgspec.json.Decoder(LiveGrasp).decode,
    TRIALS: msgspec.json.Decoder(Label).decode,
}
# What the library's records answer bad bytes with.
_UNREADABLE = (LibraryError, error, UnicodeDecodeError, OverflowError)
# Beyond them no time and no count of a recording lies.
_LEAST, _LARGEST = -(2**63), 2**63 - 1
_REASON = 200


@dataclass(slots=True)
class Passed:
    """Records, or parts of them, that were passed over: how many, and the first few with their places."""

    count: int = 0
    first: list[str] = field(default_factory=list)

    def add(self, what: str, offset: int) -> None:
        """Count one."""
        self.count += 1
        if len(self.first) < SHOWN:
            self.first.append(f"{what} at byte {offset}")


class Decoder:
    """Takes the records of a data section one by one.

    session  whose messages come now; None before the first
    ours     whether the file says that thenar wrote it
    foreign  whether another program has packed, numbered or added something
    passed   what was passed over
    broken   the offset of a chunk that does not match its checksum; None: all do
    """

    def __init__(self, tail: Tail) -> None:
        """Messages and sessions are counted in `tail`."""
        self.session: Session | None = None
        self.ours = self.foreign = False
        self.passed = Passed()
        self.broken: int | None = None
        self._tail = tail
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, int | None] = {}
        self._indexed = False

    def entries(self, record: RawRecord) -> Iterator[Entry]:
        """Yield what the record holds. Raises McapError, which goes on from "the record at byte 17 "."""
        # Indices of its messages follow a chunk. They repeat what it holds.
        self._indexed = self._indexed and record.opcode == Opcode.MESSAGE_INDEX
        content = record.content
        if content is None or (record.opcode != Opcode.CHUNK and len(content) > LARGEST_RECORD):
            self.foreign = True
            if not self._indexed:
                self.passed.add(kind_of(record.opcode), record.offset)
        elif record.opcode == Opcode.MESSAGE:
            entry = self._message(content)
            if entry is not None:
                yield entry
        elif record.opcode == Opcode.CHUNK:
            yield from self._chunk(record.offset, self._parsed(Chunk, record, content))
        else:
            yield from self._described(record, content)

    def _described(self, record: RawRecord, content: bytes) -> Iterator[Session]:
        """Take a record that says what others mean."""
        if record.opcode == Opcode.HEADER:
            self.ours = self._parsed(Header, record, content).library.startswith(WRITER)
        elif record.opcode == Opcode.METADATA:
            yield from self._sessions(record, self._parsed(Metadata, record, content))
        elif record.opcode == Opcode.CHANNEL:
            self._name(self._parsed(Channel, record, content))
        elif record.opcode == Opcode.SCHEMA:
            schema = self._parsed(Schema, record, content)
            self._schemas[schema.id] = schema.name

    def _parsed(self, kind: type[Any], record: RawRecord, content: bytes) -> Any:
        """Return the content of a record as the library's `kind`. Raises McapError."""
        found, rest = parsed(kind, content)
        if rest:
            # MCAP lets later versions add fields. This version of it has none.
            self.foreign = True
            self.passed.add(f"{rest} bytes more than a {kind.__name__.lower()} has", record.end - rest)
        return found

    def _message(self, content: bytes) -> Entry | None:
        if len(content) < _MESSAGE.size:
            raise McapError("is a message cut short")
        number, _, logged_ns, published_ns = _MESSAGE.unpack_from(content)
        if number not in self._channels:
            raise McapError(f"is a message of channel {number}, which the file does not name")
        channel, session = self._channels[number], self.session
        if channel is None:
            return None
        if session is None:
            raise McapError("is a message before any session of thenar")
        self._tail.add_message(channel, logged_ns)
        data = content[_MESSAGE.size :]
        time_us = (published_ns - session.clock_ns) // 1000
        if channel == SWITCHES:
            return switch_frame(time_us, decode_bytes(data), len(session.switches), len(session.sensors))
        if channel == GLOVE:
            return glove_frame(time_us, decode_bytes(data), len(session.sensors))
        return _from_json(channel, decode_text(data))

    def _sessions(self, record: RawRecord, metadata: Metadata) -> Iterator[Session]:
        if metadata.name != METADATA:
            self.foreign = True
            self.passed.add(f"metadata {shortened(repr(metadata.name))}", record.offset)
            return
        before, session = self.session, from_metadata(metadata.metadata)
        if before is not None and (before.switches, before.sensors) != (session.switches, session.sensors):
            raise McapError("begins a session of another glove than that before it: its switches or sensors differ")
        self.session = session
        self._tail.add_session(record.end - record.offset)
        yield self.session

    def _name(self, channel: Channel) -> None:
        for ours, (topic, schema) in CHANNELS.items():
            if topic == channel.topic:
                found = self._schemas.get(channel.schema_id, "nothing")
                if (found, channel.message_encoding) != (schema, "cdr"):
                    found = shortened(f"{channel.message_encoding} of {found}")
                    raise McapError(f"says that {topic} holds {found}, not cdr of {schema}")
                self._channels[channel.id] = ours
                self.foreign |= channel.id != ours
                return
        self.foreign = True
        self._channels.setdefault(channel.id, None)

    def _chunk(self, offset: int, chunk: Chunk) -> Iterator[Entry]:
        self.foreign = True
        if chunk.compression:
            compression = shortened(chunk.compression)
            raise McapError(f"is compressed by {compression}: `mcap decompress` makes a copy that can be read")
        # 0 where a program worked none out.
        if chunk.uncompressed_crc not in (0, crc32(chunk.data)) or chunk.uncompressed_size != len(chunk.data):
            self.broken = offset
        for record in inside(chunk.data, offset):
            yield from self.entries(record)
        self._indexed = True


class _Whole(ReadDataStream):
    """Reads as many bytes as are asked for, or none."""

    def read(self, length: int) -> bytes:
        data = super().read(length)
        if len(data) < length:
            raise EndOfFile
        return data


def parsed(kind: type[Any], content: bytes) -> tuple[Any, int]:
    """Return the content of a record as the library's `kind`, and how many bytes are left. Raises McapError."""
    stream = _Whole(BytesIO(content))
    try:
        return kind.read(stream), len(content) - stream.count
    except _UNREADABLE as wrong:
        reason = shortened(str(wrong)) or type(wrong).__name__
        raise McapError(f"is no {kind.__name__.lower()}: {reason}") from None


def _from_json(channel: int, text: bytes) -> LiveGrasp | Label | None:
    decoder = _DECODERS.get(channel)
    if decoder is None:
        return None
    try:
        entry = decoder(text)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as wrong:
        raise McapError(f"cannot be read: {shortened(str(wrong), _REASON)}") from None
    for name in entry.__struct_fields__:
        value = getattr(entry, name)
        if isinstance(value, int) and not _LEAST <= value <= _LARGEST:
            raise McapError(f"cannot be read: its {name!r} has more than 64 bits")
    return entry
