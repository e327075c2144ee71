"""Read a recording back: sessions, frames, predictions and labels in the order in which they were written."""

from collections.abc import Callable, Iterator
from pathlib import Path
from struct import Struct, pack
from typing import Any
from zlib import crc32

import msgspec

from ..errors import FormatError
from ..frames import GloveFrame, SwitchFrame
from ..names import SHOWN, list_names, shortened
from ..published import LiveGrasp
from . import layout
from .layout import Tail
from .mcap import End, Opcode, RawRecord, RecordStream, decode, kind_of
from .session import METADATA, Label, Session, from_metadata

Entry = Session | SwitchFrame | GloveFrame | LiveGrasp | Label

_MESSAGE = Struct("<HIQQ")
_DECODERS: dict[int, Callable[[bytes], LiveGrasp | Label]] = {
    layout.RECOGNITION: msgspec.json.Decoder(LiveGrasp).decode,
    layout.TRIALS: msgspec.json.Decoder(Label).decode,
}
# Limits that no valid time or count of a recording exceeds.
_LEAST, _LARGEST = -(2**63), 2**63 - 1
_REASON = 200
# The most records of a file that are no messages: a recording has a few dozen.
OTHER_RECORDS = 100_000
# The records that describe others, which a recording has.
_DESCRIBING = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA)
# All of a footer except its checksum, which covers the rest.
_CHECKED_FOOTER = 16
# Maximum memory for a recording beyond its own size, in bytes.
_LARGEST_MADE = 20_000_000


class Oddity(msgspec.Struct, frozen=True):
    """One kind of oddity of a file that could still be read: its count, and a sentence; of a table also the first rows,
    as the user counts them, and the columns.
    """

    kind: str
    count: int
    message: str
    rows: tuple[int, ...] = ()
    columns: tuple[str, ...] = ()


