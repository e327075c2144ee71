"""Several tables of the same trials as one: further columns, facts about trials, and segments with labels.

Rows belong together where the columns agree that both tables have and that name a trial: its file, the fields of a
pattern of paths, and keys of a columns.toml. A table with one row for each of these holds facts; others follow the
clock of the first table, or stand beside it row by row.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import SHOWN, list_names, shortened

from ..arrays import AnyArray, groups, latest
from . import FileRows, TableError, list_rows
from .cells import PER_SECOND, Column, TimeUnit, is_numeric, names, numbers, times, unit_of_time, unpadded
from .columns import KEYS, ColumnRoles, Counted
from .inputs import WORDS, is_span, time_of, words_of
from .table import SUFFIXES, Table

Rows = NDArray[np.intp]
Seconds = NDArray[np.float64]
# A row is in a segment from the time that this begins, and in the one before up to a share of the step between rows.
_SAME = 0.01


def join(first: Table, other: Table, roles: ColumnRoles | None = None) -> Table:
    """Return `first` with what `other` says about its rows; `roles` name the time and the ends of segments, if given.

    Raises TableError if the tables do not belong together, or a trial of the first is not in the other.
    """
    start, end = _ends(other, roles)
    if not start and _ends(first, roles)[0]:
        raise TableError(f"{first.what} is a table of segments: name the recording first, {other.what}")
    trials, keys = _trials(first, other, bool(start))
    if start:
        return _segmented(first, other, (start, end), trials, keys, roles)
    facts = bool(keys) and all(len(there) < 2 for _, there in trials)
    clock = None if facts else _clock(first, other, roles)
    beside = {*keys, clock[0] if clock else "", other.rows.column if isinstance(other.rows, FileRows) else ""}
    more = [name for name in other.columns if name not in beside]
    if not facts and {*more} <= {*first.columns}:
        raise TableError(
            f"{other.what} has no other columns than {first.what}: of tables with one trial each, name the pattern of "
            "their paths, such as 'data/{label}_{trial}.csv'; of tables with the same trials, rename the columns of one"
        )
    match = np.full(len(first.rows), -1)
    for here, there in trials:
        if not there.size:
            raise TableError(f"{other.what} has no rows of the trial with {list_rows(first.rows[here[:1]])}")
        if facts:
            match[here] = there[0]
        elif clock:
            match[here] = _at(clock[1][here], clock[2][there], there)
            if (match[here] < 0).all():
                ranges = [f"{part.min():.12g} to {part.max():.12g} s" for part in (clock[1][here], clock[2][there])]
                raise TableError(f"{first.what} and {other.what} are not of one time: {' and '.join(ranges)}")
        elif len(here) == len(there):
            match[here] = there
        else:
            counts = f"{first.what} has {len(here)} rows where {other.what} has {len(there)}"
            raise TableError(f"{counts}, and no time says which belong together: give both a column of time")
    how = "one row for each trial" if facts else "row by row" if clock is None else f"by {shortened(clock[0])}"
    columns = {_free(name, first, other): _taken(first, other, name, match) for name in more}
    note = f"{other.what}: {len(more)} columns of the same trials, {how}"
    return replace(first, columns={**first.columns, **columns}, notes=(*first.notes, *other.notes, note))


def _ends(table: Table, roles: ColumnRoles | None) -> tuple[str, str]:
    """Return the columns with the starts and the ends of segments, "" if it is no table of segments."""
    if roles is not None:
        start, end = (name if name in table.columns else "" for name in (roles.start or "", roles.end or ""))
    else:
        start, end = (next((name for name in table.columns if is_span(key, name)), "") for key in ("start", "end"))
    return (start, end) if start and end else ("", "")


def _trials(first: Table, other: Table, segments: bool) -> tuple[list[tuple[Rows, Rows]], list[str]]:
    """Return the rows of both tables that belong together, and the columns of the other that say so."""
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
    both = groups(np.zeros(count + len(other.rows)), *map(np.concatenate, pairs))
    parts = []
    for ids in (both[:count], both[count:]):
        order = np.argsort(ids, kind="stable")
        parts.append(np.split(order, np.searchsorted(ids[order], np.arange(1, both.max() + 1))))
    trials = [(here, there) for here, there in zip(*parts, strict=True) if here.size]
    if not any(there.size for _, there in trials):
        shown = [
            f"{name} {list_names(np.unique(pair[1])[:SHOWN].tolist())}" for name, pair in zip(keys, pairs, strict=True)
        ]
        raise TableError(f"{other.what} has no rows of any trial of {first.what}, but of {' and of '.join(shown)}")
    return trials, keys


def _texts(table: Table, column: Column) -> NDArray[np.str_]:
    """Return the cells of a column that names trials, numbers without leading zeros."""
    return _each(names(column, table.cells, table.size).values, unpadded)


def _each(texts: NDArray[np.str_], change: Callable[[str], str]) -> NDArray[np.str_]:
    found, where = np.unique(texts, return_inverse=True)
    return np.array(list(map(change, found.tolist())), np.str_)[where]


def _bare(path: str, whole: bool) -> str:
    """Return a path without the suffixes of a table, its last part unless it is to stay `whole`."""
    while path.lower().endswith(SUFFIXES):
        path = path.rpartition(".")[0]
    return path if whole else path.rpartition("/")[2]


def _clock(first: Table, other: Table, roles: ColumnRoles | None) -> tuple[str, Seconds, Seconds] | None:
    """Return the other table's column of time, and the times in both tables (n,) and (m,); None if one has none."""
    ours = _time(first, roles)
    theirs = ours if ours in other.columns else time_of(other)
    if not (ours and theirs):
        return None
    (here, unit), (there, its) = (
        _seconds(first, ours, roles),
        _seconds(other, theirs, roles if ours == theirs else None),
    )
    alike = bool(unit) == bool(its) and (bool(unit) or ours == theirs)
    return (theirs, here, there) if alike else None


