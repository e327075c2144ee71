"""From the records of a recording to what was recorded."""

from collections.abc import Callable, Iterator
from io import BytesIO
from struct import Struct, error
from typing import Any

import msgspec
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError as LibraryError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata, Schema

from ..live.frames import GloveFrame, SwitchFrame
from ..live.published import LiveGrasp
from .cdr import decode_bytes, decode_text
from .errors import McapError
from .frame_bytes import glove_frame, switch_frame
from .layout import CHANNELS, GLOVE, RECOGNITION, SWITCHES, TRIALS, Tail
from .records import RawRecord, inside
from .session import METADATA, Label, Session, from_metadata

Entry = Session | SwitchFrame | GloveFrame | LiveGrasp | Label

_MESSAGE = Struct("<HIQQ")
_DECODERS: dict[int, Callable[[bytes], LiveGrasp | Label]] = {
    RECOGNITION: msgspec.json.Decoder(LiveGrasp).decode,
    TRIALS: msgspec.json.Decoder(Label).decode,
}
# What the library's records answer bad bytes with.
_UNREADABLE = (LibraryError, error, UnicodeDecodeError, OverflowError)


class Decoder:
    """Takes the records of a data section one by one.

    session  whose messages come now; None before the first
    foreign  whether another program has packed, numbered or added something
    """

    def __init__(self, tail: Tail) -> None:
        """Messages and sessions are counted in `tail`."""
        self.session: Session | None = None
        self.foreign = False
        self._tail = tail
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, int | None] = {}

    def entries(self, record: RawRecord, content: bytes) -> Iterator[Entry]:
        """Yield what the record holds. Raises McapError, which goes on from "the record at byte 17 "."""
        if record.opcode == Opcode.MESSAGE:
            entry = self._message(content)
            if entry is not None:
                yield entry
        elif record.opcode == Opcode.METADATA:
            yield from self._sessions(parsed(Metadata, content), record.end - record.offset)
        elif record.opcode == Opcode.CHANNEL:
            self._name(parsed(Channel, content))
        elif record.opcode == Opcode.SCHEMA:
            schema = parsed(Schema, content)
            self._schemas[schema.id] = schema.name
        elif record.opcode == Opcode.CHUNK:
            yield from self._chunk(record.offset, parsed(Chunk, content))

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

    def _sessions(self, metadata: Metadata, length: int) -> Iterator[Session]:
        if metadata.name == METADATA:
            self.session = from_metadata(metadata.metadata)
            self._tail.add_session(length)
            yield self.session

    def _name(self, channel: Channel) -> None:
        for ours, (topic, schema) in CHANNELS.items():
            if topic == channel.topic:
                found = self._schemas.get(channel.schema_id, "nothing")
                if (found, channel.message_encoding) != (schema, "cdr"):
                    found = f"{channel.message_encoding} of {found}"
                    raise McapError(f"says that {topic} holds {found}, not cdr of {schema}")
                self._channels[channel.id] = ours
                self.foreign |= channel.id != ours
                return
        self.foreign = True
        self._channels.setdefault(channel.id, None)

    def _chunk(self, offset: int, chunk: Chunk) -> Iterator[Entry]:
        self.foreign = True
        if chunk.compression:
            raise McapError(f"is compressed by {chunk.compression}: `mcap decompress` makes a copy that can be read")
        for record in inside(chunk.data, offset):
            yield from self.entries(record, record.content or b"")


def parsed(kind: type[Any], content: bytes) -> Any:
    """Return the content of a record as the library's `kind`, which never reads beyond it. Raises McapError."""
    try:
        return kind.read(ReadDataStream(BytesIO(content)))
    except _UNREADABLE as wrong:
        raise McapError(f"is no {kind.__name__.lower()}: {wrong or type(wrong).__name__}") from None


def _from_json(channel: int, text: bytes) -> LiveGrasp | Label | None:
    decoder = _DECODERS.get(channel)
    if decoder is None:
        return None
    try:
        return decoder(text)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as wrong:
        raise McapError(f"cannot be read: {wrong}") from None
