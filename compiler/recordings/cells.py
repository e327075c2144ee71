"""Cells of a table: as numbers, bits or names; what is missing or wrong is marked, and the first of it named."""

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from heapq import nsmallest
from operator import itemgetter
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import SHOWN, fault, list_names, shortened

from .arrays import AnyArray
from .columns import Columns, Selection
from .errors import RecordingError, TableError, check_room, list_rows
from .graspset import CODES
from .spreadsheet import text_of
from .summary import Finding
from .table import Column, Table, pieces

MISSING_NUMBERS = frozenset({"", "?", "na", "nan"})
MISSING_NAMES = frozenset({"", "?"})

_BITS = {"true": 1.0, "false": 0.0}
_PIECE = 1 << 14

Value = TypeVar("Value", bound=np.generic)


@dataclass(frozen=True, slots=True)
class Parsed(Generic[Value]):
    """One column: (n,) `values`, and which cells are missing and which are wrong, (n,) bool each."""

    values: NDArray[Value]
    missing: NDArray[np.bool_]
    wrong: NDArray[np.bool_]


def numbers(column: Column) -> Parsed[np.float64]:
    """Read `column` as finite numbers; missing: empty, ?, NA, NaN; wrong: anything else, and infinity."""
    return _parsed(column, {})


def bits(column: Column) -> Parsed[np.bool_]:
    """Read `column` as bits: 0, 1, 0.0, 1.0, true, false; missing as in `numbers`, wrong: anything else."""
    parsed = _parsed(column, _BITS)
    values = parsed.values == 1
    return Parsed(values, parsed.missing, parsed.wrong | ~(parsed.missing | values | (parsed.values == 0)))


def integers(column: Column) -> Parsed[np.float64]:
    """Read `column` as whole numbers within +-2^53; missing as in `numbers`, wrong: anything else."""
    parsed = numbers(column)
    values = np.where(parsed.missing | parsed.wrong, 0, parsed.values)
    return Parsed(values, parsed.missing, parsed.wrong | (values != np.rint(values)) | (np.abs(values) > 2**53))


def codes(column: Column) -> Parsed[np.float64]:
    """Read `column` as codes 0..65535; missing as in `numbers`, wrong: anything else."""
    parsed = integers(column)
    return Parsed(parsed.values, parsed.missing, parsed.wrong | (parsed.values < 0) | (parsed.values >= CODES))


def names(column: Column, cells: bool = False, size: int = 0) -> Parsed[np.str_]:
    """Read `column` as names without outer blanks; missing: empty and ?, wrong: by the rule of names. With `cells` they
    are written as cells of a spreadsheet.

    Numbers are names too, but for NaN, which is missing, and infinity, which is wrong. Whole ones read as such: 3, not
    3.0. Raises RecordingError where the names are too long for so many rows of a file of `size` bytes.
    """
    missing, wrong = (np.zeros(len(column), np.bool_) for _ in range(2))
    found: list[NDArray[np.str_]] = []
    start = longest = 0
    for texts, faulty in _names(column, cells):
        longest = max(longest, *map(len, texts))
        check_room(len(column), longest, size)
        found.append(np.array(texts, np.str_))
        end = start + len(texts)
        for mask, these in (missing, MISSING_NAMES), (wrong, faulty):
            if not these.isdisjoint(texts):
                mask[start:end] = [text in these for text in texts]
        start = end
    return Parsed(np.concatenate(found) if found else np.zeros(0, np.str_), missing, wrong)


def _names(column: Column, cells: bool) -> Iterator[tuple[list[str], set[str]]]:
    """Yield the names in a column, piece by piece, and those of the piece that are wrong."""
    if isinstance(column, np.ndarray) and column.dtype.kind != "U":
        values = _floats(column)
        for start in range(0, len(values), _PIECE):
            texts = list(map(_name_of_number, values[start : start + _PIECE].tolist()))
            yield texts, {text for text in texts if text.endswith("inf")}
        return
    for piece in pieces(column):
        texts = [text_of(cell.strip()) if cells else cell.strip() for cell in piece]
        # Looked up as str: an array of them would lose NULs at their ends.
        yield texts, {text for text in {*texts} - MISSING_NAMES if fault(text)}


def _name_of_number(number: float) -> str:
    if math.isnan(number):
        return ""
    # Adding zero makes -0.0 the 0.0 that it equals.
    return np.format_float_positional(number + 0.0, trim="-")


def _parsed(column: Column, words: dict[str, float]) -> Parsed[np.float64]:
    """Return the cells as floats, NaN where one is missing or wrong; `words` are read besides numbers."""
    if isinstance(column, np.ndarray) and column.dtype.kind != "U":
        values = _floats(column)
        missing = np.isnan(values)
    else:
        values, missing = np.empty(len(column)), np.zeros(len(column), np.bool_)
        start = 0
        for texts in pieces(column):
            end = start + len(texts)
            values[start:end] = _numbers(texts, words)
            for row in np.flatnonzero(np.isnan(values[start:end])).tolist():
                missing[start + row] = texts[row].strip().casefold() in MISSING_NUMBERS
            start = end
    return Parsed(values, missing, (np.isnan(values) & ~missing) | np.isinf(values))


def _floats(column: AnyArray) -> NDArray[np.float64]:
    # A number too large for a double becomes infinite, and is refused with its row.
    with np.errstate(over="ignore"):
        return column.astype(np.float64)


def _numbers(cells: list[str], words: dict[str, float]) -> NDArray[np.float64]:
    try:
        # All at once is several times faster; float() would read 1_000 as a thousand.
        values = np.array(cells, dtype=np.float64)
        return values if not any("_" in cell for cell in cells) else _one_by_one(cells, words)
    except ValueError:
        return _one_by_one(cells, words)