class Reader:
    """Iterates once over the entries of a recording, up to the last whole record of a truncated file.

    session   the session of the next entries; the first is known at once
    tail      the data section read so far, after which a Recorder can continue
    end       how the file ends; None before the end is reached
    altered   whether a checksum of a closed file does not match, or is missing although thenar writes it
    foreign   whether another program has added something, so that no Recorder may continue
    """

    def __init__(self, path: Path) -> None:
        """Raise FormatError if `path` is not a recording of thenar, OSError as it comes."""
        self.path = path
        self.tail = Tail()
        self._wrong: list[str] = []
        self._in_data = True
        self._records = RecordStream(path)
        self._session: Session | None = None
        self._ours = self.foreign = False
        # Records, or parts of them, that were passed over: their number, and the first few with their places.
        self._skipped, self._first_skipped = 0, list[str]()
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, int | None] = {}
        self._others = 0
        self._codes: tuple[int | None, tuple[int | None, ...]] = None, ()
        self._entries = self._read()
        if not isinstance(next(self._entries, None), Session):
            raise FormatError(f"{path.name} holds no session of thenar: cut at its beginning, or from another program")

    @property
    def session(self) -> Session:
        """The session of the next entries."""
        assert self._session is not None
        return self._session

    @property
    def end(self) -> End | None:
        """How the file ends; None before the end is reached."""
        return self._records.end

    @property
    def altered(self) -> bool:
        """Whether some byte is known to have changed since it was written."""
        return bool(self._wrong)

    def __iter__(self) -> Iterator[Entry]:
        yield self.session
        yield from self._entries

    def faults(self) -> Iterator[Oddity]:
        """Yield the faults of the file, once its end is reached."""
        name, end, skipped = self.path.name, self.end, self._skipped
        if end is not None and (end.whole < end.size or not (end.closed or self._in_data)):
            message = f"{name} is whole up to byte {end.whole} of {end.size}, the rest was left out: {end.reason}"
            yield Oddity("cut recordings", 1, message)
        if self._wrong:
            yield Oddity("altered recordings", 1, f"{name} is altered: {'; '.join(self._wrong)}")
        if skipped:
            message = f"{name} holds records that thenar skips: {list_names(self._first_skipped, skipped)}"
            yield Oddity("records passed over", skipped, message)

    def _read(self) -> Iterator[Entry]:
        """Yield the entries of the data section; later sections repeat known content."""
        for record in self._records:
            try:
                if record.opcode == Opcode.FOOTER:
                    self._end_summary(record)
                elif not self._in_data:
                    self._count(record)
                elif record.opcode == Opcode.DATA_END:
                    self._end_data(record)
                else:
                    self.tail.size, self.tail.crc = record.end, record.after
                    yield from self._decoded(record)
            except FormatError as wrong:
                raise FormatError(f"{self.path.name}: the record at byte {record.offset} {wrong}") from None

    def _decoded(self, record: RawRecord) -> Iterator[Entry]:
        """Yield the record's entries. Raises FormatError, whose text continues "the record at byte 17 "."""
        self._count(record)
        content = record.content
        if record.opcode == Opcode.CHUNK:
            raise FormatError(
                "is a chunk, which thenar's recordings do not have: another program packed them; read the original, or "
                "save other programs' data as CSV"
            )
        if content is not None and record.opcode == Opcode.MESSAGE:
            entry = self._message(content)
            if entry is not None:
                yield entry
        elif content is not None and record.opcode in _DESCRIBING:
            yield from self._described(record, content)
        else:
            self.foreign = True
            self._skip(kind_of(record.opcode), record.offset)

    def _skip(self, what: str, offset: int) -> None:
        self._skipped += 1
        if len(self._first_skipped) < SHOWN:
            self._first_skipped.append(f"{what} at byte {offset}")

    def _count(self, record: RawRecord) -> None:
        """Count a record that holds no measurements. Raises FormatError if there are too many to read in seconds."""
        self._others += record.opcode != Opcode.MESSAGE
        if self._others > OTHER_RECORDS:
            raise FormatError(
                f"is one of more than {OTHER_RECORDS} that hold no measurements, the most that are read: the file is "
                "damaged, or not a recording of thenar"
            )

    def _described(self, record: RawRecord, content: bytes) -> Iterator[Session]:
        """Take a record that describes others."""
        if record.opcode == Opcode.HEADER:
            _, library = self._parsed(Opcode.HEADER, record, content)
            self._ours = library.startswith(layout.WRITER)
        elif record.opcode == Opcode.METADATA:
            yield from self._sessions(record, *self._parsed(Opcode.METADATA, record, content))
        elif record.opcode == Opcode.CHANNEL:
            self._name(*self._parsed(Opcode.CHANNEL, record, content))
        else:
            number, name, *_ = self._parsed(Opcode.SCHEMA, record, content)
            self._schemas[number] = name

    def _parsed(self, opcode: Opcode, record: RawRecord, content: bytes) -> list[Any]:
        """Return the fields of a record. Raises FormatError."""
        found, rest = _fields(opcode, content)
        if rest:
            # MCAP lets later versions add fields. This version of the record has none.
            self.foreign = True
            self._skip(f"{rest} bytes more than a {kind_of(opcode)} has", record.end - rest)
        return found

    def _message(self, content: bytes) -> Entry | None:
        if len(content) < _MESSAGE.size:
            raise FormatError("is a truncated message")
        number, _, logged_ns, published_ns = _MESSAGE.unpack_from(content)
        if number not in self._channels:
            raise FormatError(f"is a message of channel {number}, which the file does not name")
        channel, session = self._channels[number], self._session
        if channel is None:
            return None
        if session is None:
            raise FormatError("is a message before any session of thenar")
        self.tail.add_message(channel, logged_ns)
        data = content[_MESSAGE.size :]
        time_us = (published_ns - session.clock_ns) // 1000
        if channel == layout.TAXELS:
            self._codes = time_us, layout.taxel_codes(layout.decode_bytes(data), len(session.taxels))
            return None
        if channel == layout.SWITCHES:
            frame = layout.switch_frame(time_us, layout.decode_bytes(data), len(session.switches), len(session.sensors))
            coded_us, codes = self._codes
            return frame if coded_us != time_us else msgspec.structs.replace(frame, taxels=codes)
        if channel == layout.GLOVE:
            return layout.glove_frame(time_us, layout.decode_bytes(data), len(session.sensors))
        return _from_json(channel, layout.decode_text(data))

    def _sessions(self, record: RawRecord, name: str, texts: dict[str, str]) -> Iterator[Session]:
        if name != METADATA:
            self.foreign = True
            self._skip(f"metadata {shortened(repr(name))}", record.offset)
            return
        before, session = self._session, from_metadata(texts)
        if before is not None and _wired(before) != _wired(session):
            raise FormatError(
                "begins a session of another glove than the one before: its switches, taxels or sensors differ"
            )
        self._session, self._codes = session, (None, ())
        self.tail.add_session(record.end - record.offset)
        yield session

    def _name(self, number: int, schema: int, topic: str, encoding: str, _metadata: dict[str, str]) -> None:
        for ours, (known, name) in layout.CHANNELS.items():
            if topic == known:
                found = self._schemas.get(schema, "nothing")
                if (found, encoding) != (name, "cdr"):
                    found = shortened(f"{encoding} of {found}")
                    raise FormatError(f"says that {topic} holds {found}, not cdr of {name}")
                self._channels[number] = ours
                self.foreign |= number != ours
                return
        self.foreign = True
        self._channels.setdefault(number, None)

    def _end_data(self, record: RawRecord) -> None:
        self._in_data = False
        (crc,), rest = _fields(Opcode.DATA_END, record.content or b"")
        self._check("its data", crc, record.before, rest)

    def _end_summary(self, record: RawRecord) -> None:
        content = record.content or b""
        (_, _, crc), rest = _fields(Opcode.FOOTER, content)
        checked = pack("<BQ", record.opcode, len(content)) + content[:_CHECKED_FOOTER]
        self._check("its summary", crc, crc32(checked, record.before), rest)
        if self._in_data:
            self._wrong.append("the end of its data is missing, and their checksum with it")

    def _check(self, what: str, said: int, found: int, rest: int) -> None:
        """Note a checksum of `what` that does not match. In files of other programs 0 means none."""
        if said != found and (said or self._ours):
            self._wrong.append(f"the checksum of {what} does not match")
        if rest:
            self._wrong.append(f"{rest} bytes follow the checksum of {what}")


