"""Lines of text with rows of numbers, as hobbyist boards print them: CSV, JSON, or `name:value` pairs.

    12,0,1,1023                          numbers in the order of the columns; also separated by ; tabs or blanks
    ms,thumb,index,flex                  a header: names of the columns of the lines that follow
    ms:12,thumb:0,flex:1023              names with their values, as the Arduino IDE's plotter reads them
    {"ms": 12, "thumb": 0, "flex": 1023} a JSON object, or a JSON list of numbers in the order of the columns

Any other line is a misfit. A value that is not a finite number, such as nan, is None; the rest of its line counts. So
is a text, such as a label, in a row whose number of columns is known.

The boards whose sketches thenar writes print lines in the style of NMEA 0183, with a checksum:

    $columns,thumb,index,flex*49         the names of the switches, then of the readings, about once a second
    $row,17,3400112,3,512*1B             sequence number, clock in microseconds, switches in hex, readings

The checksum is the XOR of all bytes between $ and *. The sequence number has 16 bits, the clock 32. Bit k of the hex
number, of a digit for every four switches, is switch k. A reading without a value is empty.
"""

import json
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import xor
from time import monotonic_ns
from typing import Any, NamedTuple

from .closing import Closing
from .errors import SettingError
from .names import LONGEST_SHOWN, shortened
from .senders import FirstSender
from .transports import Datagrams, Transport, line_port_fault, open_transport

# Long enough for two thousand columns of five digits.
LONGEST = 16_384
# Most rows: finite numbers with commas between.
_PLAIN = re.compile(r"-?\d{1,20}(?:\.\d{1,20})?(?:,-?\d{1,20}(?:\.\d{1,20})?)*", re.ASCII)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?")
_NO_NUMBER = re.compile(r"|[+-]?nan|[+-]?inf(inity)?|null|none|na|-", re.IGNORECASE)
_NAME = re.compile(r"[^\W\d][^,;:\t\"{}]*")
_DIGITS = 400
_CHECKED = re.compile(rb"\$([^$*]*)\*([0-9A-F]{2})")
_CHECKSUM = re.compile(rb"\*[0-9A-F]{2}$")
_COUNT, _READING = re.compile("[0-9]{1,10}"), re.compile("(-?[0-9]{1,10})?")
_SWITCHES = re.compile("[0-9A-F]*")
# The first of a board's sequence numbers, and of its clock's microseconds, that does not exist.
SEQUENCES, CLOCK_US = 1 << 16, 1 << 32


class Row(NamedTuple):
    """The content of one line: values, None where one is not a number; and names, None if only the order is known.

    time_s    the sender's clock, if it is outside the columns
    came_us   when it came, by the monotonic clock, if the transport says so; None: when it was read
    sequence  its number, from 0 to SEQUENCES - 1, if the sender counts its rows
    """

    names: tuple[str, ...] | None
    values: tuple[float | None, ...]
    time_s: float | None = None
    came_us: int | None = None
    sequence: int | None = None


class ColumnHeader(NamedTuple):
    """A line that names the columns of the lines that follow."""

    names: tuple[str, ...]


def checked(fields: Iterable[str]) -> bytes:
    """Return the line of a board with these fields, with its checksum and its end."""
    body = ",".join(fields).encode()
    return b"$%b*%02X\r\n" % (body, reduce(xor, body, 0))


