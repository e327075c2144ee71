"""Detect the format of a text table: its encoding, delimiter, quotes, decimal sign, and header."""

import codecs
import csv
import re
from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path

from thenar.drivers.extras import optional

from .columns import TextFormat
from .errors import TableError
from .headers import NUMBER, has_names, preface, skipped
from .table import csv_rows, named_by_comment, open_bytes, open_lines

# Lines examined, and cells of them.
_LINES, _CELLS = 200, 200_000
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
    while row is not None and sum(map(len, rows)) <= _CELLS:
        start = reader.line_num
        try:
            row = next(reader, None)
        except csv.Error:
            continue
        if row:
            rows.append(named_by_comment([cell.strip() for cell in row], delimiter))
            starts.append(start)
    return rows, starts
