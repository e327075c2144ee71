"""Several tables of the same trials as one: further columns, facts about trials, and segments with labels.

Rows belong together where the columns agree that both tables have and that name a trial: its file, the fields of a
pattern of paths, and keys of a columns.toml. A table with one row for each of these holds facts; others follow the
clock of the first table, or go with it row by row.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import SHOWN, list_names, shortened

from ..arrays import AnyArray, Ids, Times, groups, latest, measured, places
from . import FileRows, TableError, list_rows
from .cells import PER_SECOND, Column, TimeUnit, is_numeric, names, numbers, times, unit_of_time
from .columns import KEYS, ColumnRoles, TextFormat
from .inputs import WORDS, is_count, is_span, is_time, time_of, words_of
from .readings import restarts
from .table import SUFFIXES, Table
from .trial_files import Report, read_path

# A row is in a segment from the time that this begins, and in the one before up to a share of the step between rows.
_SAME = 0.01


class _Clock(NamedTuple):
    """A column of time, its cells (n,) in seconds, and the unit in which they are written; as they are, if unknown."""

    name: str
    seconds: Times
    unit: TimeUnit | None


class _Pair(NamedTuple):
    """Two tables, numbers (n,) and (m,) that are equal in rows of one trial, and the other's columns that say so."""

    first: Table
    other: Table
    ours: Ids
    theirs: Ids
    keys: list[str]


def read_joined(
    path: Path, more: Sequence[Path], progress: Report, roles: ColumnRoles | None = None
) -> tuple[Table, TextFormat, list[str]]:
    """Return the table in `path`, a file or a pattern, joined with `more`; its format, and sentences on that.

    Without `roles` the format is found, as it is for `more`. Raises TableError, OSError.
    """
    table, text, remarks = read_path(path, roles.text if roles else None, progress, more)
    for other in more:
        table = join(table, read_path(other, None, progress)[0], roles)
    return table, text, remarks


def join(first: Table, other: Table, roles: ColumnRoles | None = None) -> Table:
    """Return `first` with what `other` says about its rows; `roles` name the time, if given.

    Raises TableError if the tables do not belong together, or a trial of the first is not in the other.
    """
    ends = _ends(other)
    if not ends and _ends(first):
        raise TableError(f"{first.what} is a table of segments: name the recording first, {other.what}")
    pair = _paired(first, other, bool(ends))
    # A segment replaces what names a trial; counters of two devices have one name.
    known = {*ends, *pair.keys, other.rows.column if isinstance(other.rows, FileRows) else ""}
    more = [name for name in other.columns if name not in known]
    twice = [name for name in more if name in first.columns and not (ends and name in KEYS[:-1])]
    counters = [name for name in twice if is_time(words_of(name)) or is_count(words_of(name))]
    if len(twice) > len(counters):
        shown = list_names([repr(name) for name in twice if name not in counters])
        raise TableError(
            f"{first.what} and {other.what} both have {shown}: rename the columns of one; of tables with one trial "
            "each, name the pattern of their paths, such as 'data/{label}_{trial}.csv'"
        )
    before = {new: old for old, new in roles.rename.items()} if roles else {}
    name = before.get(roles.time or "", roles.time or "") if roles else time_of(first)
    clock = partial(_clock, first, name, roles.time_unit if roles else None)
    if ends:
        match, how = _segments(pair, ends, clock)
        time = ""
    else:
        match, time, how = _rows(pair, clock)
    more = [name for name in more if name != time and name not in counters]
    columns: dict[str, Column] = {name: _taken(first, other, name, match) for name in more}
    trial = first.segment
    if ends:
        if "label" in first.columns and "label" not in columns:
            columns["label"] = np.where(match < 0, "", np.asarray(first.columns["label"], np.str_))
        trial = next(name for name in ("segment", "segment number") if name not in {*first.columns, *columns})
        columns[trial] = _numbers(match, pair)
    notes = (*first.notes, *other.notes, f"{other.what}: {how}")
    return replace(first, columns={**first.columns, **columns}, notes=notes, segment=trial)


def _ends(table: Table) -> list[str]:
    """Return the columns with the starts and the ends of segments, none if it is no table of segments."""
    found = [[name for name in table.columns if is_span(key, name)] for key in ("start", "end")]
    return [names[0] for names in found] if all(found) else []


