"""Read tables of labelled grasps: delimited text, in a format that is detected or that a header names.

foreign.py reads the tables of other programs.
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
from itertools import chain, islice, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.dtypes import StringDType
from numpy.typing import NDArray

from thenar.drivers.extras import optional
from thenar.runtime.files import open_file
from thenar.runtime.names import shortened

from ..text import text_of
from . import COLUMNS, LARGEST, LINES, LONGEST_LINE, ROWS, RecordingError, TableError, check_names, unpacked
from .bags import is_folder
from .cells import NUMBER, Column, has_names, preface, skipped, unlisted
from .columns import PLAIN, TextFormat
from .foreign import READERS, read_foreign, size_of

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


# Cells that are kept as str at a time, while a table is filled.
_CELLS = 1 << 15


def _columns(what: str, names: Collection[str], rows: Iterator[list[str]]) -> dict[str, Column]:
    """Return the cells of `rows` as columns of text, each cell in the memory that it needs. Raises TableError."""
    check_names("column", names)
    step = _CELLS // max(len(names), 1) + 1
    blocks: list[NDArray[np.generic]] = [np.zeros((0, len(names)), StringDType())]
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
    the decimal sign of numbers in text. `skip` is the number of rows of a spreadsheet that precede its header, `notes`
    say what was left out. `segment` is the column that numbers the segments of recordings, "" without them.
    """

    what: str
    columns: Mapping[str, Column]
    rows: NDArray[np.int64]
    size: int = 0
    cells: bool = False
    decimal: str = "."
    skip: int = 0
    notes: tuple[str, ...] = ()
    segment: str = ""


_TEXTS = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz", ".txt.gz")
_MOTION = (".mot", ".sto", ".trc")
SUFFIXES = (*_TEXTS, *_MOTION, *READERS)


def is_table(path: Path) -> bool:
    """Return whether `path` is a file with the suffix of a table, or the folder of a rosbag2."""
    return (path.name.lower().endswith(SUFFIXES) and path.is_file()) or is_folder(path)


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
        is_foreign = batch[0].name.lower().endswith(tuple(READERS)) or is_folder(batch[0])
        foreign = read_foreign(batch, text.skip) if is_foreign else None
        for path in batch:
            try:
                if foreign is None:
                    table = _read_ours(path, text)
                else:
                    read, rows, skip, notes = next(foreign)
                    check_names("column", read)
                    table = Table(path.name, read, rows, skip=skip, notes=notes, decimal=text.decimal)
                columns = unlisted(table.what, table.columns, table.rows)
            except RecordingError as reason:
                raise TableError(f"{path.name}: {reason}") from reason
            if not len(table.rows):
                raise TableError(f"{path.name} has no rows")
            yield replace(table, columns=columns, size=size_of(path))


def _read_ours(path: Path, text: TextFormat) -> Table:
    name = path.name.lower()
    if is_text(path):
        with open_lines(path, text.encoding) as lines:
            tabs = name.removesuffix(".gz").endswith(".tsv")
            return _read_csv(path.name, lines, text, text.delimiter or ("\t" if tabs else ","))
    if name.endswith(_MOTION):
        return _read_motion(path)
    if path.is_dir():
        raise TableError(
            f"{path} is a folder: name the pattern of its tables, such as '{path}/{{label}}_{{trial}}.csv'"
        )
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


def _read_csv(what: str, lines: Iterator[str], text: TextFormat, delimiter: str, top: int = 0) -> Table:
    """Return the table in `lines`, before which `top` others were read."""
    top += text.skip or 0
    reader = csv_rows(_narrow(what, islice(lines, text.skip, None), delimiter), delimiter, text.quote, strict=True)
    numbers = array("q")

    def checked(rows: Iterable[list[str]]) -> Iterator[list[str]]:
        for row in rows:
            numbers.append(top + reader.line_num)
            if len(row) > len(names) and not any(row[len(names) :]):
                del row[len(names) :]
            if len(row) != len(names):
                head = "header" if text.header else "first row"
                raise TableError(f"{what} row {numbers[-1]} has {len(row)} cells, its {head} {len(names)}")
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
        raise TableError(f"{what} row {top + reader.line_num}: {reason}") from reason
    return Table(what, columns, np.frombuffer(numbers, np.int64), cells=True, decimal=text.decimal)


