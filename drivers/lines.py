"""Lines of text with rows of numbers, as hobbyist boards print them: CSV, JSON, or `name:value` pairs.

    12,0,1,1023                          numbers in the order of the columns; also separated by ; tabs or blanks
    ms,thumb,index,flex                  a header: names of the columns of the lines that follow
    ms:12,thumb:0,flex:1023              names with their values, as the Arduino IDE's plotter reads them
    {"ms": 12, "pads": [7, 9]}           JSON; what is nested has names with dots: pads.0, pads.1
    A2048B1990C12D0E7F2047G2047(AB)300H  OpenGloves, alpha encoding: letters of flexion, splay, joystick and buttons
    2048&1990&12&0&7&2047&2047&0&0&1&0&0&0    OpenGloves, legacy encoding; both get the names in OPENGLOVES

A row may be framed, <1,2,3> or $1,2,3*CS with a checksum, and have a word in front: "DATA: 1,2,3". A number may be
hexadecimal (0x3F), true or false, an ISO 8601 time (seconds since 1970, or since midnight), or have a unit behind it
(12.5deg). Any other line is a misfit. A value that is not a finite number, such as nan, is None; the rest of its line
counts. So is a text, such as a label, in a row whose number of columns is known.

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
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import reduce
from operator import xor
from typing import Any, NamedTuple

from .closing import Closing
from .names import LONGEST_SHOWN, shortened

FINGERS = ("thumb", "index", "middle", "ring", "little")
# Long enough for two thousand columns of five digits.
LONGEST = 16_384
# Most rows: finite numbers with commas between.
_PLAIN = re.compile(r"-?\d{1,20}(?:\.\d{1,20})?(?:,-?\d{1,20}(?:\.\d{1,20})?)*", re.ASCII)
_TIME = r"(?:\d{4}-\d\d-\d\d[T ])?\d\d:\d\d:\d\d(?:\.\d{1,9})?(?:Z|[+-]\d\d:?\d\d)?"
# One letter that is a hexadecimal digit, too, is no unit.
_UNIT = (
    r"%|°[CF]?|deg(?:rees|[CF])?|rad|(?:deg|rad|m)/s(?:\^?2|²)?|dps|rpm|mA|m?bar"
    r"|[munkMµμ]?(?:V|N|g|Pa|s|m|Hz|Ohms?|Ω)"
)
# A value: the group that matches says how it is written.
_VALUE = re.compile(
    rf"(?P<number>[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{{1,3}})?)(?: ?(?:{_UNIT}))?"
    rf"|(?P<hex>0[xX][0-9A-Fa-f]{{1,12}})"
    rf"|(?P<truth>(?i:true|false))|(?P<time>{_TIME})|(?P<none>(?i:|[+-]?nan|[+-]?inf(?:inity)?|null|none|na|-))"
)
_NAME = re.compile(r"[^\W\d][^,;:\t\"{}]*")
_WORD = re.compile(r"[^\W\d]\w*")
_PAIR = re.compile(rf"(.*?):({_TIME}|[^:]*)")
_WORD_OF_JSON = re.compile(r"\A[^\W\d]\w*\s*[:=]\s*(?=[{\[])")
_CHECKED = re.compile(rb"\$([^$*]*)\*([0-9A-Fa-f]{2})")
_CHECKSUM = re.compile(rb"\*[0-9A-Fa-f]{2}$")
_COUNT, _READING = re.compile("[0-9]{1,10}"), re.compile("(-?[0-9]{1,10})?")
_SWITCHES = re.compile("[0-9A-F]*")
_OF_BOARD = (b"row", b"columns")
# OpenGloves: the letters, and their columns. Those of the buttons have no number: they come only while one is pressed.
_BUTTONS = "HIJKLMNO"
_LETTERS = (*"ABCDEFGP", *(f"({letter}B)" for letter in "ABCDE"), *_BUTTONS)
OPENGLOVES = (
    *(f"flex_{finger}" for finger in FINGERS),
    *("joystick_x", "joystick_y", "trigger"),
    *(f"splay_{finger}" for finger in FINGERS),
    *(f"button_{name}" for name in ("joystick", "trigger", "a", "b", "grab", "pinch", "menu", "calibrate")),
)
_COLUMN = dict(zip(_LETTERS, OPENGLOVES, strict=True))
_ALPHA, _LETTER = re.compile(r"(?:(?:[A-GP]|\([A-E]B\))\d{1,5}|[H-O])+"), re.compile(r"([A-P]|\(.B\))(\d*)")
_LEGACY = re.compile(r"\d{1,5}(?:&\d{1,5}){12}")
# The first of a board's sequence numbers, and of its clock's microseconds, that does not exist.
SEQUENCES, CLOCK_US = 1 << 16, 1 << 32
# The units of senders' clocks, in microseconds.
UNITS_US = {"s": 1e6, "ms": 1e3, "us": 1.0}


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
    if _is_checked(line):
        found = _CHECKED.fullmatch(line)
        if found is None or reduce(xor, found[1], 0) != int(found[2], 16):
            return Damaged()
        line = found[1]
        if line.partition(b",")[0] in _OF_BOARD:
            return _of_board(line, columns)
    try:
        text = line.decode("utf-8").strip("\ufeff \r\t\0")
    except UnicodeDecodeError:
        return None
    if _PLAIN.fullmatch(text):
        return Row(None, tuple(map(float, text.split(","))))
    return _of_text(text[1:-1].strip() if text[:1] == "<" and text[-1:] == ">" else text, columns)


def _of_board(line: bytes, columns: int) -> Row | ColumnHeader | Damaged | None:
    """Parse the content of a board's line."""
    try:
        kind, *fields = line.decode("utf-8").split(",")
    except UnicodeDecodeError:
        return Damaged()
    if kind == "columns":
        sound = _sound(fields) and all(map(str.isprintable, fields))
        return ColumnHeader(tuple(fields)) if fields and sound else Damaged()
    if len(fields) < 3 or not all(map(_COUNT.fullmatch, fields[:2])):
        return Damaged()
    sequence, clock_us, closed, readings = int(fields[0]), int(fields[1]), fields[2], fields[3:]
    sound = sequence < SEQUENCES and clock_us < CLOCK_US and _SWITCHES.fullmatch(closed) is not None
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


