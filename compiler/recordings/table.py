"""Read tables of labelled grasps: delimited text and Weka's ARFF; foreign.py reads those of other programs.

ARFF has numeric and nominal attributes, quoted names and values, and `?` for a missing value. It is read here because
the reader of scipy loses quotes in nominal values, reports no rows, and is not installed on a board.
"""

import codecs
import csv
import gzip
import io
import os
import re
import zlib
from array import array
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, TypeGuard

import numpy as np
from numpy.dtypes import StringDType
from numpy.typing import NDArray

from thenar.runtime.files import open_file
from thenar.runtime.names import shortened

from ..text import text_of
from .arrays import AnyArray
from .columns import PLAIN, TextFormat
from .errors import COLUMNS, LARGEST, LINES, LONGEST_LINE, ROWS, RecordingError, TableError, check_names, unpacked
from .foreign import READERS, read_foreign
from .headers import MISSING_NUMBERS

if TYPE_CHECKING:
    from _csv import Reader


@contextmanager
def open_bytes(path: Path) -> Iterator[BinaryIO]:
    """Open a text file, gzipped or not; errors in the compression become a TableError."""
    try:
        with open_file(path, TableError) as raw:
            size = os.fstat(raw.fileno()).st_size
            if size > LARGEST:
                raise TableError(f"{path.name} is larger than {LARGEST} bytes, the most that is read of a table")
            if path.suffix.lower() != ".gz":
                yield raw
                return
            content = gzip.GzipFile(fileobj=raw).read(unpacked(size) + 1)
            if len(content) > unpacked(size):
                raise TableError(
                    f"{path.name} unpacks to more than {unpacked(size)} bytes, the most for a file of its size: "
                    "unpack it and import the result"
                )
            yield io.BytesIO(content)
    except (gzip.BadGzipFile, EOFError, zlib.error) as reason:
        raise TableError(f"{path.name} is damaged: {reason}") from reason


@contextmanager
def open_lines(path: Path, encoding: str = "utf-8") -> Iterator[Iterator[str]]:
    """Open a text file, gzipped or not, after its byte order mark; errors in its content become a TableError."""
    known = codecs.lookup(encoding).name
    try:
        with (
            open_bytes(path) as file,
            io.TextIOWrapper(file, "utf-8-sig" if known == "utf-8" else known, newline="") as text,
        ):
            yield _lines(path.name, text)
    except UnicodeError as reason:
        why = getattr(reason, "reason", str(reason))
        raise TableError(
            f"{path.name} is not {known.upper()} text: {why}; save it as UTF-8, or name its `encoding`"
        ) from reason


def _lines(what: str, text: io.TextIOWrapper) -> Iterator[str]:
    number = 0
    while line := text.readline(LONGEST_LINE):
        number += 1
        if number > LINES:
            raise TableError(f"{what} has more than {LINES} lines, the most that are read of a table")
        if len(line) == LONGEST_LINE and line[-1] not in "\r\n":
            raise TableError(f"{what} line {number} is longer than {LONGEST_LINE} characters")
        yield line


# Cells kept as str at a time, while a table is filled or a column is read.
_CELLS, _READ = 1 << 15, 1 << 14

# Text as read, or an array of numbers or of str.
Column = Sequence[str] | AnyArray


def is_numeric(column: Column) -> TypeGuard[AnyArray]:
    """Return whether a column holds numbers, not text."""
    return isinstance(column, np.ndarray) and column.dtype.kind not in "UT"


def pieces(column: Column) -> Iterator[list[str]]:
    """Yield the cells of a text column in lists of some thousands, so that few are kept as str."""
    for start in range(0, len(column), _READ):
        piece = column[start : start + _READ]
        yield piece.tolist() if isinstance(piece, np.ndarray) else list(piece)


def _columns(what: str, names: Collection[str], rows: Iterator[list[str]]) -> dict[str, Column]:
    """Return the cells of `rows` as columns of text, each cell in the memory that it needs. Raises TableError."""
    check_names("column", names)
    step = _CELLS // max(len(names), 1) + 1
    blocks: list[AnyArray] = [np.zeros((0, len(names)), StringDType())]
    while block := list(islice(rows, step)):
        blocks.append(np.array(block, StringDType()))
        if sum(map(len, blocks)) > ROWS:
            raise TableError(f"{what} has more than {ROWS} rows, the most that are read of a table")
    return dict(zip(names, np.concatenate(blocks).T, strict=True))


@dataclass(frozen=True, slots=True)
class Table:
    """Named columns of equal length: text as read, or numbers, with NaN for missing ones.

    `rows` are the rows' numbers as the user sees them: the line in a CSV or spreadsheet, counted from 1 elsewhere.
    `size` is the size of its file in bytes. `cells` says that names are written as cells of a spreadsheet; `decimal` is
    the decimal sign of numbers in text. `skip` is the number of rows of a spreadsheet that precede its header.
    """

    what: str
    columns: Mapping[str, Column]
    rows: NDArray[np.int64]
    size: int = 0
    cells: bool = False
    decimal: str = "."
    skip: int = 0