def _read_motion(path: Path) -> Table:
    """Return the table in a file of OpenSim: in a .trc its names stand in two lines, of markers and of coordinates; in
    others they follow the line endheader, and the vectors in cells are lists.
    """
    with open_lines(path) as lines:
        first = next(lines, "")
        # The line below the names of a .trc holds nothing but tabs.
        rows = (line if line.strip() else "" for line in lines)
        if path.suffix.lower() == ".trc" and first.startswith("PathFileType"):
            marker, header = "", []
            _, _, names, axes = (next(lines, "").rstrip().split("\t") for _ in range(4))
            if any(map(str.strip, axes[:2])):  # below the number of the frame and its time
                raise TableError(f"{path.name} row 5 names no coordinates: it begins with {shortened(repr(axes[0]))}")
            for name, axis in zip_longest(names, axes, fillvalue=""):
                marker, axis = name.strip() or marker, axis.strip().rstrip("0123456789").lower()
                header.append(f"{marker}.{axis}" if axis else marker)
            return _read_csv(path.name, chain(["\t".join(header)], rows), PLAIN, "\t", 4)
        ends = (number for number, line in enumerate(lines, start=2) if line.strip().lower() == "endheader")
        if path.suffix.lower() == ".trc" or not (top := next(ends, 0)):
            seen = f"it begins with {shortened(repr(first.strip()))}"
            raise TableError(f"{path.name} has no PathFileType or endheader, as files of OpenSim have: {seen}")
        table = _read_csv(path.name, rows, PLAIN, "\t", top)
    listed = {name: [f"[{cell}]" for cell in cells] for name, cells in table.columns.items() if "," in str(cells[:1])}
    return replace(table, columns={**table.columns, **listed})


def _narrow(what: str, lines: Iterable[str], delimiter: str) -> Iterator[str]:
    """Yield `lines` while none has more cells than a table may have columns."""
    for line in lines:
        if line.count(delimiter) >= COLUMNS:
            raise TableError(f"{what} has more than {COLUMNS} columns, the most that are read of a table")
        yield line


# Lines examined, and cells of them.
_LINES, _SEEN_CELLS = 200, 200_000
# Lines, and characters of each, given to clevercsv, whose run time is quadratic.
_SEEN_LINES, _SEEN = 60, 400
# The bytes that Windows-1252 does not define: searching for them is many times faster than decoding.
_NOT_WESTERN = b"\x81\x8d\x8f\x90\x9d"
_DELIMITERS = (",", ";", "\t", "|", " ")
_SPOKEN = {",": "a comma", ";": "a semicolon", "\t": "a tab", "|": "a bar", " ": "blanks"}


def sniff(path: Path) -> tuple[TextFormat, list[str]]:
    """Return the format of the text table in `path`, and the reasons as sentences.

    Raises TableError where the file cannot be read as text.
    """
    encoding, why = _encoding(path)
    with open_lines(path, encoding) as lines:
        sample = list(islice(lines, _LINES))
    # The second half is free of lines before the header.
    rows, starts = _rows(sample, *_dialect(sample[len(sample) // 2 :]))
    skip = starts[preface(rows)] if rows else 0
    delimiter, quote = _dialect(sample[skip:])
    rows, _ = _rows(sample[skip:], delimiter, quote)
    decimal = "," if delimiter != "," or quote else "."
    numbers = [cell for row in rows for cell in row if NUMBER.fullmatch(cell)]
    if not any("," in number for number in numbers) or any("." in number for number in numbers):
        decimal = "."
    header, reason = has_names(rows)
    sentences = [
        f"encoding {encoding}: {why}",
        *([skipped(skip)] if skip else []),
        f"delimiter: {_SPOKEN[delimiter] if delimiter else 'none, one column'} (clevercsv)",
        f"decimal sign: {'a comma' if decimal == ',' else 'a point'}",
        f"header: {reason}",
    ]
    return TextFormat(delimiter or None, decimal, encoding, quote or '"', header, skip), sentences


def _encoding(path: Path) -> tuple[str, str]:
    with open_bytes(path) as file:
        content = file.read()
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16", "its byte order mark says so"
    try:
        content.decode()
    except UnicodeDecodeError:
        if any(byte in content for byte in _NOT_WESTERN):
            return "latin-1", "it is neither UTF-8 nor Windows-1252"
        return "cp1252", "it is not UTF-8; Windows-1252 is Latin-1 with more signs"
    return "utf-8", "its byte order mark says so" if content.startswith(codecs.BOM_UTF8) else "all of it decodes so"


def _dialect(lines: Iterable[str]) -> tuple[str, str]:
    """Return the delimiter, "" for none, and the quote."""
    with optional(TableError, "finding how a table is written (a columns.toml says it, too)"):
        from clevercsv import Detector, Error
    # Runs of blanks are one delimiter; of other delimiters they are no part.
    sample = "".join(re.sub(" +", " ", line[:_SEEN].strip(" \r\n")) + "\n" for line in islice(lines, _SEEN_LINES))
    try:
        found = Detector().detect(sample.replace("\0", ""), delimiters=list(_DELIMITERS))
    except Error:
        found = None
    return ("", "") if found is None else (found.delimiter or "", found.quotechar or "")


def _rows(lines: Sequence[str], delimiter: str, quote: str) -> tuple[list[list[str]], list[int]]:
    """Return the rows in `lines` that are not empty, and how many lines precede each."""
    reader = csv_rows(lines, delimiter or "\0", quote or '"', strict=False)
    rows: list[list[str]] = []
    starts: list[int] = []
    row: list[str] | None = []
    while row is not None and sum(map(len, rows)) <= _SEEN_CELLS:
        start = reader.line_num
        try:
            row = next(reader, None)
        except csv.Error:
            continue
        if row:
            rows.append(named_by_comment([cell.strip() for cell in row], delimiter))
            starts.append(start)
    return rows, starts
