"""The cells of a table: as numbers, bits, codes, names, times and lists; which are missing or wrong; and its header."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import compress
from typing import Generic, Literal, TypeGuard, TypeVar

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import fault, shortened

from ..arrays import AnyArray
from ..text import text_of
from . import COLUMNS, TableError, check_names, check_room

# Text as read, or an array of numbers or of str.
Column = Sequence[str] | AnyArray

# Cells of a column that are kept as str at a time.
_READ = 1 << 14


def is_numeric(column: Column) -> TypeGuard[AnyArray]:
    """Return whether a column holds numbers, not text."""
    return isinstance(column, np.ndarray) and column.dtype.kind not in "UT"


def pieces(column: Column) -> Iterator[list[str]]:
    """Yield the cells of a text column in lists of some thousands, so that few are kept as str."""
    for start in range(0, len(column), _READ):
        piece = column[start : start + _READ]
        yield piece.tolist() if isinstance(piece, np.ndarray) else list(piece)


MISSING_NAMES = frozenset({"", "?"})

_DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(?::\d\d(?:\.\d{1,9})?)?")
_BITS = {"true": 1.0, "false": 0.0}

Value = TypeVar("Value", bound=np.generic)


@dataclass(frozen=True, slots=True)
class Parsed(Generic[Value]):
    """One column: (n,) `values`, and which cells are missing and which are wrong, (n,) bool each."""

    values: NDArray[Value]
    missing: NDArray[np.bool_]
    wrong: NDArray[np.bool_]


def numbers(column: Column, decimal: str = ".") -> Parsed[np.float64]:
    """Read `column` as finite numbers with the decimal sign `decimal`.

    Missing: empty, ?, NA, N/A, NaN, null, none; wrong: anything else, and infinity.
    """
    return _parsed(column, {}, decimal)


def bits(column: Column, decimal: str = ".") -> Parsed[np.bool_]:
    """Read `column` as bits: 0, 1, 0.0, 1.0, true, false; missing as in `numbers`, wrong: anything else."""
    parsed = _parsed(column, _BITS, decimal)
    values = parsed.values == 1
    return Parsed(values, parsed.missing, parsed.wrong | ~(parsed.missing | values | (parsed.values == 0)))


def integers(column: Column, decimal: str = ".") -> Parsed[np.float64]:
    """Read `column` as whole numbers within +-2^53; missing as in `numbers`, wrong: anything else."""
    parsed = numbers(column, decimal)
    values = np.where(parsed.missing | parsed.wrong, 0, parsed.values)
    return Parsed(values, parsed.missing, parsed.wrong | (values != np.rint(values)) | (np.abs(values) > 2**53))


def codes(column: Column, decimal: str = ".") -> Parsed[np.float64]:
    """Read `column` as codes 0..65535; missing as in `numbers`, wrong: anything else."""
    parsed = integers(column, decimal)
    return Parsed(
        parsed.values, parsed.missing, parsed.wrong | (parsed.values < 0) | (parsed.values > np.iinfo(np.uint16).max)
    )


def times(column: Column, decimal: str = ".") -> Parsed[np.float64]:
    """Read `column` as finite numbers, or all of it as dates with times of day (ISO 8601, without offsets), in
    microseconds since 1970; missing as in `numbers`, wrong: anything else.
    """
    parsed = numbers(column, decimal)
    if not parsed.wrong.any() or is_numeric(column):
        return parsed
    texts = [text.strip().removesuffix("Z") for piece in pieces(column) for text in piece]
    if not all(map(_DATE.fullmatch, compress(texts, (~parsed.missing).tolist()))):
        return parsed
    try:
        stamps = np.array(["NaT" if gone else text for text, gone in zip(texts, parsed.missing, strict=True)], "M8[us]")
    except ValueError:
        return parsed
    values = np.where(parsed.missing, np.nan, stamps.astype(np.int64))
    return Parsed(values, parsed.missing, np.zeros(len(values), np.bool_))


def names(column: Column, cells: bool = False, size: int = 0) -> Parsed[np.str_]:
    """Read `column` as names without outer blanks; missing: empty and ?, wrong: invalid names.

    With `cells` they are written as cells of a spreadsheet. Numbers are names too, except NaN, which is missing, and
    infinity, which is wrong. Integers are written without decimals: 3, not 3.0. Raises RecordingError if the names are
    too long for the number of rows of a file of `size` bytes.
    """
    if is_numeric(column):
        values = _floats(column)
        texts = list(map(name_of_number, values.tolist()))
        faulty = {"inf", "-inf"}
    else:
        texts = [text_of(cell.strip()) if cells else cell.strip() for piece in pieces(column) for cell in piece]
        faulty = {text for text in {*texts} - MISSING_NAMES if fault(text)}
    check_room(len(texts), max(map(len, texts), default=0), size)
    # Looked up as str: an array would lose NULs at the ends.
    missing, wrong = (
        np.fromiter((text in those for text in texts), np.bool_, len(texts)) for those in (MISSING_NAMES, faulty)
    )
    return Parsed(np.array(texts, np.str_), missing, wrong)


def name_of_number(number: float) -> str:
    """Return a number without an exponent, and an integer without decimals; "" for NaN."""
    if math.isnan(number):
        return ""
    # Adding zero turns -0.0 into 0.0.
    return np.format_float_positional(number + 0.0, trim="-")


# "1.000" means a thousand where a comma is the decimal sign: so it is wrong, not one.
_COMMA = str.maketrans({",": ".", ".": "_"})


def _parsed(column: Column, words: dict[str, float], decimal: str) -> Parsed[np.float64]:
    """Return the cells as floats, NaN if missing or wrong; `words` are read in addition to numbers."""
    if is_numeric(column):
        values = _floats(column)
        missing = np.isnan(values)
    else:
        values, missing = np.empty(len(column)), np.zeros(len(column), np.bool_)
        start = 0
        for texts in pieces(column):
            end = start + len(texts)
            values[start:end] = _numbers([text.translate(_COMMA) for text in texts] if decimal == "," else texts, words)
            for row in np.flatnonzero(np.isnan(values[start:end])).tolist():
                missing[start + row] = texts[row].strip().casefold() in MISSING_NUMBERS
            start = end
    return Parsed(values, missing, (np.isnan(values) & ~missing) | np.isinf(values))


def _floats(column: AnyArray) -> NDArray[np.float64]:
    # A number too large for a double becomes infinite, and is rejected with its row.
    with np.errstate(over="ignore"):
        return column.astype(np.float64)


def _numbers(cells: list[str], words: dict[str, float]) -> NDArray[np.float64]:
    # float() would read 1_000 as a thousand.
    if not any("_" in cell for cell in cells):
        with suppress(ValueError):
            # Convert all at once, which is several times faster.
            return np.array(cells, dtype=np.float64)
    values = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        word = cell.strip().casefold()
        if word in words:
            values[row] = words[word]
        elif word not in MISSING_NUMBERS and "_" not in word:
            with suppress(ValueError):
                values[row] = float(word)
    return values


_DIGITS = re.compile(r"(\d+)")


def natural_key(text: str) -> tuple[list[tuple[int, str]], str]:
    """Return a sort key for `text` that orders numbers by value: "T2" before "T10"."""
    parts = enumerate(_DIGITS.split(text.casefold()))
    # Digits by length, then as text: int() takes at most 4,300 of them.
    return [(len(part.lstrip("0")), part.lstrip("0")) if odd % 2 else (-1, part) for odd, part in parts], text


TimeUnit = Literal["s", "ms", "us", "ns"]
# Units of time by the words that name them, and the smallest step between two frames for each: frames come 2 to 2000
# times a second.
UNITS: dict[TimeUnit, tuple[set[str], float, float]] = {
    "s": ({"s", "sec", "secs", "second", "seconds", "sekunde", "sekunden"}, 0.0005, 0.5),
    "ms": ({"ms", "msec", "milli", "millis", "millisecond", "milliseconds"}, 2.0, 500.0),
    "us": ({"us", "usec", "µs", "μs", "micro", "micros", "microsecond", "microseconds"}, 500.0, 5e5),
    "ns": ({"ns", "nsec", "nano", "nanos", "nanosecond", "nanoseconds"}, 5e5, 5e8),
}

PER_SECOND: dict[TimeUnit, float] = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


def unit_of_time(name: str, time: NDArray[np.float64]) -> TimeUnit | None:
    """Return the unit of times (n,) in a column called `name`, by its name or by the distance between frames.

    Return None if neither is conclusive, as for numbered frames.
    """
    words = {*re.findall(r"[^\W\d_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).casefold())}
    steps = np.diff(time)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    named = [unit for unit, (those, _, _) in UNITS.items() if words & those]
    # Numbers of frames have no unit, however far apart they are.
    numbered = words & {"frame", "frames", "bild"}
    found = named or [unit for unit, (_, least, most) in UNITS.items() if least <= step < most and not numbered]
    return found[0] if len(found) == 1 else None


# A list as pandas and numpy write it, with commas or blanks, and a number of numpy in it.
_LIST = re.compile(r"[\[(](.*)[\])]", re.DOTALL)
_SCALAR = re.compile(r"np\.\w+\(([^()]*)\)")


def unlisted(what: str, columns: Mapping[str, Column], rows: NDArray[np.int64]) -> dict[str, Column]:
    """Return `columns` with lists such as "[0.56, 0.83]" in the cells of `data` as columns data.0, data.1, ...

    what  the table in messages
    rows  (n,) the numbers of its rows in messages

    Raises TableError if a column holds lists that are unequally long, or lists and other cells; RecordingError if two
    columns get one name.
    """
    made: list[tuple[str, Column]] = []
    for name, column in columns.items():
        first = "" if is_numeric(column) else next((cell for cell in column if cell), "")
        if not _list_of(str(first)):
            made.append((name, column))
            continue
        values = _of_lists(f"{what}: column {shortened(repr(name))}", column, rows)
        many = values.shape[1] > 1
        made += [(f"{name}.{place}" if many else name, part) for place, part in enumerate(values.T)]
    if len(made) != len(columns):
        check_names("column", [name for name, _ in made])
        if len(made) > COLUMNS:
            raise TableError(f"{what} has more than {COLUMNS} columns, the most that are read of a table")
    return dict(made)


def _of_lists(where: str, column: Column, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the numbers (n, k) of lists of k, NaN for missing ones. Raises TableError."""
    first, width = next((row, len(cells)) for row, cell in enumerate(column) if (cells := _list_of(str(cell))))
    numbers = np.full((len(column), width), np.nan)
    for row, cell in enumerate(map(str, column)):
        cells = _list_of(cell) if cell.strip() else []
        if cells is None:
            shown = f"but row {rows[row]} has {shortened(repr(cell))}: write each list whole"
            raise TableError(f"{where} holds lists of numbers, {shown}")
        if len(cells) not in (0, width):
            shown = f"{width} in row {rows[first]} and {len(cells)} in row {rows[row]}"
            raise TableError(f"{where} holds lists of unequal lengths, {shown}: write lists of one length")
        if cells:
            numbers[row] = cells
    return numbers