def _paired(first: Table, other: Table, segments: bool) -> _Pair:
    """Return which rows belong together. Raises TableError if none do."""
    fields = {name for table in (first, other) if isinstance(table.rows, FileRows) for name in table.rows.fields}
    naming = ({*KEYS} | fields) - {"time"} - ({"label"} if segments else set())
    keys = [name for name in other.columns if name in first.columns and name in naming]
    pairs = [(_texts(first, first.columns[name]), _texts(other, other.columns[name])) for name in keys]
    files = [name for name in other.columns if words_of(name) & WORDS["file"] and words_of(name) <= WORDS["file"]]
    if files and not isinstance(other.rows, FileRows):
        named = first.columns[first.rows.column] if isinstance(first.rows, FileRows) else [first.what] * len(first.rows)
        theirs = _texts(other, other.columns[files[0]])
        whole = any("/" in text for text in np.unique(theirs).tolist())
        bare, ours = partial(_bare, whole=whole), _texts(first, named)
        pairs.append((_each(ours, bare), _each(theirs, bare)))
        keys.append(files[0])
    count = len(first.rows)
    ids = groups(np.zeros(count + len(other.rows)), *map(np.concatenate, pairs))
    if not np.isin(ids[:count], ids[count:]).any():
        said = [np.unique(theirs)[:SHOWN].tolist() for _, theirs in pairs]
        shown = [f"{name} {list_names(texts)}" for name, texts in zip(keys, said, strict=True)]
        raise TableError(f"{other.what} has no rows of any trial of {first.what}, but of {' and of '.join(shown)}")
    return _Pair(first, other, ids[:count], ids[count:], keys)


def _texts(table: Table, column: Column) -> NDArray[np.str_]:
    """Return the cells of a column that names trials, numbers without leading zeros."""
    texts = names(column, table.cells, table.size).values
    bare = np.char.lstrip(texts, "0")
    return np.where(np.char.isdecimal(texts), np.where(bare == "", "0", bare), texts)


def _each(texts: NDArray[np.str_], change: Callable[[str], str]) -> NDArray[np.str_]:
    found, where = np.unique(texts, return_inverse=True)
    return np.array(list(map(change, found.tolist())), np.str_)[where]


def _bare(path: str, whole: bool) -> str:
    """Return a path without the suffixes of a table, its last part unless it is to stay `whole`."""
    while path.lower().endswith(SUFFIXES):
        path = path.rpartition(".")[0]
    return path if whole else path.rpartition("/")[2]


def _clock(table: Table, name: str, unit: TimeUnit | None = None) -> _Clock | None:
    """Return the column of time called `name`, None if there is none. Raises TableError for a cell that is no time."""
    if name not in table.columns:
        return None
    parsed = times(table.columns[name], table.decimal)
    if (wrong := parsed.missing | parsed.wrong).any():
        rows = list_rows(table.rows[wrong])
        raise TableError(f"{table.what}: {shortened(repr(name))} is no time in {rows}, by which tables are joined")
    unit = unit or unit_of_time(name, parsed.values)
    return _Clock(name, parsed.values / (PER_SECOND[unit] if unit else 1.0), unit)


def _starts_again(clock: _Clock, ids: Ids) -> bool:
    """Return whether the times of rows of one trial start again."""
    order = np.argsort(ids, kind="stable")
    return bool(restarts(ids[order], clock.seconds[order])[-1] > len(np.unique(ids)))


def _rows(pair: _Pair, read_clock: Callable[[], _Clock | None]) -> tuple[Ids, str, str]:
    """Return the row of the other table for each row (n,), -1 for none, the time that says so, if any, and a remark."""
    first, other, ours, theirs, keys = pair
    if (alone := ~np.isin(ours, theirs)).any():
        raise TableError(f"{other.what} has no rows of the trial with {list_rows(first.rows[alone][:1])}")
    if keys and len(np.unique(theirs)) == len(theirs):
        return latest(np.zeros(len(ours)), np.zeros(len(theirs)), ours, theirs), "", "one row for each trial"
    clock = read_clock()
    same = clock is not None and clock.name in other.columns
    its = _clock(other, clock.name if same else time_of(other), clock.unit if same else None) if clock else None
    if clock is None or its is None or not (same or (clock.unit and its.unit)):
        counts = [np.bincount(ids, minlength=ours.max() + 1)[ours] for ids in (ours, theirs)]
        if (uneven := np.flatnonzero(counts[0] != counts[1])).size:
            here = f"the trial with {list_rows(first.rows[uneven[:1]])}"
            said = " and ".join(str(count[uneven[0]]) for count in counts)
            raise TableError(
                f"{first.what} and {other.what} have {said} rows of {here}: give both a time, in one clock"
            )
        return latest(places(ours), places(theirs), ours, theirs), "", "row by row"
    if _starts_again(clock, ours) or _starts_again(its, theirs):
        raise TableError(f"{first.what} and {other.what}: {its.name} starts again within a trial: name trials in both")
    order = np.lexsort((its.seconds, theirs))
    match = measured(clock.seconds, its.seconds[order], ours, theirs[order])
    match = np.where(match < 0, -1, order[match])
    if (apart := ~np.isin(ours, ours[match >= 0])).any():
        ranges = [f"{part.min():.12g} to {part.max():.12g} s" for part in (clock.seconds, its.seconds)]
        here = f"the trial with {list_rows(first.rows[apart][:1])}"
        raise TableError(f"{first.what} and {other.what} have no time of {here} in common: {' and '.join(ranges)}")
    return match, its.name, f"by {its.name}"


