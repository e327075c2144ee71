"""Read the columns of a table as rows of trials: labels, switches and joints, with missing cells filled or left out."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from heapq import nsmallest
from operator import itemgetter

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import SHOWN, list_names, shortened
from thenar.runtime.published import NONE
from thenar.runtime.recording.reader import Oddity

from ..arrays import groups, latest, otsu, places
from . import RecordingError, TableError, check_room, list_rows
from .cells import NUMBER, Parsed, Value, bits, codes, integers, names, natural_key, numbers, times, unit_of_time
from .columns import KEYS, ColumnRoles, Selection
from .table import Table
from .taxonomy import plain


@dataclass(frozen=True, slots=True)
class Readings:
    """The content of a table: n rows with the numbers that the user sees; values or codes (n, j) of the joints.

    `time` is in the table's unit, 0 throughout if there is none.
    """

    rows: NDArray[np.int64]
    labels: NDArray[np.str_]
    subjects: NDArray[np.str_]
    objects: NDArray[np.str_]
    sessions: NDArray[np.str_]
    trials: NDArray[np.int64]
    time: NDArray[np.float64]
    switches: NDArray[np.bool_]
    joints: NDArray[np.float64]

    def kept(self, keep: NDArray[np.bool_] | NDArray[np.intp]) -> "Readings":
        """Return the rows selected by `keep`, a mask or indices; two-dimensional arrays are overwritten."""
        return Readings(**{name: _kept(getattr(self, name), keep) for name in self.__slots__})

    def trial_ids(self) -> NDArray[np.intp]:
        """Return the trial number (n,) of each row."""
        return groups(self.labels, self.subjects, self.objects, self.sessions, self.trials)


def read_cells(
    table: Table, columns: ColumnRoles, selection: Selection
) -> tuple[Readings, NDArray[np.int64], list[Oddity], list[str]]:
    """Return the content of `table`, its times in microseconds (none if unknown), oddities, and notes on conversions.

    Columns that are not named are "1" throughout. Raises TableError naming the first wrong or missing cells and their
    number.
    """
    reader = _Reader(table, columns)
    notes: list[str] = []
    labels = reader.names(columns.parts("label"))
    readings = Readings(
        rows=table.rows,
        labels=labels,
        subjects=reader.names(columns.parts("subject")),
        objects=reader.names(columns.parts("object")),
        sessions=reader.names(columns.parts("session")),
        trials=reader.trials(columns.parts("trial"), notes),
        time=reader.time(columns.time),
        switches=reader.switches(selection, notes),
        joints=reader.joints(selection),
    )
    none = nothing_held(columns, labels)
    reader.fill_from_next_grasp(readings, none, columns)
    keep = reader.complete(columns.missing)
    warnings = reader.dropped(readings, keep)
    missing = {name: mask[keep] for name, mask in reader.missing.items()}
    readings, none = readings.kept(keep), none[keep]
    untold = columns.frames is None and not columns.parts("trial")
    if untold and none.any() and in_runs(readings.labels, readings.subjects, readings.objects, readings.sessions):
        notes.append('a run of rows of one label was taken for a trial: frames = "restart" says so')
        untold, columns = False, msgspec.structs.replace(columns, frames="restart")
    if columns.frames == "restart":
        readings = replace(readings, trials=_runs(readings, none, columns.time is None))
    independent = columns.frames == "independent"
    trial_ids = np.arange(len(readings.rows)) if independent else readings.trial_ids()
    if untold and (shared := int((np.bincount(trial_ids)[trial_ids] > 1).sum())):
        raise TableError(
            f"{table.what}: {shared} rows share subject, grasp type, object and session with others, and nothing says "
            "which of them are frames of one trial: name the column that does (`trial = ...`, or a list of them), or "
            'state that each row is a separate trial (`frames = "independent"`)'
        )
    if columns.time is not None:
        order = in_time(trial_ids, readings.time)
        readings = readings.kept(order)
        missing = {name: mask[order] for name, mask in missing.items()}
    warnings += _filled(table, readings, selection, missing, trial_ids)
    micros = _micros(table, columns, readings.time, notes)
    times_us = np.rint(readings.time * micros).astype(np.int64) if micros else np.empty(0, np.int64)
    return readings, times_us, warnings, notes


def _micros(table: Table, columns: ColumnRoles, time: NDArray[np.float64], notes: list[str]) -> float:
    """Return the number of microseconds in the unit of `time`, 0.0 if there is no time or its unit is unknown.

    Raises TableError if a time is too large.
    """
    if columns.time is None:
        return 0.0
    unit = columns.time_unit or unit_of_time(columns.time, time)
    if unit is None or not np.isfinite(time).all():
        why = "its unit is not known (`time_unit`)" if unit is None else "some of its cells are missing"
        notes.append(f"{shortened(columns.time)} orders frames, but does not say when they were recorded: {why}")
        return 0.0
    micros = {"s": 1e6, "ms": 1e3, "us": 1.0, "ns": 1e-3}[unit]
    if np.abs(time).max(initial=0) * micros > 2**62:
        raise TableError(f"{table.what}: column {shortened(repr(columns.time))} holds times of more than 100,000 years")
    return micros


def nothing_held(columns: ColumnRoles, labels: NDArray[np.str_]) -> NDArray[np.bool_]:
    """Return which rows (n,) have a label that means, in general or by `columns`, that nothing is held."""
    types = next(iter(columns.taxonomy.values())) if isinstance(columns.taxonomy, dict) else columns.taxonomy
    meant = {*map(plain, columns.parts("none"))}
    if isinstance(types, str) or NONE not in map(plain, types):
        meant.add(NONE)
    found, where = np.unique(labels, return_inverse=True)
    pairs = zip(found.tolist(), meanings(columns, found.tolist()), strict=True)
    return np.array([not meant.isdisjoint(map(plain, pair)) for pair in pairs], np.bool_)[where]


def meanings(columns: ColumnRoles, labels: Sequence[str]) -> list[str]:
    """Return the names of labels by `columns`, under which a number is listed without decimals."""
    return [columns.labels.get(label, columns.labels.get(whole(label), label)) for label in labels]


def whole(label: str) -> str:
    """Return a whole number without its decimals, another label as it is."""
    return re.sub(r"(?<=\d)\.0+$", "", label) if NUMBER.fullmatch(label) else label


def _runs(readings: Readings, none: NDArray[np.bool_], timeless: bool) -> NDArray[np.int64]:
    """Return the trial number (n,) of each row; a trial starts where the clock starts again or anything else changes.

    Rows in which nothing is held have the number of the trial that follows.
    """
    time = np.arange(len(none), dtype=np.float64) if timeless else readings.time
    number = restarts(readings.trial_ids(), time)
    last = np.flatnonzero(np.diff(number))
    clock = restarts(np.zeros(len(none), np.intp), time)
    leads = none[last] & ~none[last + 1] & (clock[last] == clock[last + 1])
    for column in (readings.subjects, readings.sessions):
        leads &= column[last] == column[last + 1]
    return np.unique(number + np.pad(leads, (0, 1))[number - 1], return_inverse=True)[1] + 1


def _kept(values: NDArray[Value], keep: NDArray[np.bool_] | NDArray[np.intp]) -> NDArray[Value]:
    """Return the rows of 1-D or 2-D `values` selected by `keep`; the array itself if a mask selects all."""
    if keep.dtype == np.bool_ and keep.all():
        return values
    if values.ndim == 1:
        return values[keep]
    count = int(keep.sum()) if keep.dtype == np.bool_ else len(keep)
    for column in values.T:
        column[:count] = column[keep]
    return values[:count]


def _filled(
    table: Table,
    readings: Readings,
    selection: Selection,
    missing: dict[str, NDArray[np.bool_]],
    trial_ids: NDArray[np.intp],
) -> list[Oddity]:
    """Fill the cells of inputs that are `missing`, in place, and return a finding about them."""
    inputs = [name for name, _ in (*selection.switches, *selection.coded)]
    values = dict(zip(inputs, (*readings.switches.T, *readings.joints.T), strict=True))
    missing = {name: mask for name, mask in missing.items() if name in values and mask.any()}
    if not missing:
        return []
    if empty := [name for name, mask in missing.items() if mask.all()]:
        raise TableError(f"{table.what}: column {shortened(repr(empty[0]))} has no values: leave it out")
    cells = sum(int(mask.sum()) for mask in missing.values())
    strange = sum(fill(values[name], missing[name], trial_ids) for name in missing)
    rows = readings.rows[np.logical_or.reduce([*missing.values()])]
    message = (
        f"{cells} missing cells in {rows.size} rows were filled: {cells - strange} from the nearest frame of their "
        f"trial, {strange} with their column's median ({list_rows(rows)}; columns {list_names([*missing])})"
    )
    return [Oddity("filled cells", cells, message, tuple(rows[:SHOWN].tolist()), tuple(missing))]


_MISSING = 'missing (missing = "keep" fills them, "drop" leaves their rows out)'


class _Reader:
    """Reads columns of one table and records which cells are missing or wrong."""

    def __init__(self, table: Table, columns: ColumnRoles) -> None:
        self.table = table
        # Columns that a row must have: there is no substitute for their cells.
        self.needed = {name for key in KEYS if key != "time" for name in columns.parts(key)}
        self.missing: dict[str, NDArray[np.bool_]] = {}
        self.wrong: dict[str, dict[str, NDArray[np.bool_]]] = {}

    def _read(self, name: str, parse: "Callable[..., Parsed[Value]]", expected: str) -> NDArray[Value]:
        return self._noted(name, parse(self.table.columns[name], self.table.decimal), expected)

    def _noted(self, name: str, parsed: Parsed[Value], expected: str) -> NDArray[Value]:
        if parsed.missing.any():
            self.missing[name] = parsed.missing
        if parsed.wrong.any():
            self.wrong.setdefault(expected, {})[name] = parsed.wrong
        return parsed.values

    def switches(self, selection: Selection, notes: list[str]) -> NDArray[np.bool_]:
        """Return the switches, with those made by thresholds last."""
        switches = np.empty((len(self.table.rows), len(selection.switches)), np.bool_, order="F")
        shown = []
        for number, (name, taxel) in enumerate(selection.switches):
            if taxel is None:
                switches[:, number] = self._read(name, bits, "0 or 1")
                continue
            values = self._read(name, numbers, "finite numbers")
            threshold = otsu(values) if isinstance(taxel.threshold, str) else taxel.threshold
            switches[:, number] = values > threshold
            shown.append(f"{shortened(name)} above {threshold:g}")
        if shown:
            notes.append(f"{len(shown)} analog columns became switches, closed {list_names(shown)}")
        return switches

    def joints(self, selection: Selection) -> NDArray[np.float64]:
        """Return the columns that become codes: the joints, then the analog taxels."""
        joints = np.empty((len(self.table.rows), len(selection.coded)), order="F")
        for number, (name, entry) in enumerate(selection.coded):
            parse, expected = (codes, "codes 0..65535") if entry.is_counts else (numbers, "finite numbers")
            joints[:, number] = self._read(name, parse, expected)
        return joints

    def names(self, columns: tuple[str, ...]) -> NDArray[np.str_]:
        """Return the text of `columns`, joined with blanks; "1" if there are none."""
        parts = [self._names(column) for column in columns] or [np.full(len(self.table.rows), "1")]
        joined = parts[0]
        for part in parts[1:]:
            check_room(len(joined), (joined.itemsize + part.itemsize) // 4 + 1, self.table.size)
            joined = np.char.add(np.char.add(joined, " "), part)
        return joined

    def _names(self, column: str) -> NDArray[np.str_]:
        parse = partial(names, cells=self.table.cells, size=self.table.size)
        try:
            return self._noted(column, parse(self.table.columns[column]), "names that can be printed")
        except RecordingError as reason:
            raise TableError(f"{self.table.what}: column {shortened(repr(column))}: {reason}") from reason

    def time(self, column: str | None) -> NDArray[np.float64]:
        """Return the values of `column`, 0 throughout without one."""
        if column is None:
            return np.zeros(len(self.table.rows))
        return self._read(column, times, "finite numbers, or dates with times")

    def trials(self, columns: tuple[str, ...], notes: list[str]) -> NDArray[np.int64]:
        """Return the trial number of each row: one column of integers as it is, otherwise counted from 1."""
        if not columns:
            return np.ones(len(self.table.rows), np.int64)
        if (
            len(columns) == 1
            and not (parsed := integers(self.table.columns[columns[0]], self.table.decimal)).wrong.any()
        ):
            return self._noted(columns[0], parsed, "whole numbers").astype(np.int64)
        trials, texts = numbered([self._names(column) for column in columns])
        shown = [f"{shortened(repr(text))} is {number}" for number, text in enumerate(texts[:SHOWN], start=1)]
        what = " and ".join(map(shortened, columns))
        notes.append(f"the texts of {what} were numbered as trials in natural order: {list_names(shown, len(texts))}")
        return trials

    def fill_from_next_grasp(self, readings: Readings, none: NDArray[np.bool_], columns: ColumnRoles) -> None:
        """Allow cells to be empty in rows in which nothing is held.

        This applies to the label, if an empty one means none, and to object, session and trial, which are taken from
        the next row in which something is held, or the last.
        """
        if "" in columns.parts("none"):
            self._excuse(columns.parts("label"), none)
        held = np.flatnonzero(~none)
        if not held.size:
            return
        nearest = held[np.minimum(np.searchsorted(held, np.arange(len(none))), len(held) - 1)]
        for key in ("object", "session", "trial"):
            if (lacking := self._excuse(columns.parts(key), none)).any():
                column = getattr(readings, f"{key}s")
                column[lacking] = column[nearest[lacking]]

    def _excuse(self, columns: tuple[str, ...], rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Do not count cells of `columns` in `rows` (n,) as missing; return in which rows (n,) some were."""
        lacking = np.zeros(len(rows), np.bool_)
        for name in columns:
            if name in self.missing:
                lacking |= self.missing[name] & rows
                self.missing[name] &= ~rows
                if not self.missing[name].any():
                    del self.missing[name]
        return lacking

    def complete(self, missing: str) -> NDArray[np.bool_]:
        """Return which rows stay; raises TableError for wrong cells, and for missing ones if they are not allowed."""
        faults = [f"not {expected}: {self._list(columns)}" for expected, columns in self.wrong.items()]
        if self.missing and missing == "refuse":
            faults.append(f"{_MISSING}: {self._list(self.missing)}")
        if faults:
            raise TableError(f"{self.table.what}: {'; '.join(faults)}")
        keep = np.ones(len(self.table.rows), np.bool_)
        for name, mask in self.missing.items():
            if missing == "drop" or name in self.needed:
                keep &= ~mask
        if not keep.any():
            raise TableError(f"{self.table.what}: every row misses a value: {self._list(self.missing)}")
        return keep

    def dropped(self, readings: Readings, keep: NDArray[np.bool_]) -> list[Oddity]:
        """Return the findings about leaving out all rows except those to `keep`."""
        rows = readings.rows[~keep]
        if not rows.size:
            return []
        trial_ids = readings.trial_ids()
        lost = len(np.unique(trial_ids)) - len(np.unique(trial_ids[keep]))
        labels = sorted({*readings.labels[~keep].tolist()} - {*readings.labels[keep].tolist(), ""})
        lack = list_names([name for name, mask in self.missing.items() if mask[~keep].any()])
        message = f"{rows.size} rows with missing values were left out: {list_rows(rows)} (columns {lack})"
        shown = [f"{lost} of {len(np.unique(trial_ids))} trials"] * bool(lost)
        shown += [f"grasp type{'s' if len(labels) > 1 else ''} {list_names(labels)}"] * bool(labels)
        message += f"; so {' and '.join(shown)} are lost" if shown else ""
        return [Oddity("dropped rows", int(rows.size), message, tuple(rows[:SHOWN].tolist()), tuple(self.missing))]

    def _list(self, columns: dict[str, NDArray[np.bool_]]) -> str:
        """Return "3 cells, ...": how many cells, and the first of them in the order of rows, then of columns."""
        count = sum(int(faulty.sum()) for faulty in columns.values())
        each = ((row, name) for name, faulty in columns.items() for row in np.flatnonzero(faulty)[:SHOWN].tolist())
        first = nsmallest(SHOWN, each, key=itemgetter(0))
        cells = [(row, name, shortened(repr(str(self.table.columns[name][row])))) for row, name in first]
        rows = self.table.rows
        shown = [f"{list_rows(rows[[row]])} {shortened(repr(name))} ({cell})" for row, name, cell in cells]
        return f"{count} cell{'s' if count > 1 else ''}, {list_names(shown, count)}"


