"""Detect the format of a text table: its encoding, delimiter, quotes, decimal sign, and header."""

import codecs
import csv
import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from thenar.drivers.extras import optional

from .cells import MISSING_NUMBERS
from .columns import TextFormat
from .errors import TableError
from .table import open_bytes, open_lines

# Rows examined, characters of each, and those given to clevercsv, whose run time is quadratic.
_ROWS, _CHARACTERS, _SEEN = 60, 5000, 400
_CHUNK = 1 << 20
# The bytes that Windows-1252 does not define: searching for them is many times faster than decoding.
_NOT_WESTERN = b"\x81\x8d\x8f\x90\x9d"
_DELIMITERS = (",", ";", "\t", "|", " ")
_SPOKEN = {",": "a comma", ";": "a semicolon", "\t": "a tab", "|": "a bar", " ": "a blank"}
_NUMBER = re.compile(r"[+-]?(?:\d++(?:[.,]\d*+)?|[.,]\d++)(?:[eE][+-]?\d++)?")


def sniff(path: Path) -> tuple[TextFormat, list[str]]:
    """Return the format of the text table in `path`, and the reasons as sentences.

    Raises TableError where the file cannot be read as text.
    """
    encoding, why = _encoding(path)
    with open_lines(path, encoding) as lines:
        sample = [line[:_CHARACTERS] for line in islice(lines, _ROWS)]
    delimiter, quote = _dialect("".join(f"{line[:_SEEN].rstrip()}\n" for line in sample))
    whole = [line for line in sample if len(line) < _CHARACTERS] or sample
    rows = list(_rows(whole, delimiter or "\0", quote))
    decimal = "," if delimiter != "," or quote else "."
    numbers = [cell for row in rows for cell in row if _NUMBER.fullmatch(cell)]
    if not any("," in number for number in numbers) or any("." in number for number in numbers):
        decimal = "."
    header, reason = _header(rows)
    sentences = [
        f"encoding {encoding}: {why}",
        f"delimiter: {_SPOKEN[delimiter] if delimiter else 'none, one column'} (clevercsv)",
        f"decimal sign: {'a comma' if decimal == ',' else 'a point'}",
        f"header: {reason}",
    ]
    return TextFormat(delimiter or None, decimal, encoding, quote or '"', header), sentences


def _encoding(path: Path) -> tuple[str, str]:
    with open_bytes(path) as file:
        start = file.read(_CHUNK)
        if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            return "utf-16", "its byte order mark says so"
        marked = start.startswith(codecs.BOM_UTF8)
        decoder = codecs.getincrementaldecoder("utf-8")()
        utf8 = western = True
        piece = start
        while True:
            if utf8:
                try:
                    decoder.decode(piece, final=not piece)
                except UnicodeDecodeError:
                    utf8 = False
            western = western and not any(byte in piece for byte in _NOT_WESTERN)
            if not piece or not (utf8 or western):
                break
            piece = file.read(_CHUNK)
    if utf8:
        return "utf-8", "its byte order mark says so" if marked else "all of it decodes so"
    if western:
        return "cp1252", "it is not UTF-8; Windows-1252 is Latin-1 with more signs"
    return "latin-1", "it is neither UTF-8 nor Windows-1252"


def _dialect(sample: str) -> tuple[str, str]:
    """Return the delimiter, "" for none, and the quote."""
    with optional(TableError, "finding how a table is written (a columns.toml says it, too)"):
        from clevercsv import Detector, Error
    try:
        found = Detector().detect(sample.replace("\0", ""), delimiters=list(_DELIMITERS))
    except Error:
        found = None
    return ("", "") if found is None else (found.delimiter or "", found.quotechar or "")


def _rows(lines: list[str], delimiter: str, quote: str) -> Iterator[list[str]]:
    reader = csv.reader(lines, delimiter=delimiter, quotechar=quote or '"')
    while True:
        try:
            row = next(reader, None)
        except csv.Error:
            continue
        if row is None:
            return
        if row:
            yield [cell.strip() for cell in row]


def _header(rows: list[list[str]]) -> tuple[bool, str]:
    """Return whether the first of `rows` names the columns, and why."""
    first, body = rows[0] if rows else [], rows[1:]
    if not body:
        return True, "the only row"
    numeric = [place for place in range(len(first)) if _is_numeric(row[place] for row in body if place < len(row))]
    if numeric:
        words = [first[place] for place in numeric if not _NUMBER.fullmatch(first[place])]
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
    there = [bool(_NUMBER.fullmatch(cell)) for cell in cells if cell.casefold() not in MISSING_NUMBERS]
    return sum(there) > 0.8 * len(there)
