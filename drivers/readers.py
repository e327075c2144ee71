"""The reader of rows from a port, in lines or in binary frames."""

from collections.abc import Sequence
from time import monotonic_ns

from .ble import BleLine
from .errors import SettingError
from .frames import FrameParser
from .lines import LineCounts, LineParser, Row, RowReader
from .names import shortened
from .senders import FirstSender
from .transports import Datagrams, Transport, line_port_fault, open_transport

# If none of the first notifications by Bluetooth has a line end, each of them is a line: this number of them.
_UNENDED = 16
# How many of the bytes that come are kept, if any are.
_KEPT = 1 << 20


class LineReader(RowReader):
    """Rows of the lines from `port`, of `columns` columns (0: unknown), or of its frames by a pattern.

    The constructor opens nothing.

    chunks  None; or, if set to a list, the first chunks of bytes that came, and when, by the monotonic clock
    """

    def __init__(self, port: str, baud: int = 115_200, columns: int = 0, frame: str | None = None) -> None:
        self.port, self._baud = port, baud
        self._line: Transport | None = None
        self._parser = LineParser(columns) if frame is None else FrameParser(frame)
        self._senders = FirstSender()
        self._unended: int | None = None
        self.chunks: list[tuple[int, bytes]] | None = None

    def open(self) -> None:
        """Open the port."""
        if reason := line_port_fault(self.port):
            raise SettingError(f"{shortened(repr(self.port))} {reason}")
        self._parser.begin()
        self._senders = FirstSender()
        self._line = open_transport(self.port, self._baud)
        by_notification = isinstance(self._line, BleLine) and isinstance(self._parser, LineParser)
        self._unended = (self._unended or 0) if by_notification else None

    def read(self, timeout_s: float) -> Sequence[Row]:
        """Return the received rows."""
        if isinstance(self._line, Datagrams):
            came = self._line.read(timeout_s)
            return () if came is None else self._of_datagram(*came)
        assert self._line is not None
        return self._rows(self._line.read(timeout_s))

    def _rows(self, data: bytes, end: bytes = b"") -> list[Row]:
        self.received += len(data)
        if self.chunks is not None and self.received <= _KEPT:
            self.chunks.append((monotonic_ns() // 1000, data))
        if self._unended is not None and data:
            end = self._end(data)
        rows = self._parser.feed(data + end)
        self.odd = self._parser.odd
        return rows

    def _end(self, data: bytes) -> bytes:
        """Return the line end that a notification by Bluetooth lacks, if it is a line."""
        if b"\n" in data or b"\r" in data:
            self._unended = None
        elif (self._unended or 0) < _UNENDED:
            self._unended = (self._unended or 0) + 1
            if self._unended == _UNENDED:
                self._parser.begin()
        return b"\n" if self._unended == _UNENDED else b""

    def _of_datagram(self, data: bytes, sender: str, came_us: int) -> Sequence[Row]:
        """Return the rows of a datagram, each of which begins and ends lines; none if it is from another sender."""
        before = self._senders.current
        if not self._senders.admits(sender, came_us):
            self._parser.counts.foreign += data.strip().count(b"\n") + 1
            return ()
        if self._senders.current != before:
            self._parser.begin()
        return [row._replace(came_us=came_us) for row in self._rows(data, b"\n" * isinstance(self._parser, LineParser))]

    def other_sender(self) -> str:
        """Return a sentence on another sender of datagrams."""
        other = self._senders.other(monotonic_ns() // 1000)
        if other is None:
            return ""
        return f"{other} sends, too, and its lines are left out: those of {self._senders.current} count; stop it"

    def counts(self) -> LineCounts:
        """Return the counts of input that was not a row."""
        return self._parser.counts

    def close(self) -> None:
        """Close the port."""
        if self._line is not None:
            self._line.close()
            self._line = None
