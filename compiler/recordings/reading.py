"""The cells of a table that a columns.toml asks for, checked: the first faults are named by row and column."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from heapq import nsmallest
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from .cells import Parsed, Value, bits, codes, integers, names, numbers
from .columns import Columns, Selection
from .errors import RecordingError, TableError
from .findings import Finding
from .names import SHOWN, list_names, list_rows, shortened
from .table import Column, Table


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