def numbered(columns: Sequence[NDArray[np.str_]]) -> tuple[NDArray[np.int64], list[str]]:
    """Return a number (n,) from 1 for each row, equal where all `columns` (n,) are, and the texts in that order."""
    number = groups(*columns)
    first = np.unique(number, return_index=True)[1]
    texts = [[str(column[row]) for column in columns] for row in first.tolist()]
    order = sorted(range(len(texts)), key=lambda row: [natural_key(text) for text in texts[row]])
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(1, len(order) + 1)
    return rank[number], [" ".join(texts[row]) for row in order]


# A stream has at least this many rows per run.
_RUN = 5


def in_runs(*columns: NDArray[np.generic]) -> bool:
    """Return whether rows lie in runs in which all `columns` (n,) are constant, as in a stream."""
    changes = np.logical_or.reduce([column[1:] != column[:-1] for column in columns])
    return _RUN * (int(np.count_nonzero(changes)) + 1) <= len(columns[0])


def restarts(ids: NDArray[np.intp], time: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return numbers (n,) from 1 that increase by one where `ids` (n,) change or the clock `time` (n,) starts again.

    It does where it falls by a usual step or more, to before the middle of what has passed since it last began. Times
    that are repeated, or fall less, are those of a clock that is coarse or jitters.
    """
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    begins = np.diff(ids, prepend=-1) != 0
    begun = np.maximum.accumulate(np.where(begins, np.arange(len(ids)), 0))
    first = 0
    for row in np.flatnonzero((steps < 0) & (steps <= -usual)) + 1:
        first = max(first, int(begun[row]))
        if first < row and 2 * time[row] < time[first] + time[row - 1]:
            begins[row], first = True, int(row)
    return np.cumsum(begins).astype(np.int64)


def in_time(trial_ids: NDArray[np.intp], time: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the rows (n,) ordered such that each trial keeps its places, with its frames in the order of `time`."""
    order = np.empty(len(trial_ids), np.intp)
    order[np.argsort(trial_ids, kind="stable")] = np.lexsort((time, trial_ids))
    return order


def fill(values: NDArray[np.generic], missing: NDArray[np.bool_], trial_ids: NDArray[np.intp]) -> int:
    """Fill the `missing` (n,) of `values` (n,) in place from the nearest frame of the same trial, the earlier of two.

    If the trial has none, use the lower median of all known values. Return the number of cells filled that way. Labels
    are not used.
    """
    known, gaps, place = np.flatnonzero(~missing), np.flatnonzero(missing), places(trial_ids)
    before, after = (
        latest(sign * place[gaps], sign * place[known], trial_ids[gaps], trial_ids[known]) for sign in (1, -1)
    )
    back, ahead = place[gaps] - place[known[before]], place[known[after]] - place[gaps]
    nearest = np.where((before < 0) | ((after >= 0) & (ahead < back)), after, before)
    present = np.sort(values[~missing])
    values[gaps] = np.where(nearest < 0, present[(len(present) - 1) // 2], values[known[nearest]])
    return int((nearest < 0).sum())