def _wired(session: Session) -> tuple[tuple[str, ...], ...]:
    return session.switches, session.taxels, session.sensors


def _fields(opcode: Opcode, content: bytes) -> tuple[list[Any], int]:
    """Return the fields of a record, and the number of bytes left. Raises FormatError."""
    try:
        return decode(opcode, content)
    except ValueError as wrong:
        raise FormatError(f"is not a valid {kind_of(opcode)}: {shortened(str(wrong))}") from None


def _from_json(channel: int, text: bytes) -> LiveGrasp | Label | None:
    decoder = _DECODERS.get(channel)
    if decoder is None:
        return None
    try:
        entry = decoder(text)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as wrong:
        raise FormatError(f"cannot be read: {shortened(str(wrong), _REASON)}") from None
    for name in entry.__struct_fields__:
        value = getattr(entry, name)
        if isinstance(value, int) and not _LEAST <= value <= _LARGEST:
            raise FormatError(f"cannot be read: its {name!r} has more than 64 bits")
    return entry


def check_made(what: str, made: int, size: int) -> None:
    """Raise FormatError if `made` bytes of `what` are to be allocated for recordings of `size` bytes.

    Every row was captured from frames of its length, so a valid recording is at least as long as its rows.
    """
    if made > size + _LARGEST_MADE:
        raise FormatError(
            f"{what} would take {made >> 20} MiB, more than {size} bytes can have recorded: it is damaged"
        )
