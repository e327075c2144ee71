"""`Index`: the file positions of a recording's moments, so that it can be read from anywhere.

A recording is neither chunked nor indexed, because it must survive the death of its writer. So it is scanned once, most
of its messages undecoded; the scanned part can be read at once, during the scan. A truncated or damaged file can be
read up to the fault.
"""

from array import array
from bisect import bisect_right
from collections.abc import Iterator
from pathlib import Path

from ..errors import McapError
from .layout import GLOVE, GRASP, RECOGNITION, SWITCHES, TAXELS, Tail
from .mcap import Opcode
from .reader import Entry, EntryDecoder, Reader
from .records import End, RawRecord, RecordStream
from .session import Session

# Distance from one recorded position to the next.
_STEP_NS = 200_000_000
_LOG_NS = slice(6, 14)
_MANY = {SWITCHES, GLOVE, GRASP, TAXELS, RECOGNITION}


class Index:
    """The positions of a recording: 16 bytes for a fifth of a second of it.

    session   the first one
    first_us, last_us   the span scanned so far, in microseconds since 1970; None before the first message
    scanned, size       number of bytes scanned, and in total
    fault     why nothing more can be read; "" if there is no fault
    """

    def __init__(self, path: Path) -> None:
        """Raise McapError if `path` is not a recording of thenar, OSError as it comes."""
        self.path, self.session = path, Reader(path).session
        self._head, self._sessions = list[RawRecord](), list[tuple[int, RawRecord]]()
        self._times, self._offsets = array("q"), array("q")
        self.first_us: int | None = None
        self.last_us: int | None = None
        self.scanned, self.size, self.fault = 0, path.stat().st_size, ""

    def scan(self, every_us: int = 0) -> Iterator[tuple[int, Entry]]:
        """Yield entries with their moments in microseconds since 1970, and record their positions.

        One prediction per `every_us` is decoded, and no frame; with 0 all are.
        """
        decoder, due_ns, in_data = EntryDecoder(Tail()), 0, True
        stream = RecordStream(self.path)
        self.size = stream.size
        try:
            for record in stream:
                # The rest repeats known content, but shows whether the file is whole.
                in_data = in_data and record.opcode != Opcode.DATA_END
                if not in_data:
                    continue
                logged_ns = self._note(record)
                channel = decoder.channel(record.content or b"") if record.opcode == Opcode.MESSAGE else None
                if every_us and channel in _MANY:
                    if channel != RECOGNITION or logged_ns < due_ns:
                        self.scanned = record.end
                        continue
                    due_ns = logged_ns + 1000 * every_us
                for entry in _entries(decoder, record):
                    if isinstance(entry, Session):
                        self._sessions.append((record.offset, record))
                    yield _unix_us(entry, decoder), entry
                if not self._sessions:
                    self._head.append(record)
                self.scanned = record.end
        except McapError as wrong:
            self.fault = f"{self.path.name}: {wrong}"
            return
        end = stream.end
        if end is not None and not end.closed:
            self.fault = _cut(self.path.name, end)
        self.scanned = self.size

    def since(self, unix_us: int) -> Iterator[tuple[int, Entry]]:
        """Yield all entries from a fifth of a second or more before a moment on, preceded by their session, up to the
        end of the part scanned when this is called; from the first one on if the moment is before all.
        """
        at = max(bisect_right(self._times, 1000 * unix_us - _STEP_NS) - 1, 0)
        if not len(self._offsets):
            return
        offset, until = self._offsets[at], self.scanned
        decoder = EntryDecoder(Tail())
        for record in self._head:
            list(_entries(decoder, record))
        (session,) = [record for place, record in self._sessions if place <= offset][-1:]
        for entry in _entries(decoder, session):
            yield _unix_us(entry, decoder), entry
        for record in RecordStream(self.path).since(offset):
            if record.offset >= until or record.opcode == Opcode.DATA_END:
                return
            for entry in _entries(decoder, record):
                yield _unix_us(entry, decoder), entry

    def _note(self, record: RawRecord) -> int:
        """Record the position of a message, if the newest is far enough back; return its time."""
        if record.opcode != Opcode.MESSAGE or record.content is None or not self._sessions:
            return 0
        logged_ns = min(int.from_bytes(record.content[_LOG_NS], "little"), 2**62)
        if self.first_us is None:
            self.first_us = logged_ns // 1000
        self.last_us = max(self.last_us or 0, logged_ns // 1000)
        if not self._times or logged_ns >= self._times[-1] + _STEP_NS:
            self._times.append(logged_ns)
            self._offsets.append(record.offset)
        return logged_ns


def _entries(decoder: EntryDecoder, record: RawRecord) -> Iterator[Entry]:
    try:
        yield from decoder.entries(record)
    except McapError as wrong:
        raise McapError(f"the record at byte {record.offset} {wrong}, and nothing behind it is read") from None


def _unix_us(entry: Entry, decoder: EntryDecoder) -> int:
    """Return the time of an entry, in microseconds since 1970."""
    clock_us = decoder.session.clock_ns // 1000 if decoder.session is not None else 0
    return clock_us if isinstance(entry, Session) else clock_us + entry.time_us


def _cut(name: str, end: End) -> str:
    return f"{name} is whole up to byte {end.whole} of {end.size}, the rest was left out: {end.reason}"