def _of_text(text: str, columns: int) -> Row | ColumnHeader | None:
    """Parse a line that has no checksum and is not of a board."""
    if text[-1:] in ("}", "]"):
        text = _WORD_OF_JSON.sub("", text)
    if text[:1] in ("{", "["):
        return _of_json(text)
    if _ALPHA.fullmatch(text) or _LEGACY.fullmatch(text):
        return _of_opengloves(text)
    return _of_fields(_fields(text), columns, text)


def _is_checked(line: bytes) -> bool:
    """Return whether a line begins or ends like one with a checksum: damage of one byte leaves one of the two."""
    return line[:1] == b"$" or _CHECKSUM.search(line) is not None


def _fields(text: str) -> list[str]:
    text = ":".join(part.strip() for part in re.split("[:=]", text))
    if ";" in text:  # where a comma is the decimal point
        return [field.strip().replace(",", ".") for field in text.split(";")]
    if not set(text).isdisjoint(",\t&"):
        return [field.strip().strip('"') for field in re.split("[,\t&]", text)]
    return text.split()


def _of_fields(fields: Sequence[str], columns: int, text: str) -> Row | ColumnHeader | None:
    """Parse the fields of a line: names with values, names of columns, or values, maybe with a word in front."""
    pairs = [None if _VALUE.fullmatch(field) else _PAIR.fullmatch(field) for field in fields]
    if fields and all(pairs):
        return _row([pair[2] for pair in pairs if pair], tuple(pair[1] for pair in pairs if pair))
    # Words separated by blanks are a message.
    worded = len(fields) == 1 or len(text.split()) < len(fields) or not set(text).isdisjoint(",;\t")
    if worded and all(map(_NAME.fullmatch, fields)) and not all(map(_VALUE.fullmatch, fields)):
        return ColumnHeader(tuple(fields)) if _sound(fields) else None
    row = _row(fields, None, columns)
    if row is not None or not _WORD.match(text):
        return row
    word, sign, value = fields[0].partition(":")
    row = _row([value, *fields[1:]] if sign else fields[1:])
    return row if row and _WORD.fullmatch(word) and len(row.values) > 1 and None not in row.values else None


def _row(fields: Sequence[str], names: tuple[str, ...] | None = None, columns: int = 0) -> Row | None:
    """Return the row of these texts; None if one is neither a number nor a spelling of a missing value, unless there
    are as many as `columns`, and most are numbers.
    """
    found = list(map(_VALUE.fullmatch, fields))
    known = len(fields) - found.count(None)
    if not fields or (known < len(fields) and (len(fields) != columns or 2 * known <= columns)):
        return None
    return Row(names, tuple(map(_number, found))) if names is None or _sound(names) else None