def _one_by_one(cells: list[str], words: dict[str, float]) -> NDArray[np.float64]:
    values = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        word = cell.strip().casefold()
        if word in words:
            values[row] = words[word]
        elif word not in MISSING_NUMBERS and "_" not in word:
            with suppress(ValueError):
                values[row] = float(word)
    return values


@dataclass(frozen=True, slots=True)
class Readings:
    """What a table holds for a GraspSet: n rows by the numbers the user knows; (n, j) values or codes of the joints."""

    rows: NDArray[np.int64]
    labels: NDArray[np.str_]
    subjects: NDArray[np.str_]
    objects: NDArray[np.str_]
    trials: NDArray[np.int64]
    switches: NDArray[np.bool_]
    joints: NDArray[np.float64]


def read_cells(table: Table, columns: Columns, selection: Selection) -> tuple[Readings, list[Finding]]:
    """Return what `table` holds, and a finding if rows with missing values were dropped.

    Columns that the user does not name are "1" throughout. Raises TableError naming the first wrong or missing cells
    and their number.
    """
    reader = _Reader(table)
    labels = reader.names(columns.label)
    subjects, objects = reader.names(columns.subject), reader.names(columns.object)
    trials = np.ones(len(table.rows))
    if columns.trial is not None:
        trials = reader.read(columns.trial, integers, "whole numbers")
    # Read into place, and in columns, so that a large table is in memory only once.
    rows = len(table.rows)
    switches = np.empty((rows, len(selection.switches)), np.bool_, order="F")
    for number, name in enumerate(selection.switches):
        switches[:, number] = reader.read(name, bits, "0 or 1")
    joints = np.empty((rows, len(selection.joints)), order="F")
    for number, (name, entry) in enumerate(selection.joints):
        parse, expected = (codes, "codes 0..65535") if entry.codes else (numbers, "finite numbers")
        joints[:, number] = reader.read(name, parse, expected)
    keep = reader.complete(drop=columns.missing == "drop")
    readings = Readings(
        rows=_kept(table.rows, keep),
        labels=_kept(labels, keep),
        subjects=_kept(subjects, keep),
        objects=_kept(objects, keep),
        trials=_kept(trials, keep).astype(np.int64),
        switches=_kept(switches, keep),
        joints=_kept(joints, keep),
    )
    return readings, reader.dropped(keep)


def _kept(array: NDArray[Value], keep: NDArray[np.bool_]) -> NDArray[Value]:
    """Return the rows of a 1-D or 2-D `array` that are to be kept; the array itself where all are."""
    if keep.all():
        return array
    if array.ndim == 1:
        return array[keep]
    count = int(keep.sum())
    for column in array.T:
        column[:count] = column[keep]
    return array[:count]


class _Reader:
    """Reads columns of one table and keeps account of the cells that are missing or wrong."""

    def __init__(self, table: Table) -> None:
        self.table = table
        self.missing: dict[str, NDArray[np.bool_]] = {}
        self.wrong: dict[str, dict[str, NDArray[np.bool_]]] = {}

    def read(self, name: str, parse: Callable[[Column], Parsed[Value]], expected: str) -> NDArray[Value]:
        parsed = parse(self.table.columns[name])
        if parsed.missing.any():
            self.missing[name] = parsed.missing
        if parsed.wrong.any():
            self.wrong.setdefault(expected, {})[name] = parsed.wrong
        return parsed.values

    def names(self, column: str | None) -> NDArray[np.str_]:
        if column is None:
            return np.full(len(self.table.rows), "1")
        parse = partial(names, cells=self.table.cells, size=self.table.size)
        try:
            return self.read(column, parse, "names that can be printed")
        except RecordingError as reason:
            raise TableError(f"{self.table.what}: column {shortened(repr(column))}: {reason}") from reason

    def complete(self, drop: bool) -> NDArray[np.bool_]:
        """Return which rows miss nothing; raises TableError on wrong cells, and on missing ones unless `drop`."""
        faults = [f"not {expected}: {self._list(columns)}" for expected, columns in self.wrong.items()]
        if self.missing and not drop:
            faults.append(f'missing (missing = "drop" leaves their rows out): {self._list(self.missing)}')
        if faults:
            raise TableError(f"{self.table.what}: {'; '.join(faults)}")
        keep = np.ones(len(self.table.rows), np.bool_)
        for missing in self.missing.values():
            keep &= ~missing
        if not keep.any():
            raise TableError(f"{self.table.what}: every row misses a value: {self._list(self.missing)}")
        return keep

    def dropped(self, keep: NDArray[np.bool_]) -> list[Finding]:
        rows = self.table.rows[~keep]
        if not rows.size:
            return []
        lack = list_names(list(self.missing))
        message = f"{rows.size} rows with missing values were left out: {list_rows(rows)} (columns {lack})"
        return [Finding("dropped rows", int(rows.size), message, tuple(rows[:SHOWN].tolist()), tuple(self.missing))]

    def _list(self, columns: dict[str, NDArray[np.bool_]]) -> str:
        """Return "3 cells, ...": how many cells, and the first of them in the order of rows, then of columns."""
        count = sum(int(faulty.sum()) for faulty in columns.values())
        each = ((row, name) for name, faulty in columns.items() for row in np.flatnonzero(faulty)[:SHOWN].tolist())
        first = nsmallest(SHOWN, each, key=itemgetter(0))
        cells = [(row, name, shortened(repr(str(self.table.columns[name][row])))) for row, name in first]
        shown = [f"row {self.table.rows[row]} {shortened(repr(name))} ({cell})" for row, name, cell in cells]
        return f"{count} cell{'s' if count > 1 else ''}, {list_names(shown, count)}"
