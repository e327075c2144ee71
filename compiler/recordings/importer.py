"""A table and its columns.toml into a `GraspSet`, and a report of what was found, and what coding cost, on the way."""

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from heapq import nsmallest
from operator import itemgetter
from pathlib import Path
from typing import Generic, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import SHOWN, fault, list_names, shortened

from ..text import text_of
from .arrays import AnyArray
from .columns import Columns, JointColumns, Selection, read_columns, select
from .errors import TYPES, ColumnsError, RecordingError, TableError, check_room, list_rows
from .graspset import CODES, GraspSet, Joint
from .summary import Finding, find_oddities
from .table import Column, Table, pieces, read_table
from .taxonomy import Taxonomy, own, published

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


# Where the second point of a grid's straight line lies: so far out that its step is the grid to a bit or two.
_FAR = 1000


class CodingCost(msgspec.Struct, frozen=True):
    """What coding one joint lost: errors in `unit`, distinct values before and after."""

    joint: str
    unit: str
    step: float
    largest_error: float
    rms_error: float
    distinct_before: int
    distinct_after: int


def code_joint(
    name: str, entry: JointColumns, values: NDArray[np.float64], rows: NDArray[np.int64]
) -> tuple[NDArray[np.uint16], Joint, CodingCost]:
    """Return the codes (n,) of one column of finite `values` (n,), their calibration, and their cost.

    Raises TableError naming the first of `rows` whose code lies outside 0..65535; RecordingError if the calibration is
    no straight line.
    """
    joint = _joint(name, entry, float(values.min()))
    codes = values if entry.codes else joint.code(values)
    outside = (codes < 0) | (codes >= CODES)
    if outside.any():
        cause = "check origin and calibration" if (codes < 0).any() else "take a coarser grid"
        raise TableError(f"joint {name!r}: {list_rows(rows[outside])} would get codes outside 0..{CODES - 1}: {cause}")
    errors = np.zeros(1) if entry.codes else np.abs(joint.value(codes) - values)
    step = abs(joint.step)
    cost = CodingCost(
        joint=name,
        unit=joint.unit,
        step=step,
        largest_error=float(errors.max()),
        # In steps, whose squares are neither too large nor too small for a double.
        rms_error=math.sqrt(float(np.mean((errors / step) ** 2))) * step,
        distinct_before=len(np.unique(values)),
        distinct_after=len(np.unique(codes)),
    )
    return codes.astype(np.uint16), joint, cost


def _joint(name: str, entry: JointColumns, least: float) -> Joint:
    if entry.calibration is not None:
        points = entry.calibration
        return Joint(name, entry.unit, points.code_a, points.value_a, points.code_b, points.value_b)
    if entry.codes:
        return Joint(name, entry.unit, 0, 0.0, 1, 1.0)
    steps = least / entry.step
    # Where the grid cannot be counted, no Joint will have it either.
    floor = math.floor(steps) * entry.step if math.isfinite(steps) else least
    origin = floor if entry.origin is None else entry.origin
    return Joint(name, entry.unit, 0, origin, _FAR, origin + _FAR * entry.step)


class ImportReport(msgspec.Struct, frozen=True):
    """What `thenar import` says: what is in the set, what coding cost per joint, and what is odd."""

    table: str
    rows: int
    subjects: int
    objects: int
    grasp_types: int
    taxonomy: str
    switches: int
    joints: int
    coding: tuple[CodingCost, ...]
    warnings: tuple[Finding, ...]


def import_file(table: Path, columns: Path) -> tuple[GraspSet, ImportReport]:
    """Import the table in file `table` as the columns.toml in file `columns` says.

    Raises TableError, ColumnsError or RecordingError, naming file, rows and columns; OSError as it comes.
    """
    wanted = read_columns(columns)
    return import_table(read_table(table, wanted.delimiter), wanted)


def import_table(table: Table, columns: Columns) -> tuple[GraspSet, ImportReport]:
    """Import `table` as `columns` says; raises TableError, ColumnsError or RecordingError."""
    selection = select(columns, list(table.columns))
    readings, dropped = read_cells(table, columns, selection)
    grasps, taxonomy, aliases = _labels(table, columns, readings)
    joints = [
        code_joint(name, entry, readings.joints[:, column], readings.rows)
        for column, (name, entry) in enumerate(selection.joints)
    ]
    empty = np.zeros((len(grasps), 0), np.uint16)
    grasp_set = GraspSet(
        switches=readings.switches,
        switch_names=selection.switches,
        codes=np.stack([codes for codes, _, _ in joints], axis=1) if joints else empty,
        joints=tuple(joint for _, joint, _ in joints),
        grasps=grasps,
        taxonomy=taxonomy,
        subjects=readings.subjects,
        objects=readings.objects,
        trials=readings.trials,
    )
    warnings = (*dropped, *aliases, *find_oddities(grasp_set, readings.rows))
    return grasp_set, report_of(table.what, grasp_set, tuple(cost for _, _, cost in joints), warnings)


def report_of(
    what: str, grasp_set: GraspSet, coding: tuple[CodingCost, ...], warnings: tuple[Finding, ...]
) -> ImportReport:
    """Return what is to be said of `grasp_set`, which was imported from `what`."""
    return ImportReport(
        table=what,
        rows=len(grasp_set),
        subjects=len(np.unique(grasp_set.subjects)),
        objects=len(np.unique(grasp_set.objects)),
        grasp_types=len(np.unique(grasp_set.labels)),
        taxonomy=grasp_set.taxonomy.name,
        switches=len(grasp_set.switch_names),
        joints=len(grasp_set.joints),
        coding=coding,
        warnings=warnings,
    )


def _labels(table: Table, columns: Columns, readings: Readings) -> tuple[NDArray[np.str_], Taxonomy, list[Finding]]:
    """Return each row's grasp type, the taxonomy, and the aliases that nobody needed."""
    found, where = np.unique(readings.labels, return_inverse=True)
    if len(found) > TYPES:
        raise TableError(
            f"{table.what}: column {shortened(repr(columns.label))} holds {len(found)} different labels, "
            f"more than {TYPES}: is it the label?"
        )
    aliased = [columns.labels.get(label, label) for label in found.tolist()]
    taxonomy = _taxonomy(columns, aliased)
    find = taxonomy.finder()
    types = [find(label) for label in aliased]
    unknown = np.array([name is None for name in types])[where]
    if unknown.any():
        label = aliased[where[np.flatnonzero(unknown)[0]]]
        raise TableError(
            f"{table.what}: {unknown.sum()} unknown labels in {shortened(repr(columns.label))}, "
            f"{list_rows(readings.rows[unknown])}; "
            f"{shortened(repr(label))} is no grasp type of {taxonomy.name}{taxonomy.suggestion(label)}; "
            "[labels] can translate it"
        )
    unused = sorted(columns.labels.keys() - set(found.tolist()))
    message = f"{len(unused)} entries of [labels] occur in no row: {list_names(unused)}"
    check_room(len(where), max(map(len, filter(None, types))), table.size)
    return (
        np.array(types, np.str_)[where],
        taxonomy,
        [Finding("unused aliases", len(unused), message)] if unused else [],
    )


def _taxonomy(columns: Columns, labels: list[str]) -> Taxonomy:
    try:
        if isinstance(columns.taxonomy, tuple):
            return own(columns.taxonomy)
        return own(sorted(set(labels))) if columns.taxonomy == "own" else published(columns.taxonomy)
    except RecordingError as reason:
        raise ColumnsError(f"taxonomy: {reason}") from reason