def _list_of(cell: str) -> list[float] | None:
    """Return the numbers of a list, or None if `cell` is no list of numbers."""
    inner = _LIST.fullmatch(cell.strip())
    if inner is None:
        return None
    parts = _SCALAR.sub(r"\1", inner[1]).replace(",", " ").split()
    try:
        return [np.nan if part.casefold() in MISSING_NUMBERS else float(part) for part in parts]
    except ValueError:
        return None


NUMBER = re.compile(r"[+-]?(?:\d++(?:[.,]\d*+)?|[.,]\d++)(?:[eE][+-]?\d++)?")
# Cells in place of numbers, without regard to case.
MISSING_NUMBERS = frozenset({"", "?", "na", "n/a", "#n/a", "nan", "null", "none"})

_Rows = Sequence[Sequence[str]]


def skipped(rows: int) -> str:
    """Return the sentence on `rows` that precede the table."""
    return f"rows left out at the top: {rows} (skip = {rows}), which have other cells than the table below"


def preface(rows: _Rows) -> int:
    """Return how many of the first `rows` precede the table, whose header or first row comes next.

    A row of the table is as wide as most rows of the second half, and has more than half as many filled cells.
    """
    body = rows[len(rows) // 2 :]
    if not body:
        return 0
    filled = [sum(map(bool, row)) for row in rows]
    typical = sorted(filled[len(rows) // 2 :])[len(body) // 2]
    wide, wide_filled = (Counter(map(width, body)).most_common(1)[0][0] for width in (len, _filled_width))
    for number, row in enumerate(rows[: len(rows) - len(body) + 1]):
        if (len(row) == wide or _filled_width(row) == wide_filled) and 2 * filled[number] > typical:
            # A row of names that is too short or too long is a fault of the table, not a note on it.
            named = number == 0 or 2 * filled[number - 1] <= typical or has_names(rows[number:])[0]
            return number if named else 0
    return 0


def _filled_width(row: Sequence[str]) -> int:
    return max((place for place, cell in enumerate(row, start=1) if cell), default=0)


def has_names(rows: _Rows) -> tuple[bool, str]:
    """Return whether the first of `rows` names the columns, and why."""
    first, body = rows[0] if rows else [], rows[1:]
    if not body:
        return True, "the only row"
    numeric = [place for place in range(len(first)) if _is_numeric(row[place] for row in body if place < len(row))]
    if numeric:
        words = [first[place] for place in numeric if not NUMBER.fullmatch(first[place])]
        named = [word for word in words if word.casefold() not in MISSING_NUMBERS]
        if named:
            return True, f"the first row has {named[0][:40]!r} over numbers"
        return False, "none: the first row has numbers where the others have them; columns are called column 1, ..."
    repeated = {cell for row in body for cell in row}
    if repeated.isdisjoint(first):
        return True, "what the first row says occurs in no other"
    return False, "none: what the first row says occurs in others, too; columns are called column 1, ..."


def _is_numeric(cells: Iterator[str]) -> bool:
    """Return whether most of `cells` are numbers, of those that are not missing."""
    there = [bool(NUMBER.fullmatch(cell)) for cell in cells if cell.casefold() not in MISSING_NUMBERS]
    return sum(there) > 0.8 * len(there)
