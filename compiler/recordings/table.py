"""Tables as they come: CSV, CSV.gz, npz here, ARFF in arff.py; out come named columns of text or numbers."""

import csv
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .arrays import AnyArray
from .errors import RecordingError, TableError
from .limits import COLUMNS, ROWS
from .names import check_names, list_names
from .npz import read_arrays
from .opening import open_lines
from .spreadsheet import text_of
from .texts import TextRows

# Text as it was read, or an array of numbers or of str.
Column = Sequence[str] | AnyArray


@dataclass(frozen=True, slots=True)
class Table:
    """Named columns of equal length: text as it was read, or numbers, NaN where one is missing.

    `rows` are the rows' numbers as the user sees them: the line in a CSV, counted from 1 elsewhere. `size` is how many
    bytes its file has. `cells` says that names are written as cells of a spreadsheet.
    """

    what: str
    columns: Mapping[str, Column]
    rows: NDArray[np.int64]
    size: int = 0
    cells: bool = False


def read_table(path: Path, delimiter: str = ",") -> Table:
    """Read a table by its suffix: .csv, .csv.gz, .arff, .arff.gz, .npz.

    Raises TableError naming the file, the row and what is wrong with it; OSError as the operating system gives it.
    """
    suffixes = "".join(path.suffixes[-2:]).lower()
    try:
        if path.suffix.lower() == ".npz":
            table = _read_npz(path)
        elif suffixes.endswith((".arff", ".arff.gz")):
            from .arff import read_arff

            with open_lines(path) as lines:
                table = read_arff(path.name, lines)
        elif suffixes.endswith((".csv", ".csv.gz")):
            with open_lines(path) as lines:
                table = _read_csv(path.name, lines, delimiter)
        else:
            raise TableError(f"{path.name}: a table ends in .csv, .csv.gz, .arff, .arff.gz or .npz")
        check_names("column", table.columns)
    except RecordingError as reason:
        raise TableError(f"{path.name}: {reason}") from reason
    if not len(table.rows):
        raise TableError(f"{path.name} has no rows")
    return replace(table, size=path.stat().st_size)


def _read_csv(what: str, lines: Iterator[str], delimiter: str) -> Table:
    reader = csv.reader(_narrow(what, lines, delimiter), delimiter=delimiter, strict=True)
    rows = array("q")
    try:
        filled = filter(None, reader)
        names = [text_of(name.strip()) for name in next(filled, [])]
        cells = TextRows(len(names))
        for row in filled:
            if len(row) != len(names):
                raise TableError(f"{what} row {reader.line_num} has {len(row)} cells, its header {len(names)}")
            rows.append(reader.line_num)
            if len(rows) > ROWS:
                raise TableError(f"{what} has more than {ROWS} rows, the most that are read of a table")
            cells.append(row)
    except csv.Error as reason:
        raise TableError(f"{what} row {reader.line_num}: {reason}") from reason
    if "" in names:
        raise TableError(f"{what}: column {names.index('') + 1} has no name in the header: give it one")
    check_names("column", names)
    columns = dict(zip(names, cells.columns(), strict=True))
    return Table(what, columns, np.frombuffer(rows, np.int64), cells=True)


def _narrow(what: str, lines: Iterable[str], delimiter: str) -> Iterator[str]:
    """Yield `lines` as long as none has more cells than a table may have columns."""
    for line in lines:
        if line.count(delimiter) >= COLUMNS:
            raise TableError(f"{what} has more than {COLUMNS} columns, the most that are read of a table")
        yield line


def _read_npz(path: Path) -> Table:
    columns = read_arrays(path)
    if not columns:
        raise TableError(f"{path.name}: it holds no arrays")
    lengths = {len(column) for column in columns.values()}
    if len(lengths) > 1:
        raise TableError(f"{path.name}: its arrays have {list_names(list(map(str, sorted(lengths))))} rows, no table")
    return Table(path.name, columns, np.arange(1, lengths.pop() + 1))