def _time(table: Table, roles: ColumnRoles | None) -> str:
    if roles is None:
        return time_of(table)
    before = {new: old for old, new in roles.rename.items()}
    return before.get(roles.time or "", roles.time or "")


def _seconds(table: Table, name: str, roles: ColumnRoles | None) -> tuple[Seconds, TimeUnit | None]:
    """Return the times (n,) in a column in seconds, or as they are if their unit is not known, and the unit."""
    values = times(table.columns[name], table.decimal).values
    unit = (roles and roles.time_unit) or unit_of_time(name, values[np.isfinite(values)])
    return values / (PER_SECOND[unit] if unit else 1.0), unit


def _at(times: Seconds, theirs: Seconds, rows: Rows) -> Rows:
    """Return those of the `rows` (m,) at times `theirs` (m,) that are the latest at `times` (n,), -1 if none is."""
    order = np.argsort(theirs, kind="stable")
    found = latest(theirs[order], times)
    return np.where(found < 0, -1, rows[order][found])


def _free(name: str, first: Table, other: Table) -> str:
    """Return a name for a column that the first table does not have: with the words that tell the tables apart."""
    if name in first.columns:
        ours, theirs = (re.findall(r"[^\W_]+", re.sub(r"\{.*?\}", " ", table.what)) for table in (first, other))
        name = ".".join([*(word for word in theirs if word not in ours), name])
        while name in {*first.columns, *other.columns}:
            name += ".2"
    return name


def _taken(first: Table, other: Table, name: str, match: Rows) -> AnyArray:
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