_TEXTS = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz", ".txt.gz")
SUFFIXES = (*_TEXTS, ".arff", ".arff.gz", *READERS)


def is_text(path: Path) -> bool:
    """Return whether the name of `path` is that of a delimited text table."""
    return path.name.lower().endswith(_TEXTS)


# Binary tables that one process reads: starting it takes much longer than a small table.
_TOGETHER = 16


def read_table(path: Path, text: TextFormat = PLAIN) -> Table:
    """Read a table by its suffix; delimited text in the format `text`.

    Raises TableError naming the file, the row and the fault, and OSError from the operating system.
    """
    return next(read_tables([path], text))


def read_tables(paths: Sequence[Path], text: TextFormat = PLAIN) -> Iterator[Table]:
    """Yield the tables in `paths`, of one kind, as `read_table` does; an error is one of the first not yielded."""
    for start in range(0, len(paths), _TOGETHER):
        batch = paths[start : start + _TOGETHER]
        is_foreign = batch[0].name.lower().endswith(tuple(READERS))
        foreign = read_foreign(batch, text.skip) if is_foreign else None
        for path in batch:
            try:
                if foreign is None:
                    table = _read_ours(path, text)
                else:
                    read, rows, skip = next(foreign)
                    check_names("column", read)
                    table = Table(path.name, read, rows, skip=skip)
                columns = unlisted(table.what, table.columns, table.rows)
            except RecordingError as reason:
                raise TableError(f"{path.name}: {reason}") from reason
            if not len(table.rows):
                raise TableError(f"{path.name} has no rows")
            yield replace(table, columns=columns, size=path.stat().st_size)


def _read_ours(path: Path, text: TextFormat) -> Table:
    name = path.name.lower()
    if is_text(path):
        with open_lines(path, text.encoding) as lines:
            tabs = name.removesuffix(".gz").endswith(".tsv")
            return _read_csv(path.name, lines, text, text.delimiter or ("\t" if tabs else ","))
    if name.endswith((".arff", ".arff.gz")):
        with open_lines(path) as lines:
            return read_arff(path.name, lines)
    raise TableError(f"{path.name}: a table ends in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}")


def csv_rows(lines: Iterable[str], delimiter: str, quote: str, *, strict: bool) -> "Reader":
    """Return a reader of the rows in `lines`. With a blank as `delimiter`, any run of blanks and tabs is one."""
    blanks = delimiter == " "
    return csv.reader(
        (line.replace("\t", " ").strip() for line in lines) if blanks else lines,
        delimiter=delimiter,
        strict=strict,
        quotechar=quote or None,
        quoting=csv.QUOTE_MINIMAL if quote else csv.QUOTE_NONE,
        skipinitialspace=blanks,
    )


def named_by_comment(header: list[str], delimiter: str) -> list[str]:
    """Return a row of names without the sign of a comment before them, which numpy.savetxt writes."""
    first = header[0] if header else ""
    if delimiter == " " and first in ("#", "%"):
        return header[1:]
    return [first[1:].strip(), *header[1:]] if first[:1] in ("#", "%") and first[1:].strip() else header


def _read_csv(what: str, lines: Iterator[str], text: TextFormat, delimiter: str) -> Table:
    skip = text.skip or 0
    reader = csv_rows(_narrow(what, islice(lines, skip, None), delimiter), delimiter, text.quote, strict=True)
    numbers = array("q")

    def checked(rows: Iterable[list[str]]) -> Iterator[list[str]]:
        for row in rows:
            numbers.append(skip + reader.line_num)
            if len(row) > len(names) and not any(row[len(names) :]):
                del row[len(names) :]
            if len(row) != len(names):
                top = "header" if text.header else "first row"
                raise TableError(f"{what} row {numbers[-1]} has {len(row)} cells, its {top} {len(names)}")
            yield row

    try:
        filled: Iterator[list[str]] = filter(None, reader)
        first: list[str] = next(filled, [])
        if text.header:
            first = named_by_comment(first, delimiter)
        names = [text_of(name.strip()) if text.header else "" for name in first]
        names = [name or f"column {number}" for number, name in enumerate(names, start=1)]
        columns = _columns(what, names, checked(filled if text.header or not first else chain([first], filled)))
    except csv.Error as reason:
        raise TableError(f"{what} row {skip + reader.line_num}: {reason}") from reason
    return Table(what, columns, np.frombuffer(numbers, np.int64), cells=True, decimal=text.decimal)