def _taken(first: Table, other: Table, name: str, match: Ids) -> AnyArray:
    """Return the cells of a column in the rows `match` (n,) of the other table, empty where that is -1."""
    column = np.asarray(other.columns[name])
    if not is_numeric(column) and other.decimal != first.decimal:
        parsed = numbers(column, other.decimal)
        column = column if parsed.wrong.any() else np.where(parsed.missing, np.nan, parsed.values)
    taken: AnyArray = column[match]
    if (match < 0).any():
        taken = taken.astype(np.float64) if is_numeric(column) else taken
        taken[match < 0] = np.nan if is_numeric(column) else ""
    return taken


def _segments(pair: _Pair, ends: Sequence[str], read_clock: Callable[[], _Clock | None]) -> tuple[Ids, str]:
    """Return the segment in which each row is (n,), -1 for none, and a remark on what the ends of segments count: that
    by which they cover most rows. Raises TableError for a segment without rows.
    """
    first, other, ours, theirs, _ = pair
    parsed = [numbers(other.columns[name], other.decimal) for name in ends]
    start, end = (part.values for part in parsed)
    if (wrong := np.logical_or.reduce([part.missing | part.wrong for part in parsed]) | ~(start < end)).any():
        rows = list_rows(other.rows[wrong])
        raise TableError(f"{other.what}: a segment goes up from {ends[0]} to {ends[1]}, but not in {rows}")
    order = np.lexsort((start, theirs))
    overlap = (np.diff(theirs[order]) == 0) & (start[order][1:] < end[order][:-1])
    if (both := order[1:][overlap & np.isin(theirs[order][1:], ours)]).size:
        raise TableError(f"{other.what}: the segment of {list_rows(other.rows[np.sort(both)])} begins in another one")
    unit = unit_of_time(ends[0], np.empty(0))
    counts = [("in its rows from 0", places(ours), 1.0)]
    clock = None if words_of(ends[0]) & WORDS["row"] else read_clock()
    if clock is not None and not _starts_again(clock, ours):
        begin = np.full(ours.max() + 1, np.inf)
        np.minimum.at(begin, ours, clock.seconds)
        own = unit or clock.unit
        counts.insert(0, ("in seconds from its first row", clock.seconds - begin[ours], PER_SECOND[unit or "s"]))
        counts.insert(0, ("by the clock of the recording", clock.seconds, PER_SECOND[own] if own else 1.0))
    found = []
    for how, axis, per in counts:
        at = axis + _SAME * float(np.median(np.abs(np.diff(axis)))) if len(axis) > 1 else axis
        match = latest(at, start / per, ours, theirs)
        found.append((np.where((match >= 0) & (at < end[match] / per), match, -1), how, axis * per))
    match, how, axis = max(found, key=lambda each: int(np.count_nonzero(each[0] >= 0)))
    if (empty := np.isin(theirs, ours) & ~np.isin(np.arange(len(theirs)), match)).any():
        lasts, rows = f"{axis.min():.12g} to {axis.max():.12g} {how}", list_rows(other.rows[empty])
        raise TableError(f"{other.what}: no row of {first.what}, {lasts}, is in the segment of {rows}")
    return match, f"segments, {how}"


def _numbers(match: Ids, pair: _Pair) -> Ids:
    """Return the number of the segment of each row (n,), from 1; between segments of the next one in the recording, or
    its last; in a recording without, a number beyond all.
    """
    place, inside = places(pair.ours), np.flatnonzero(match >= 0)
    rows = inside, pair.ours[inside]
    following, before = (latest(sign * place, sign * place[inside], *(pair.ours, rows[1])) for sign in (-1, 1))
    nearest = np.where(following < 0, before, following)
    return np.where(nearest < 0, len(pair.other.rows) + pair.ours, match[inside[nearest]]) + 1