def _segmented(
    first: Table,
    other: Table,
    ends: tuple[str, str],
    trials: list[tuple[Rows, Rows]],
    keys: list[str],
    roles: ColumnRoles | None,
) -> Table:
    """Return `first` with the columns of the segments in `other`, empty in rows that are in none, and their numbers.

    Rows between segments have the number of the next one in their recording, or of its last.
    """
    parsed = [numbers(other.columns[name], other.decimal) for name in ends]
    start, end = (part.values for part in parsed)
    wrong = np.logical_or.reduce([part.missing | part.wrong for part in parsed]) | ~(start < end)
    if wrong.any():
        rows = list_rows(other.rows[wrong])
        raise TableError(
            f"{other.what}: a segment lasts from {ends[0]} to {ends[1]}, two numbers, but not that of {rows}"
        )
    axes = _axes(first, trials, ends[0], roles)
    found = {how: _inside(axis, start / unit, end / unit, trials) for how, (axis, unit) in axes.items()}
    how = max(found, key=lambda how: int(np.count_nonzero(found[how][0] >= 0)))
    (match, lengths), (axis, unit) = found[how], axes[how]
    used = np.concatenate([there for _, there in trials])
    counts = {"time": f"by {_time(first, roles)}", "s": "in seconds from the first row", "rows": "in rows from 0"}[how]
    if (empty := used[lengths[used] == 0]).size:
        rows, lasts = list_rows(other.rows[empty]), f"{axis.min() * unit:.12g} to {axis.max() * unit:.12g} {counts}"
        raise TableError(f"{other.what}: the segment of {rows} has no row of {first.what}, which has {lasts}")
    if (lost := used[np.bincount(match[match >= 0], minlength=len(start))[used] < lengths[used]]).size:
        raise TableError(f"{other.what}: the segment of {list_rows(other.rows[lost])} shares rows with another one")
    number = np.empty(len(match), np.int64)
    for place, (here, _) in enumerate(trials, start=1):
        inside = np.flatnonzero(match[here] >= 0)
        following = (
            inside[np.searchsorted(inside, np.arange(len(here))).clip(max=len(inside) - 1)] if inside.size else inside
        )
        number[here] = match[here][following] + 1 if inside.size else len(start) + place
    columns = {name: _taken(first, other, name, match) for name in other.columns if name not in {*ends, *keys}}
    if "label" in first.columns and "label" not in columns:
        columns["label"] = np.where(match < 0, "", np.asarray(first.columns["label"], np.str_))
    trial = next(name for name in ("segment", "segment number") if name not in {*first.columns, *columns})
    return replace(
        first,
        columns={**first.columns, **columns, trial: number},
        notes=(*first.notes, *other.notes, f"{other.what}: {len(used)} segments, {counts}"),
        segments={"start": ends[0], "end": ends[1], "segments": how, "trial": trial},
    )


def _axes(
    first: Table, trials: list[tuple[Rows, Rows]], start: str, roles: ColumnRoles | None
) -> dict[Counted, tuple[Seconds, float]]:
    """Return what segments may count, by its name: the place (n,) of each row, and what makes up a unit of it."""
    name = _time(first, roles)
    clock, unit = _seconds(first, name, roles) if name else (np.zeros(len(first.rows)), None)
    since, place = clock.copy(), np.empty(len(first.rows))
    for here, _ in trials:
        since[here] -= clock[here].min()
        place[here] = np.arange(len(here))
    its = unit_of_time(start, np.empty(0))
    axes: dict[Counted, tuple[Seconds, float]] = {"rows": (place, 1.0)}
    if name:
        axes = {"time": (clock, PER_SECOND[its or unit] if unit else 1.0), "s": (since, PER_SECOND[its or "s"]), **axes}
    counted = roles.segments if roles else "rows" if words_of(start) & WORDS["row"] else None
    if counted is not None and counted not in axes:
        raise TableError(f"segments = {counted!r} needs a column of time in {first.what}: name it (`time`)")
    return axes if counted is None else {counted: axes[counted]}


def _inside(
    axis: Seconds, start: Seconds, end: Seconds, trials: list[tuple[Rows, Rows]]
) -> tuple[Rows, NDArray[np.int64]]:
    """Return the segment in which each row is (n,), at its place on an `axis` (n,), -1 for none; and how many rows (k,)
    each segment from `start` (k,) to `end` (k,) has: those of its recording that are not before the one nor the other.
    """
    match, lengths = np.full(len(axis), -1), np.zeros(len(start), np.int64)
    for here, there in trials:
        order = here[np.argsort(axis[here], kind="stable")]
        same = _SAME * float(np.median(np.diff(axis[order]))) if len(order) > 1 else 0.0
        low, high = (np.searchsorted(axis[order], edge[there] - same) for edge in (start, end))
        lengths[there] = high - low
        for segment, begin, stop in zip(there.tolist(), low.tolist(), high.tolist(), strict=True):
            match[order[begin:stop]] = segment
    return match, lengths
