"""Tables as they come: CSV, CSV.gz, npz here, ARFF in arff.py; out come named columns of text or numbers."""

import csv
import gzip
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import TextIOWrapper
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from .arrays import UNREADABLE
from .errors import RecordingError, TableError
from .names import check_names
from .spreadsheet import text_of

Column = Sequence[str] | NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Table:
    """Named columns of equal length: text as it was read, or numbers with NaN where one is missing.

    `rows` are the rows' numbers as the user sees them: the line in a CSV, counted from 1 elsewhere. `cells` says that
    names are written as cells of a spreadsheet.
    """

    what: str
    columns: Mapping[str, Column]
    rows: NDArray[np.int64]
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

            with _open_text(path) as lines:
                table = read_arff(path.name, lines)
        elif suffixes.endswith((".csv", ".csv.gz")):
            with _open_text(path) as lines:
                table = _read_csv(path.name, lines, delimiter)
        else:
            raise TableError(f"{path.name}: a table ends in .csv, .csv.gz, .arff, .arff.gz or .npz")
        check_names("column", table.columns)
    except RecordingError as reason:
        raise TableError(f"{path.name}: {reason}") from reason
    if not len(table.rows):
        raise TableError(f"{path.name} has no rows")
    return table


@contextmanager
def _open_text(path: Path) -> Iterator[TextIO]:
    """Open a text file, gzipped or not, behind its byte order mark; what is wrong inside becomes a TableError."""
    zipped = path.suffix.lower() == ".gz"
    try:
        with path.open("rb") as raw, TextIOWrapper(gzip.open(raw) if zipped else raw, "utf-8-sig", newline="") as text:
            yield text
    except (gzip.BadGzipFile, EOFError, zlib.error) as reason:
        raise TableError(f"{path.name} is damaged: {reason}") from reason
    except UnicodeDecodeError as reason:
        raise TableError(f"{path.name} is not UTF-8 text: {reason.reason}; save it as UTF-8") from reason


def _read_csv(what: str, lines: TextIO, delimiter: str) -> Table:
    reader = csv.reader(lines, delimiter=delimiter, strict=True)
    rows: list[int] = []
    cells: list[list[str]] = []
    try:
        filled = filter(None, reader)
        names = [text_of(name.strip()) for name in next(filled, [])]
        for row in filled:
            if len(row) != len(names):
                raise TableError(f"{what} row {reader.line_num} has {len(row)} cells, its header {len(names)}")
            rows.append(reader.line_num)
            cells.append(row)
    except csv.Error as reason:
        raise TableError(f"{what} row {reader.line_num}: {reason}") from reason
    if "" in names:
        raise TableError(f"{what}: column {names.index('') + 1} has no name in the header: give it one")
    check_names("column", names)
    return Table(
        what, dict(zip(names, zip(*cells, strict=True), strict=bool(cells))), np.array(rows, np.int64), cells=True
    )


def _read_npz(path: Path) -> Table:
    columns: dict[str, Column] = {}
    try:
        with zipfile.ZipFile(path) as members:
            for info in members.infolist():
                found = _columns_of(info.filename.removesuffix(".npy"), _read_member(members, info))
                if twice := columns.keys() & found.keys():
                    raise TableError(f"two arrays make a column {min(twice)!r}")
                columns |= found
    except UNREADABLE as reason:
        raise TableError(f"{path.name} cannot be read as npz: {reason}") from reason
    lengths = {len(column) for column in columns.values()}
    if len(lengths) != 1:
        raise TableError(f"{path.name}: its arrays have {sorted(lengths)} rows, which makes no table")
    return Table(path.name, columns, np.arange(1, lengths.pop() + 1))


def _read_member(members: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[np.generic]:
    # Not by numpy.load, which answers a file that is no zip, or a member that is no array, with something else.
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise TableError(f"{info.filename} is not compressed as numpy.savez does")
    with members.open(info) as file:
        array: NDArray[np.generic] = npy.read_array(file, allow_pickle=False)
    return array


def _columns_of(key: str, array: NDArray[np.generic]) -> dict[str, Column]:
    """Return a 1-D array as the column `key`, a 2-D array as the columns `key`.0, `key`.1 and on."""
    if array.ndim not in (1, 2):
        raise TableError(f"array {key!r} has {array.ndim} dimensions: a column has one, several have two")
    named = {key: array} if array.ndim == 1 else {f"{key}.{i}": array[:, i] for i in range(array.shape[1])}
    return {name: _column(name, column) for name, column in named.items()}


def _column(name: str, array: NDArray[np.generic]) -> Column:
    if array.dtype.kind == "S":
        return [cell.decode() for cell in array.tolist()]
    if array.dtype.kind == "U":
        return [str(cell) for cell in array.tolist()]
    if array.dtype.kind in "biuf":
        # What is too large for a double becomes infinite, and is refused with its row where it is read.
        with np.errstate(over="ignore"):
            return array.astype(np.float64)
    raise TableError(f"array {name!r} holds {array.dtype}: neither numbers nor text")
