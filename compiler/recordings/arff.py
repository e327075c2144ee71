"""Weka's ARFF in: numeric and nominal attributes, quoted names and values, `?` for a missing value.

Read here and not by scipy, whose reader loses quotes in nominal values, knows no rows, and is not on a board.
"""

import re
from collections.abc import Iterable, Iterator

import numpy as np

from .errors import TableError
from .limits import COLUMNS, ROWS
from .names import shortened
from .table import Table
from .texts import TextRows

# A value: quoted, where a backslash takes the next character as it is, or a word; a quote that nothing closes takes the
# rest of the line. Commas and blanks part values. No quantifier gives back what it took: so the time is linear.
_QUOTED = r"""'(?:\\.|[^'\\])*+'|"(?:\\.|[^"\\])*+\""""
_VALUE = re.compile(rf"""{_QUOTED}|['"].*+|[^\s,{{}}'"%]++""")
_CLOSED = re.compile(_QUOTED)
_ATTRIBUTE = re.compile(rf"@attribute\s++({_VALUE.pattern})\s++(.+)", re.IGNORECASE)
_NUMERIC = ("numeric", "real", "integer")

# The values an attribute may have; None for numbers.
_Kinds = dict[str, frozenset[str] | None]


def read_arff(what: str, text: Iterable[str]) -> Table:
    """Return the table in the lines `text` of an ARFF file that messages call `what`.

    Its rows are counted from the first after @data; numbers are left as text for the importer to read. Raises
    TableError naming the line or the row that is wrong.
    """
    lines = enumerate(text, start=1)
    kinds = _header(what, lines)
    cells, count = TextRows(len(kinds)), 0
    for _, line in lines:
        data = line.strip()
        if data and not data.startswith("%"):
            count += 1
            if count > ROWS:
                raise TableError(f"{what} has more than {ROWS} rows, the most that are read of a table")
            cells.append(_values(f"{what} row {count}", data, len(kinds)))
    columns = dict(zip(kinds, cells.columns(), strict=True))
    for name, values in kinds.items():
        for number, cell in enumerate(columns[name] if values else (), start=1):
            if cell != "?" and cell not in (values or ()):
                shown = f"{shortened(repr(cell))} is not among the values of attribute {shortened(repr(name))}"
                raise TableError(f"{what} row {number}: {shown}")
    return Table(what, columns, np.arange(1, count + 1))


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
            raise TableError(f"{what} line {number}: {shown} stands where @attribute or @data should")
    raise TableError(f"{what} is no ARFF: it has no line @data")


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
