"""Labelled grasps: the set, its file format, imports and exports; here errors, size limits of files, rules for names.

Needs only the base dependencies. Within the limits, reading a file of n bytes takes at most 220 MB + 20 n of memory.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.dtypes import StringDType
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError
from thenar.runtime.names import SHOWN, fault, list_names, shortened


class RecordingError(ThenarError, ValueError):
    """A set of grasps is inconsistent, has a label that is not in its taxonomy, or lacks movements where they count."""


class TableError(ThenarError, ValueError):
    """A table or its columns.toml cannot be read, or one does not fit the other."""


LARGEST = 1_000_000_000  # bytes of a table, also when it is unpacked
# Bytes that a packed table may unpack to: a constant, plus a multiple of its file size.
UNPACKED = 6_000_000
UNPACKED_EACH = 1
LONGEST_LINE = 16_000_000  # characters
ROWS = 1_000_000
LINES = 2 * ROWS  # of text, with empty ones, comments and line breaks in cells
COLUMNS = 100_000
TYPES = 100_000  # grasp types, and values that an ARFF lists
# Bytes that the names of grasp types, subjects or objects may take as an array, four per character: a constant, plus a
# multiple of their file size.
NAMES = 10_000_000
NAMES_EACH = 2


def unpacked(size: int) -> int:
    """Return the number of bytes that a packed table in a file of `size` bytes may unpack to."""
    return min(LARGEST, UNPACKED + UNPACKED_EACH * size)


def check_names(what: str, names: Iterable[str]) -> None:
    """Raise RecordingError unless `names` are distinct and valid by the rules of `fault`."""
    seen: set[str] = set()
    for name in names:
        if reason := fault(name):
            raise RecordingError(f"{what} {shortened(repr(name))} {reason}")
        if name in seen:
            raise RecordingError(f"{what} {shortened(repr(name))} occurs twice")
        seen.add(name)


def check_room(rows: int, longest: int, size: int) -> None:
    """Raise RecordingError if names of at most `longest` characters, one per row, need too much memory.

    An array of text gives every row the space of the longest. `size` is the size of their file in bytes.
    """
    if 4 * rows * longest > NAMES + NAMES_EACH * size:
        raise RecordingError(f"a name of {longest} characters is too long in a table of {rows} rows: shorten it")


class FileRows(np.ndarray[tuple[int], np.dtype[np.int64]]):
    """Rows (n,) of a table that was read from several files, counted through all of them from 1.

    column  the table's column that names the file
    fields  the columns that the paths say
    """

    column: str
    fields: tuple[str, ...]
    _places: NDArray[np.generic]

    @classmethod
    def of(
        cls, files: Sequence[tuple[str, NDArray[np.int64]]], column: str, fields: tuple[str, ...] = ()
    ) -> "FileRows":
        """Return the rows of `files`, each a name and the numbers of its rows as the user sees them."""
        places = [f"{number} of {shortened(name)}" for name, rows in files for number in rows.tolist()]
        made = np.arange(1, len(places) + 1).view(cls)
        made.column, made.fields, made._places = column, fields, np.array(places, StringDType())
        return made

    def __array_finalize__(self, source: object) -> None:
        self.column, self.fields = getattr(source, "column", ""), getattr(source, "fields", ())
        self._places = getattr(source, "_places", np.empty(0))

    def shown(self) -> list[str]:
        """Return each row as its number in its file, and the file."""
        places: list[str] = self._places[self - 1].tolist()
        return places


def list_rows(rows: NDArray[np.int64]) -> str:
    """Return "row 3" or "rows 3, 4, 5, 6, 7 and 7 more"; with their files if there are several."""
    first = rows[:SHOWN]
    shown = first.shown() if isinstance(first, FileRows) else first.astype(str).tolist()
    return f"row{'s' if len(rows) > 1 else ''} {list_names(shown, len(rows))}"