def _number(found: re.Match[str] | None) -> float | None:
    """Return the number of a text that matches _VALUE; None if it is none, or none that is finite."""
    if found is None or (kind := found.lastgroup) == "none":
        return None
    if kind == "number":
        return finite(float(found["number"]))
    field = found[0]
    if kind == "hex":
        return float(int(field, 16))
    if kind == "truth":
        return float(field.lower() == "true")
    try:
        time = datetime.fromisoformat(field if field[4] == "-" else f"1970-01-01T{field}")
    except ValueError:  # there is no such day or hour
        return None
    return time.replace(tzinfo=time.tzinfo or UTC).timestamp()


def finite(value: float) -> float | None:
    """Return a finite number unchanged, None for any other."""
    return value if math.isfinite(value) else None


def _of_opengloves(text: str) -> Row | None:
    if "&" in text:
        pressed = (_COLUMN[letter] for letter in _BUTTONS[:6])
        return Row((*OPENGLOVES[:7], *pressed), tuple(map(float, text.split("&"))))
    found = _LETTER.findall(text)
    row = {_COLUMN[letter]: float(number) for letter, number in found if number}
    if len(row) < 2 or len(row) < sum(number != "" for _, number in found):
        return None
    row |= {_COLUMN[letter]: float((letter, "") in found) for letter in _BUTTONS}
    return Row(tuple(row), tuple(row.values()))


def _of_json(text: str) -> Row | None:
    try:
        found = list(_leaves(json.loads(text), ""))  # accepts NaN, which Python's json writes
    except (ValueError, RecursionError):
        return None
    names = tuple(name for name, _ in found) if text[0] == "{" else None
    return Row(names, tuple(value for _, value in found)) if found and (names is None or _sound(names)) else None


def _leaves(value: Any, name: str) -> Iterator[tuple[str, float | None]]:
    """Yield the numbers in a value of JSON, None for what is none, with their names."""
    if isinstance(value, dict | list):
        for key, one in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _leaves(one, f"{name}.{key}" if name else str(key))
    elif isinstance(value, int | float):  # a bool is an int
        try:
            yield name, finite(float(value))
        except OverflowError:
            yield name, None
    else:
        yield name, _number(_VALUE.fullmatch(value.strip())) if isinstance(value, str) else None


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
    row of numbers. Once a line of a board has come, only its rows are.

    columns  how many columns rows have until a header says otherwise; 0: unknown, and then a board's rows are left out
    """

    def __init__(self, columns: int = 0) -> None:
        self.counts, self.odd, self._columns = LineCounts(), "", columns
        self.begin()

    def begin(self) -> None:
        """Reset: an incomplete line and the names of the columns are forgotten."""
        self._rest, self._dropping = b"", False
        self._names: tuple[str, ...] | None = None
        # A header that no row has followed yet, and the misfit before it: it may be a message.
        self._header: tuple[str, ...] = ()
        self._odd_before = ""
        self._checked = self._board = False

    def feed(self, chunk: bytes) -> list[Row]:
        """Return the rows whose lines `chunk` completes, with names if a header came before them."""
        rows = []
        for line in self._lines(chunk):
            found = self._of_checked(line) if _is_checked(line) else self._of_line(line)
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

    def _of_checked(self, line: bytes) -> Row | None:
        found = parsed(line, self._known)
        if isinstance(found, Damaged):
            self.counts.damaged += 1
            return None
        self._checked = True
        if line[1:].partition(b",")[0] not in _OF_BOARD:
            return self._of_line(line)
        self._board = True
        if isinstance(found, Row):
            return found._replace(names=self._names)
        self._names = self._names if found is None else found.names
        return None

    def _of_line(self, line: bytes) -> Row | None:
        found = None
        if not self._board and self._checked == _is_checked(line):
            found = parsed(line, len(self._header) or self._known)
            if found is None and self._header:
                found = parsed(line, self._known)
        if isinstance(found, Row):
            return self._with_names(found)
        header = found.names if isinstance(found, ColumnHeader) else ()
        if not header or header != self._names:
            self.counts.misfits += 1
            if len(header) > 1:  # a word alone is a message
                self._header, self._odd_before = header, self.odd
            self.odd = shortened(repr(line[: LONGEST_SHOWN + 1].decode("utf-8", "replace")))
        return None

    @property
    def _known(self) -> int:
        return len(self._names or ()) or self._columns

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