def _narrow(what: str, lines: Iterable[str], delimiter: str) -> Iterator[str]:
    """Yield `lines` while none has more cells than a table may have columns."""
    for line in lines:
        if line.count(delimiter) >= COLUMNS:
            raise TableError(f"{what} has more than {COLUMNS} columns, the most that are read of a table")
        yield line


# A value: quoted, with backslash escapes, or a word; an unclosed quote takes the rest of the line. Commas and blanks
# separate values. All quantifiers are possessive, so the time is linear.
_QUOTED = r"""'(?:\\.|[^'\\])*+'|"(?:\\.|[^"\\])*+\""""
_VALUE = re.compile(rf"""{_QUOTED}|['"].*+|[^\s,{{}}'"%]++""")
_CLOSED = re.compile(_QUOTED)
_ATTRIBUTE = re.compile(rf"@attribute\s++({_VALUE.pattern})\s++(.+)", re.IGNORECASE)
_NUMERIC = ("numeric", "real", "integer")

# The possible values of an attribute; None for numbers.
_Kinds = dict[str, frozenset[str] | None]


def read_arff(what: str, text: Iterable[str]) -> Table:
    """Return the table in the lines `text` of an ARFF file that messages call `what`.

    Its rows are counted from the first after @data; numbers stay text for the importer to parse. Raises TableError
    naming the faulty line or row.
    """
    lines = enumerate(text, start=1)
    kinds = _header(what, lines)
    data = (line.strip() for _, line in lines)
    numbered = enumerate((line for line in data if line and not line.startswith("%")), start=1)
    columns = _columns(what, kinds, (_values(f"{what} row {row}", line, len(kinds)) for row, line in numbered))
    for name, values in kinds.items():
        for number, cell in enumerate(columns[name] if values else (), start=1):
            if cell != "?" and cell not in (values or ()):
                shown = f"{shortened(repr(cell))} is not among the values of attribute {shortened(repr(name))}"
                raise TableError(f"{what} row {number}: {shown}")
    return Table(what, columns, np.arange(1, len(next(iter(columns.values()), ())) + 1))


def _header(what: str, lines: Iterator[tuple[int, str]]) -> _Kinds:
    """Read up to @data."""
    kinds: _Kinds = {}
    listed = 0
    for number, line in lines:
        word = line.strip().split(maxsplit=1)[0].lower() if line.strip() else "%"
        if word == "@data":
            return kinds
        if word == "@attribute":
            name, kind = _attribute(f"{what} line {number}", line.strip())
            if name in kinds:
                raise TableError(f"{what} line {number}: attribute {shortened(repr(name))} occurs twice")
            kinds[name] = kind
            listed += len(kind or ())
            if len(kinds) > COLUMNS or listed > ROWS:
                raise TableError(f"{what} line {number}: more than {COLUMNS} attributes, or {ROWS} values of them")
        elif word != "@relation" and not word.startswith("%"):
            shown = shortened(repr(word))
            raise TableError(f"{what} line {number}: expected @attribute or @data, not {shown}")
    raise TableError(f"{what} is not ARFF: it has no line @data")


def _attribute(where: str, line: str) -> tuple[str, frozenset[str] | None]:
    match = _ATTRIBUTE.match(line)
    if match is None:
        raise TableError(f"{where}: an attribute has a name and a type: {shortened(repr(line))}")
    name, kind = _unquote(where, match[1]), match[2].strip()
    if kind.split(maxsplit=1)[0].lower() in _NUMERIC:
        return name, None
    if not kind.startswith("{") or "}" not in kind:
        shown = f"attribute {shortened(repr(name))} is {shortened(kind)}"
        raise TableError(f"{where}: {shown}; only numeric and nominal ones are read")
    return name, frozenset(_unquote(where, value) for value in _VALUE.findall(kind))


def _values(where: str, line: str, width: int) -> list[str]:
    if not any(sign in line for sign in "'\"{}%"):
        values = line.replace(",", " ").split()
    elif _VALUE.sub("", line).strip(", \t"):
        sparse = ": sparse rows are not read" if line.startswith("{") else ""
        raise TableError(f"{where} cannot be read as values{sparse}: {shortened(repr(line))}")
    else:
        values = [_unquote(where, value) for value in _VALUE.findall(line)]
    if len(values) != width:
        raise TableError(f"{where} has {len(values)} values, the header {width} attributes")
    return values


def _unquote(where: str, value: str) -> str:
    if value[0] not in "'\"":
        return value
    if not _CLOSED.fullmatch(value):
        raise TableError(f"{where} cannot be read as values: nothing closes the quote of {shortened(repr(value))}")
    return re.sub(r"\\(.)", r"\1", value[1:-1])


# Columns whose cells hold lists of numbers become several columns, as those of Parquet files do.

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
