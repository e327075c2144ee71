"""A recording read back: sessions, frames, recognitions and labels in the order in which they were written."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from struct import pack
from zlib import crc32

from mcap.opcode import Opcode
from mcap.records import DataEnd, Footer

from ..names import list_names
from .decoding import Decoder, Entry, parsed
from .errors import McapError
from .layout import Tail
from .records import End, RawRecord, RecordStream
from .session import Session

# All of a footer but its checksum, which covers the rest.
_CHECKED_FOOTER = 16
# The most that is made of a recording beyond its own size, in bytes.
_LARGEST_MADE = 20_000_000


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a file that could be read nevertheless: its kind, how often it occurs, a sentence for people."""

    kind: str
    count: int
    message: str


class Reader:
    """Iterates once over the entries of a recording, up to the last whole record of a file that was cut.

    session   whose entries come next; the first is known at once
    tail      what has been read of the data section, behind which a Recorder can go on
    end       how the file ends; None before that is reached
    altered   whether some checksum of a file that was closed does not match, or is missing where thenar writes one
    foreign   whether another program has packed or added something, so that no Recorder may go on
    """

    def __init__(self, path: Path) -> None:
        """Raises McapError if `path` is no recording of thenar's, OSError as it comes."""
        self.path = path
        self.tail = Tail()
        self._wrong: list[str] = []
        self._in_data = True
        self._records = RecordStream(path)
        self._decoder = Decoder(self.tail)
        self._entries = self._read()
        first = next(self._entries, None)
        if not isinstance(first, Session):
            raise McapError(f"{path.name} holds no session of thenar: cut at its beginning, or of another program")
        self.session = first

    @property
    def end(self) -> End | None:
        """How the file ends; None before that is reached."""
        return self._records.end

    @property
    def altered(self) -> bool:
        """Whether some byte is known not to be as it was written."""
        return bool(self._wrong) or self._decoder.broken is not None

    @property
    def foreign(self) -> bool:
        """Whether another program has packed or added something."""
        return self._decoder.foreign

    def __iter__(self) -> Iterator[Entry]:
        yield self.session
        for entry in self._entries:
            if isinstance(entry, Session):
                self.session = entry
            yield entry

    def faults(self) -> Iterator[Fault]:
        """Yield the faults of the file, once its end is reached."""
        name, end, passed = self.path.name, self.end, self._decoder.passed
        if end is not None and (end.whole < end.size or not (end.closed or self._in_data)):
            message = f"{name} is whole up to byte {end.whole} of {end.size}, the rest was left out: {end.reason}"
            yield Fault("cut recordings", 1, message)
        wrong = list(self._wrong)
        if self._decoder.broken is not None:
            wrong.append(f"the chunk at byte {self._decoder.broken} does not match its checksum")
        if wrong:
            yield Fault("altered recordings", 1, f"{name} is altered: {'; '.join(wrong)}")
        if passed.count:
            message = f"{name} holds what thenar does not read, passed over: {list_names(passed.first, passed.count)}"
            yield Fault("records passed over", passed.count, message)

    def _read(self) -> Iterator[Entry]:
        for record in self._records:
            try:
                yield from self._taken(record)
            except McapError as wrong:
                raise McapError(f"{self.path.name}: the record at byte {record.offset} {wrong}") from None

    def _taken(self, record: RawRecord) -> Iterator[Entry]:
        """Yield what a record of the data section holds; what follows that section repeats what is known."""
        if record.opcode == Opcode.FOOTER:
            self._end_summary(record)
        elif not self._in_data:
            return
        elif record.opcode == Opcode.DATA_END:
            self._end_data(record)
        else:
            self.tail.size, self.tail.crc = record.end, record.after
            yield from self._decoder.entries(record)

    def _end_data(self, record: RawRecord) -> None:
        self._in_data = False
        self._records.begin_section()
        found, rest = parsed(DataEnd, record.content or b"")
        self._check("its data", found.data_section_crc, record.before, rest)

    def _end_summary(self, record: RawRecord) -> None:
        content = record.content or b""
        found, rest = parsed(Footer, content)
        checked = pack("<BQ", record.opcode, len(content)) + content[:_CHECKED_FOOTER]
        self._check("its summary", found.summary_crc, crc32(checked, record.before), rest)
        if self._in_data:
            self._wrong.append("the end of its data is missing, and their checksum with it")

    def _check(self, what: str, said: int, found: int, rest: int) -> None:
        """Note where the checksum of `what` does not match. Of other programs 0 means that there is none."""
        if said != found and (said or self._decoder.ours):
            self._wrong.append(f"the checksum of {what} does not match")
        if rest:
            self._wrong.append(f"{rest} bytes follow the checksum of {what}")


def check_made(what: str, made: int, size: int) -> None:
    """Raise McapError if something of `made` bytes would be made of recordings of `size` bytes.

    Every row was captured from frames of its length, so a sound recording is at least as long as its rows.
    """
    if made > size + _LARGEST_MADE:
        raise McapError(f"{what} would fill {made >> 20} MiB, more than {size} bytes can have recorded: it is damaged")
