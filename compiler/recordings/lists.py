"""Columns whose cells hold lists of numbers become several columns, as those of Parquet files do."""

import re
from collections.abc import Mapping, Sequence
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import shortened

from .arrays import AnyArray
from .errors import COLUMNS, TableError, check_names
from .headers import MISSING_NUMBERS

Column = Sequence[str] | AnyArray

# A list as pandas and numpy write it, with commas or blanks, and a number of numpy in it.
_LIST = re.compile(r"[\[(](.*)[\])]", re.DOTALL)
_SCALAR = re.compile(r"np\.\w+\(([^()]*)\)")
_PIECE = 1 << 14


def unlisted(what: str, columns: Mapping[str, Column], rows: NDArray[np.int64]) -> dict[str, Column]:
    """Return `columns` with lists such as "[0.56, 0.83]" in the cells of `data` as columns data.0, data.1, ...

    what  the table in messages
    rows  (n,) the numbers of its rows in messages

    Raises TableError if a column holds lists that are unequally long, or lists and other cells; RecordingError if two
    columns get one name.
    """
    made: list[tuple[str, Column]] = []
    for name, column in columns.items():
        is_text = not isinstance(column, np.ndarray) or column.dtype.kind == "U"
        first = next((cell for cell in column if cell), "") if is_text else ""
        if not _numbers(str(first)):
            made.append((name, column))
            continue
        values = _values(f"{what}: column {shortened(repr(name))}", column, rows)
        many = values.shape[1] > 1
        made += [(f"{name}.{place}" if many else name, part) for place, part in enumerate(values.T)]
    if len(made) != len(columns):
        check_names("column", [name for name, _ in made])
        if len(made) > COLUMNS:
            raise TableError(f"{what} has more than {COLUMNS} columns, the most that are read of a table")
    return dict(made)


def _values(where: str, column: Column, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the numbers (n, k) of lists of k, NaN for missing ones. Raises TableError."""
    cells = ((row, str(cell)) for row, cell in enumerate(column))
    first_row, first = next((row, found) for row, cell in cells if (found := _numbers(cell)))
    parts = [np.full((first_row, len(first)), np.nan), np.array([first])]
    while piece := list(islice(cells, _PIECE)):
        lists = []
        for row, cell in piece:
            found = _numbers(cell) if cell.strip() else []
            if found is None:
                shown = f"but row {rows[row]} has {shortened(repr(cell))}: write each list whole"
                raise TableError(f"{where} holds lists of numbers, {shown}")
            if len(found) not in (0, len(first)):
                shown = f"{len(first)} in row {rows[first_row]} and {len(found)} in row {rows[row]}"
                raise TableError(f"{where} holds lists of unequal lengths, {shown}: write lists of one length")
            lists.append(found or [np.nan] * len(first))
        parts.append(np.array(lists))
    return np.concatenate(parts)


def _numbers(cell: str) -> list[float] | None:
    """Return the numbers of a list, or None if `cell` is no list of numbers."""
    inner = _LIST.fullmatch(cell.strip())
    if inner is None:
        return None
    parts = _SCALAR.sub(r"\1", inner[1]).replace(",", " ").split()
    try:
        return [np.nan if part.casefold() in MISSING_NUMBERS else float(part) for part in parts]
    except ValueError:
        return None