def switches_field(closed: int, switches: int) -> str:
    """Return the field of a row for `switches` switches, of which those with a bit in `closed` are closed."""
    digits = -(-switches // 4)
    return f"{closed:0{digits}X}" if digits else ""


class Damaged(NamedTuple):
    """A line that a board did not print: its checksum or its form is wrong."""


def parsed(line: bytes, columns: int = 0) -> Row | ColumnHeader | Damaged | None:
    """Parse a line; None for a misfit. `columns` is the known number of columns; 0: unknown, and then a board's row is
    a misfit, too. The time of a board's row is that of its clock, which begins again after CLOCK_US.
    """
    if _is_of_board(line):
        return _of_board(line, columns)
    try:
        text = line.decode("utf-8")
    except UnicodeDecodeError:
        return None
    text = text.strip("\ufeff \r\t\0")
    if _PLAIN.fullmatch(text):
        return Row(None, tuple(map(float, text.split(","))))
    if text[:1] in ("{", "["):
        return _of_json(text)
    fields = _fields(text)
    if any(":" in field for field in fields):
        return _of_pairs(fields)
    # Words separated by blanks are a message.
    worded = len(fields) == 1 or len(text.split()) < len(fields) or not set(text).isdisjoint(",;\t")
    if worded and all(map(_NAME.fullmatch, fields)) and not all(map(_NO_NUMBER.fullmatch, fields)):
        return ColumnHeader(tuple(fields)) if _sound(fields) else None
    return _row(None, fields, columns)


def _is_of_board(line: bytes) -> bool:
    """Return whether a line has the beginning or the end of a board's: damage of one byte leaves one of them."""
    return line[:1] == b"$" or _CHECKSUM.search(line) is not None


def _of_board(line: bytes, columns: int) -> Row | ColumnHeader | Damaged | None:
    """Parse a line with a checksum, or what is left of one."""
    found = _CHECKED.fullmatch(line)
    if found is None or reduce(xor, found[1], 0) != int(found[2], 16):
        return Damaged()
    try:
        kind, *fields = found[1].decode("utf-8").split(",")
    except UnicodeDecodeError:
        return Damaged()
    if kind == "columns":
        sound = _sound(fields) and all(map(str.isprintable, fields))
        return ColumnHeader(tuple(fields)) if fields and sound else Damaged()
    return _of_board_row(fields, columns) if kind == "row" else None


def _of_board_row(fields: Sequence[str], columns: int) -> Row | Damaged | None:
    if len(fields) < 3 or not all(map(_COUNT.fullmatch, fields[:2])):
        return Damaged()
    sequence, clock_us, closed, readings = int(fields[0]), int(fields[1]), fields[2], fields[3:]
    sound = sequence < SEQUENCES and clock_us < CLOCK_US and _SWITCHES.fullmatch(closed)
    if not sound or not all(map(_READING.fullmatch, readings)):
        return Damaged()
    if not columns:
        return None
    switches, bits = columns - len(readings), int(closed or "0", 16)
    if switches < 0 or len(closed) != -(-switches // 4) or bits >> switches:
        return Damaged()
    values: list[float | None] = [float(bits >> switch & 1) for switch in range(switches)]
    values += [float(reading) if reading else None for reading in readings]
    return Row(None, tuple(values), clock_us / 1e6, sequence=sequence)


def _fields(text: str) -> list[str]:
    if ";" in text:  # where a comma is the decimal point
        return [field.strip().replace(",", ".") for field in text.split(";")]
    if "," in text or "\t" in text:
        return [field.strip().strip('"') for field in re.split("[,\t]", text)]
    return text.split()


def _of_pairs(fields: Sequence[str]) -> Row | None:
    pairs = [field.rpartition(":") for field in fields]
    return _row(tuple(name.strip() for name, _, _ in pairs), [value.strip() for _, _, value in pairs])


def _row(names: tuple[str, ...] | None, fields: Sequence[str], columns: int = 0) -> Row | None:
    """Return the row of these texts; None if one is neither a number nor a spelling of a missing value, unless there
    are as many as `columns`, and most are numbers.
    """
    known = sum(bool(_NUMBER.fullmatch(field) or _NO_NUMBER.fullmatch(field)) for field in fields)
    if not fields or (known < len(fields) and (len(fields) != columns or 2 * known <= columns)):
        return None
    if names is not None and not _sound(names):
        return None
    return Row(names, tuple(_number(field) for field in fields))


def _number(field: str) -> float | None:
    return finite(float(field)) if len(field) < _DIGITS and _NUMBER.fullmatch(field) else None


def finite(value: float) -> float | None:
    """Return a finite number unchanged, None for any other."""
    return value if math.isfinite(value) else None


def _of_json(text: str) -> Row | None:
    try:
        found: Any = json.loads(text)  # accepts NaN, which Python's json writes
    except (ValueError, RecursionError):
        return None
    names = tuple(found) if isinstance(found, dict) else None
    values = tuple(map(_of_value, found if names is None else found.values()))
    return Row(names, values) if values and (names is None or _sound(names)) else None


def _of_value(value: Any) -> float | None:
    if isinstance(value, str):
        return _number(value.strip())
    if not isinstance(value, int | float):  # a bool is an int
        return None
    try:
        return finite(float(value))
    except OverflowError:
        return None


def _sound(names: Sequence[str]) -> bool:
    """Return whether all columns have names, and all names differ."""
    return len(set(names)) == len(names) and "" not in names


@dataclass(slots=True)
class LineCounts:
    """Counts of lines since the driver was made.

    misfits   lines without a row: garbage, half a line, a message, names of columns that no row has
    damaged   lines of a board whose checksum or form is wrong
    overlong  lines longer than any row
    foreign   rows of another sender than the one that counts
    """

    misfits: int = 0
    damaged: int = 0
    overlong: int = 0
    foreign: int = 0


class LineParser:
    """Parses rows from chunks of bytes; odd is the last misfit, for display.

    Once a line with a right checksum has come, only such lines are rows: what is left of a damaged one may look like a
    row of numbers.

    columns  how many columns rows have until a header says otherwise; 0: unknown, and then a board's rows are left out
    """

    def __init__(self, columns: int = 0) -> None:
        self.counts, self.odd, self._columns = LineCounts(), "", columns
        self.begin()

    def begin(self) -> None:
        """Reset: an incomplete line, the names of the columns and the clock of a board are forgotten."""
        self._rest, self._dropping = b"", False
        self._names: tuple[str, ...] | None = None
        # A header that no row has followed yet, and the misfit before it: it may be a message.
        self._header: tuple[str, ...] = ()
        self._odd_before = ""
        self._checked = False
        self._clock_us: int | None = None

    def feed(self, chunk: bytes) -> list[Row]:
        """Return the rows whose lines `chunk` completes, with names if a header came before them."""
        rows = []
        for line in self._lines(chunk):
            found = self._of_board(line) if _is_of_board(line) else self._of_line(line)
            if found is not None:
                rows.append(found)
        return rows

    def _lines(self, chunk: bytes) -> list[bytes]:
        """Return the lines that `chunk` completes, without line ends and without empty lines.

        A line of more than LONGEST bytes is dropped and counted, so a stream without line ends cannot fill the memory.
        """
        pieces = chunk.replace(b"\r", b"\n").split(b"\n")
        pieces[0] = self._rest + pieces[0]
        self._rest = pieces.pop()
        if self._dropping and pieces:
            pieces, self._dropping = pieces[1:], False
        if self._dropping:
            self._rest = b""
        elif len(self._rest) > LONGEST:
            self._rest, self._dropping = b"", True
            self.counts.overlong += 1
        lines = [line.strip() for line in pieces if len(line) <= LONGEST]
        self.counts.overlong += len(pieces) - len(lines)
        return [line for line in lines if line]

    def _of_board(self, line: bytes) -> Row | None:
        found = parsed(line, self._known)
        if isinstance(found, Damaged):
            self.counts.damaged += 1
            return None
        self._checked = True
        if isinstance(found, Row):
            return found._replace(names=self._names, time_s=self._unwrapped_s(round((found.time_s or 0.0) * 1e6)))
        if isinstance(found, ColumnHeader):
            self._names = found.names
        elif not line.startswith(b"$row,"):
            self._take_misfit(line, None)
        return None

    def _unwrapped_s(self, clock_us: int) -> float:
        """Return the time of a board's clock, which has made less than half a turn since its last row."""
        last_us = clock_us if self._clock_us is None else self._clock_us
        self._clock_us = last_us + (clock_us - last_us + CLOCK_US // 2) % CLOCK_US - CLOCK_US // 2
        return self._clock_us / 1e6

    def _of_line(self, line: bytes) -> Row | None:
        found = None
        if not self._checked:
            found = parsed(line, self._known)
            if found is None and self._header:
                found = parsed(line, len(self._header))
        if isinstance(found, Row):
            return self._with_names(found)
        header = found if isinstance(found, ColumnHeader) else None
        if header is None or header.names != self._names:
            self._take_misfit(line, header)
        return None

    @property
    def _known(self) -> int:
        return len(self._names or ()) or self._columns

    def _take_misfit(self, line: bytes, header: ColumnHeader | None) -> None:
        """Count a line that is no row, or not yet the header of one; a word alone is a message."""
        self.counts.misfits += 1
        if header is not None and len(header.names) > 1:
            self._header, self._odd_before = header.names, self.odd
        self.odd = shortened(repr(line[: LONGEST_SHOWN + 1].decode("utf-8", "replace")))

    def _with_names(self, row: Row) -> Row:
        if row.names is not None:
            return row
        if len(self._header) == len(row.values):
            self._names, self.odd = self._header, self._odd_before
            self.counts.misfits -= 1
        self._header = ()
        named = self._names is not None and len(self._names) == len(row.values)
        return row._replace(names=self._names) if named else row


class RowReader(Closing, ABC):
    """A source of rows of numbers. It may be reopened after it was closed.

    odd       the last input that was not a row, for display; "" if there was none
    kind      what every column holds, "joint" or "" if the source does not say
    received  how many bytes came, rows or not, if the source counts them
    """

    odd, kind, received = "", "", 0

    @abstractmethod
    def open(self) -> None:
        """Open it. Raises DeviceError if a retry may help, SettingError if it does not."""

    @abstractmethod
    def read(self, timeout_s: float) -> Sequence[Row]:
        """Return the received rows; wait for some until the timeout. Raises DeviceError if the source is gone."""

    def counts(self) -> LineCounts:
        """Return the counts of input that was not a row."""
        return LineCounts()

    def other_sender(self) -> str:
        """Return a sentence on another sender whose rows do not count; "" if nobody else sends."""
        return ""


class LineReader(RowReader):
    """Rows of the lines from `port`, of `columns` columns; 0: unknown. The constructor does not open it."""

    def __init__(self, port: str, baud: int = 115_200, columns: int = 0) -> None:
        self.port, self._baud = port, baud
        self._line: Transport | None = None
        self._parser = LineParser(columns)
        self._senders = FirstSender()

    def open(self) -> None:
        """Open the port."""
        if reason := line_port_fault(self.port):
            raise SettingError(f"{shortened(repr(self.port))} {reason}")
        self._parser.begin()
        self._senders = FirstSender()
        self._line = open_transport(self.port, self._baud)

    def read(self, timeout_s: float) -> Sequence[Row]:
        """Return the received rows."""
        if isinstance(self._line, Datagrams):
            came = self._line.read(timeout_s)
            return () if came is None else self._of_datagram(*came)
        assert self._line is not None
        return self._rows(self._line.read(timeout_s))

    def _rows(self, data: bytes) -> list[Row]:
        self.received += len(data)
        rows = self._parser.feed(data)
        self.odd = self._parser.odd
        return rows

    def _of_datagram(self, data: bytes, sender: str, came_us: int) -> Sequence[Row]:
        """Return the rows of a datagram, each of which begins and ends lines; none if it is from another sender."""
        before = self._senders.current
        if not self._senders.admits(sender, came_us):
            self._parser.counts.foreign += data.strip().count(b"\n") + 1
            return ()
        if self._senders.current != before:
            self._parser.begin()
        return [row._replace(came_us=came_us) for row in self._rows(data + b"\n")]

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
