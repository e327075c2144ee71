"""Weka's ARFF in: numeric and nominal attributes, quoted names and values, `?` for a missing value.

Read here and not by scipy, whose reader loses quotes in nominal values, knows no rows, and is not on a board.
"""

import re
from collections.abc import Iterable, Iterator

import numpy as np

from .errors import TableError
from .table import Table

# A value: quoted, where a backslash takes the next character as it is, or a word. Commas and blanks part values.
_VALUE = re.compile(r"""'(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*"|[^\s,{}'"%]+""")
_ATTRIBUTE = re.compile(rf"@attribute\s+({_VALUE.pattern})\s+(.+)", re.IGNORECASE)
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
    data = [line for _, line in lines if line.strip() and not line.lstrip().startswith("%")]
    rows = [_values(f"{what} row {number}", line.strip(), len(kinds)) for number, line in enumerate(data, start=1)]
    columns = dict(zip(kinds, zip(*rows, strict=True), strict=True)) if rows else dict.fromkeys(kinds, ())
    for name, values in kinds.items():
        for number, cell in enumerate(columns[name], start=1):
            if values and cell != "?" and cell not in values:
                raise TableError(f"{what} row {number}: {cell!r} is not among the values of attribute {name!r}")
    return Table(what, columns, np.arange(1, len(rows) + 1))


def _header(what: str, lines: Iterator[tuple[int, str]]) -> _Kinds:
    """Read up to @data."""
    kinds: _Kinds = {}
    for number, line in lines:
        word = line.strip().split(maxsplit=1)[0].lower() if line.strip() else "%"
        if word == "@data":
            return kinds
        if word == "@attribute":
            name, kind = _attribute(f"{what} line {number}", line.strip())
            if name in kinds:
                raise TableError(f"{what} line {number}: attribute {name!r} occurs twice")
            kinds[name] = kind
        elif word != "@relation" and not word.startswith("%"):
            raise TableError(f"{what} line {number}: {word!r} stands where @attribute or @data should")
    raise TableError(f"{what} is no ARFF: it has no line @data")


def _attribute(where: str, line: str) -> tuple[str, frozenset[str] | None]:
    match = _ATTRIBUTE.match(line)
    if match is None:
        raise TableError(f"{where}: an attribute has a name and a type: {line!r}")
    name, kind = _unquote(match[1]), match[2].strip()
    if kind.split()[0].lower() in _NUMERIC:
        return name, None
    if not kind.startswith("{") or "}" not in kind:
        raise TableError(f"{where}: attribute {name!r} is {kind}; only numeric and nominal ones are read")
    return name, frozenset(map(_unquote, _VALUE.findall(kind)))


def _values(where: str, line: str, width: int) -> list[str]:
    if not any(sign in line for sign in "'\"{}%"):
        values = line.replace(",", " ").split()
    elif _VALUE.sub("", line).strip(", \t"):
        sparse = ": sparse rows are not read" if line.startswith("{") else ""
        raise TableError(f"{where} cannot be read as values{sparse}: {line[:60]!r}")
    else:
        values = list(map(_unquote, _VALUE.findall(line)))
    if len(values) != width:
        raise TableError(f"{where} has {len(values)} values, the header {width} attributes")
    return values


def _unquote(value: str) -> str:
    return re.sub(r"\\(.)", r"\1", value[1:-1]) if value[0] in "'\"" else value
