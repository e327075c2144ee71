"""A recording read back: sessions, frames, recognitions and labels in the order in which they were written."""

from collections.abc import Iterator
from pathlib import Path
from struct import pack

from mcap.opcode import Opcode
from mcap.records import DataEnd

from .decoding import Decoder, Entry, parsed
from .errors import McapError
from .layout import MAGIC, Tail
from .records import End, RawRecord, RecordStream
from .session import Session


class Reader:
    """Iterates once over the entries of a recording, up to the last whole record of a file that was cut.

    session   whose entries come next; the first is known at once
    tail      what has been read of the data section, behind which a Recorder can go on
    end       how the file ends; None before that is reached
    altered   whether the checksum of a file that was closed does not match: some byte of it is not as it was written
    foreign   whether another program has packed or added something, so that no Recorder may go on
    """

    def __init__(self, path: Path) -> None:
        """Raises McapError if `path` is no recording of thenar's, OSError as it comes."""
        self.path = path
        self.tail = Tail()
        self.altered = False
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
    def foreign(self) -> bool:
        """Whether another program has packed or added something."""
        return self._decoder.foreign

    def __iter__(self) -> Iterator[Entry]:
        yield self.session
        for entry in self._entries:
            if isinstance(entry, Session):
                self.session = entry
            yield entry

    def _read(self) -> Iterator[Entry]:
        self.tail.add_bytes(MAGIC)
        for record in self._records:
            try:
                entries = list(self._taken(record))
            except McapError as wrong:
                raise McapError(f"{self.path.name}: the record at byte {record.offset} {wrong}") from None
            yield from entries

    def _taken(self, record: RawRecord) -> Iterator[Entry]:
        """Yield what a record of the data section holds; what follows that section repeats what is known."""
        content = record.content
        if not self._in_data:
            return
        if content is None:
            self._decoder.foreign = True
        elif record.opcode == Opcode.DATA_END:
            self._in_data = False
            # 0 where a program worked none out.
            checksum = parsed(DataEnd, content).data_section_crc
            self.altered = checksum not in (0, self.tail.crc) and not self.foreign
        else:
            self.tail.add_bytes(pack("<BQ", record.opcode, len(content)) + content)
            yield from self._decoder.entries(record, content)
