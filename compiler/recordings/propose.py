"""Propose a columns.toml for a table: the role of each column, from its name and values, with reasons."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.runtime.names import list_names, printable, shortened
from thenar.runtime.published import NONE

from .cells import names, numbers, times
from .clocks import Course, is_time, numbers_trials
from .columns import KEYS, PLAIN, ColumnRoles, TaxelColumns, TextFormat
from .errors import FileRows, TableError, list_rows
from .headers import skipped
from .inputs import WORDS, Facts, Role, bits_of, facts_of, globs, inputs_of, joints_of, listed
from .sniff import sniff
from .table import Table, is_text, read_table
from .taxonomy import plain, published_for
from .trial_files import Report, emptied, find_files, is_pattern, read_files
from .trials import groups, in_runs, restarts, unit_of_time

# The share of a stream's label changes that lead to or from the label for nothing held.
_BETWEEN = 0.9
# Nothing is held before and after a grasp; a number shared by more runs than these is not the number of a movement.
_SHARED = 3
# Columns with more distinct values than this are not grasp types.
_TYPES = 200


class ColumnProposal(msgspec.Struct, frozen=True):
    """The proposed roles of a table's columns; `lacks` is what only the user can say, "" if nothing."""

    columns: ColumnRoles
    roles: tuple[Role, ...]
    remarks: tuple[str, ...]
    lacks: str = ""

    def independent(self) -> "ColumnProposal":
        """Return the proposal with the statement that each row is a separate trial."""
        return replace(self, columns=replace(self.columns, frames="independent"), lacks="")

    def toml(self) -> str:
        """Return the text of the columns.toml, with the reasons."""
        said = [*self.remarks, *(f"{listed(role.columns)}: {role.role}: {role.reason}" for role in self.roles)]
        said += [f"TO DO: {self.lacks}"] if self.lacks else []
        return "".join(f"# {printable(line)}\n" for line in said) + "\n" + self.columns.toml()


def propose_file(path: Path, progress: Report = lambda _done, _total: None) -> tuple[Table, ColumnProposal]:
    """Return the table in `path`, or in the files that match it as a pattern, and the proposed roles of its columns.

    `progress` takes the number of files that were read, and of all. Raises TableError, OSError.
    """
    files, others = find_files(path) if is_pattern(path) else ([], [])
    first = files[0].path if files else path
    text, remarks = sniff(first) if is_text(first) else (PLAIN._replace(skip=None), [])
    table = read_files(files, text, progress) if files else read_table(path, text)
    if text.skip is None:
        text, remarks = PLAIN._replace(skip=table.skip), [skipped(table.skip)] * bool(table.skip)
    # What a path says is no input, and only a field that is called so has a role.
    fields = {*files[0].fields} - {*KEYS} if files else set()
    paths = [*sorted(fields), *([table.rows.column] if isinstance(table.rows, FileRows) else [])]
    try:
        proposal = propose(emptied(table, paths), text, remarks)
    except TableError as reason:
        raise TableError(f"{reason}; {odd}" if (odd := _first_oddity(table)) else str(reason)) from reason
    if others:
        left = f"{len(others)} tables next to them do not match: {list_names([shortened(name) for name in others])}"
        proposal = replace(proposal, remarks=(f"files: {len(files)}; {left}", *proposal.remarks))
    return table, _by_file(table, proposal, tuple(paths)) if files else proposal


def _first_oddity(table: Table) -> str:
    """Return the first oddity of `table` as the end of a sentence, with what to do; "" if there is none."""
    if len(table.columns) == 1:
        (name,) = table.columns
        return f"its rows have one cell each, under {shortened(repr(name))}: name the `delimiter` in a columns.toml"
    odd: list[tuple[int, str, str]] = []
    for name, column in table.columns.items():
        wrong = np.flatnonzero(numbers(column, table.decimal).wrong)
        if not wrong.size:
            continue
        row, cell = int(wrong[0]), str(column[wrong[0]]).strip()
        shown = f"{list_rows(table.rows[[row]])} has {shortened(repr(cell))} in column {shortened(repr(name))}"
        if cell[:1] in ("[", "("):
            odd.append((row, name, f"{shown}: write a list of numbers in each cell, or a column for each number"))
        elif 2 * wrong.size < len(column):
            odd.append((row, name, f"{shown}, which holds numbers elsewhere: correct the cell or delete the row"))
    return min(odd)[2] if odd else ""


def _by_file(table: Table, proposal: ColumnProposal, paths: tuple[str, ...]) -> ColumnProposal:
    """Return the proposal with the file among the columns of the trial, unless no trial is in two files.

    Not in a stream with rest, whose trials are runs of rows of one label. `paths` are the columns that only the path
    fills.
    """
    columns, rows = proposal.columns, table.rows
    assert isinstance(rows, FileRows)
    roles = [
        replace(role, columns=tuple(name for name in role.columns if name not in paths)) for role in proposal.roles
    ]
    roles = [role for role in roles if role.columns]
    given = [name for key in ("label", "subject", "object", "session", "trial") for name in columns.parts(key)]
    file = groups(_texts(table, [rows.column]))
    trial = groups(*(_texts(table, [name]) for name in given))
    is_stream = columns.frames == "restart" and columns.none
    if is_stream or (columns.parts("trial") and len(np.unique(groups(trial, file))) == trial.max() + 1):
        return replace(proposal, roles=(*roles, Role(paths, "left out", "of the path")))
    parts = (rows.column, *columns.parts("trial"))
    reason = "each file is one trial" if len(parts) == 1 else "numbers of trials are of one file"
    rest = tuple(name for name in paths if name != rows.column)
    return replace(
        proposal,
        columns=replace(columns, trial=parts if len(parts) > 1 else parts[0], frames=None),
        roles=(
            *(role for role in roles if role.role != "trial"),
            Role(parts, "trial", reason),
            *([Role(rest, "left out", "of the path")] if rest else ()),
        ),
        lacks="",
    )


@np.errstate(over="ignore", invalid="ignore")
def propose(table: Table, text: TextFormat = PLAIN, remarks: Sequence[str] = ()) -> ColumnProposal:
    """Return the proposed roles of the columns of `table`. Raises TableError if there is no label or no input."""
    found = [facts_of(table, name) for name in table.columns]
    chosen, why = _named(found)
    if "label" not in chosen:
        chosen["label"], why["label"] = _label(table.what, found, chosen)
    out = _same(table, found, chosen, why)
    labels = _texts(table, chosen["label"])
    none = _none(labels)
    held = ~np.isin(labels, none)
    _trial_number(table, [column for column in found if column.name not in out], chosen, why)
    _constant_texts(table, found, chosen, why, out)
    frames, lacks = _frames(table, found, chosen, why, held)
    time = _time(table, chosen)
    unit = None if time is None else unit_of_time(chosen["time"][0], time[~np.isnan(time)])
    if unit is not None:
        why["time"] += f"; in {unit}"
    taken = {name for columns in chosen.values() for name in columns}
    rest = [column for column in found if column.name not in taken]
    inputs = inputs_of(rest, held, _counting(table, found, chosen) | out)
    if not any(role.role in ("switches", "taxels", "joints") for role in inputs):
        out_of = [f"{listed(role.columns)} ({role.reason})" for role in inputs if role.reason not in ("text", "empty")]
        left = f"; left out are {list_names(out_of)}" if out_of else ""
        raise TableError(f"{table.what}: no column holds numbers that change: it has no inputs{left}")
    used = taken | {name for role in inputs if role.role != "left out" for name in role.columns}
    excused = {name for key in ("label", "object", "session", "trial") for name in chosen.get(key, ())}
    missing = sum(
        bool((~column.there & (held | (column.name not in excused))).any()) for column in found if column.name in used
    )
    taxonomy = published_for({*labels[held].tolist()} - {""}) or "own"
    columns = ColumnRoles(
        **{key: those[0] if len(those) == 1 else those for key, those in chosen.items()},  # type: ignore[arg-type]
        time_unit=unit,
        none=none[0] if len(none) == 1 else none,
        frames=frames,
        taxonomy=taxonomy,
        missing="keep" if missing else "refuse",
        **text._asdict(),
        switches=globs((name for role in inputs if role.role == "switches" for name in role.columns), table.columns),
        taxels=tuple(
            TaxelColumns(globs(role.columns, table.columns), bits=bits_of(role, found))
            for role in inputs
            if role.role == "taxels"
        ),
        joints=tuple(joints_of(role, table.columns) for role in inputs if role.role == "joints"),
    )
    notes = [f"{missing} columns miss cells, which are filled: see `missing`"] if missing else []
    notes += [f"the labels are grasp types of {taxonomy}"] if taxonomy != "own" else []
    if none:
        shown = ", ".join(shortened(repr(label)) for label in none)
        notes += [f"nothing is held where the label is {shown} ({np.mean(~held):.0%} of the rows): see `none`"]
    roles = [Role(chosen[key], key, why[key]) for key in KEYS if key in chosen]
    return ColumnProposal(columns, (*roles, *inputs), (*remarks, *notes), lacks)


def _named(found: Sequence[Facts]) -> tuple[dict[str, tuple[str, ...]], dict[str, str]]:
    """Return the columns with a role given by their names, and the reasons."""
    chosen: dict[str, tuple[str, ...]] = {}
    for key in ("time", "session", "trial", "subject", "object", "label"):
        best = [
            (
                _vague(column) if key == "time" else 0,
                key != "time" and not column.words <= WORDS[key] | WORDS["number"],
                column.distinct == column.rows,
                place,
            )
            for place, column in enumerate(found)
            if (column.name,) not in chosen.values() and _may_be(key, column)
        ]
        if best:
            chosen[key] = (found[min(best)[-1]].name,)
    distinct = {column.name: column.distinct for column in found}
    return chosen, {key: f"its name; {distinct[name]} different" for key, (name,) in chosen.items()}


def _vague(column: Facts) -> int:
    """Return 0 if the name of a time tells its unit, 1 if its steps do, 2 if neither."""
    steps = np.zeros(0) if column.values is None else column.values
    return next((rank for rank, known in enumerate((steps[:0], steps)) if unit_of_time(column.name, known)), 2)


def _same(
    table: Table, found: Sequence[Facts], chosen: dict[str, tuple[str, ...]], why: dict[str, str]
) -> dict[str, str]:
    """Replace numbers of labels, subjects, objects and sessions by names; return why other columns are left out."""
    out: dict[str, str] = {}
    for key in ("label", "subject", "object", "session"):
        if len(chosen.get(key, ())) != 1:
            continue
        column = next(column for column in found if (column.name,) == chosen[key])
        taken = {name for columns in chosen.values() for name in columns}
        alike = [
            other
            for other in found
            if other.name not in taken | out.keys() and _corresponds(table, other, column) and not other.bits
        ]
        roles = WORDS.keys() & {*KEYS} - {key}
        names = [
            other for other in alike if other.values is None and not any(other.words & WORDS[role] for role in roles)
        ]
        if column.values is not None and names:
            best = max(names, key=lambda other: bool(other.words & (WORDS[key] | WORDS["person"])))
            chosen[key] = (best.name,)
            why[key] = f"the name of each number in {column.name}; {best.distinct} different"
            alike = [column, *(other for other in alike if other is not best)]
        out |= {
            other.name: f"the number of {shortened(chosen[key][0])}"
            for other in alike
            if other.values is not None and other.distinct == 1 + np.ptp(other.values)
        }
    return out


def _corresponds(table: Table, other: Facts, column: Facts) -> bool:
    """Return whether a column has one value for each of another's, more than one and fewer than there are rows."""
    if not (other.nominal and 1 < other.distinct == column.distinct < other.rows):
        return False
    return int(groups(_numbered(table, other), _numbered(table, column)).max()) + 1 == column.distinct


def _trial_number(
    table: Table, found: Sequence[Facts], chosen: dict[str, tuple[str, ...]], why: dict[str, str]
) -> None:
    """Take a column that numbers the trials for the trial, if none has such a name."""
    if "trial" in chosen:
        return
    group = _grouped(table, found, chosen, ("label", "subject", "object", "session"))
    taken = {name for columns in chosen.values() for name in columns}
    for column in found:
        if column.name in taken or column.bits or not column.whole or column.distinct < 2:
            continue
        if numbers_trials(column.over_rows, group):
            chosen["trial"] = (column.name,)
            why["trial"] = f"consecutive numbers, one for each run of rows; {column.distinct} different"
            return


def _constant_texts(
    table: Table,
    found: Sequence[Facts],
    chosen: dict[str, tuple[str, ...]],
    why: dict[str, str],
    out: dict[str, str],
) -> None:
    """Take texts that are constant within trials for the subject, the session or the object."""
    label = _grouped(table, found, chosen, ("label",))
    who = _grouped(table, found, chosen, ("label", "subject", "object", "session", "trial"))
    trial = np.cumsum(np.diff(who, prepend=-1) != 0)
    taken = {name for columns in chosen.values() for name in columns}
    for column in found:
        if column.name in taken | out.keys() or column.values is not None or not 1 < column.distinct <= _TYPES:
            continue
        text = _texts(table, [column.name])
        changes = np.count_nonzero(text[1:] != text[:-1])
        inside = np.count_nonzero((text[1:] != text[:-1]) & (trial[1:] == trial[:-1]))
        if 2 * column.distinct > changes + 1 + trial[-1] or (inside and "trial" in chosen):
            continue
        pairs = len(np.unique(groups(label, text)))
        types = len(np.unique(label))
        if pairs == types:
            out[column.name] = f"text that {shortened(chosen['label'][0])} determines"
        elif key := _who(column, pairs >= types * column.distinct / 2, chosen):
            chosen[key] = (column.name,)
            why[key] = f"text, constant within trials; {column.distinct} different: is it the {key}?"
        else:
            out[column.name] = "text, constant within trials: name it (subject, object, session) if it is one"


def _who(column: Facts, crossed: bool, chosen: Iterable[str]) -> str:
    """Return the role of a text that is constant within trials, by its name, or by whether it occurs with most labels.

    A text of two values without a name that tells is none: it may be a remark, such as "left" or "ok".
    """
    if column.words & WORDS["person"] and "subject" not in chosen:
        return "subject"
    if column.words & WORDS["occasion"] and "session" not in chosen:
        return "session"
    likely = ("subject", "session") if crossed else ("object",)
    return next((key for key in likely if key not in chosen and column.distinct > 2), "")


def _numbered(table: Table, column: Facts) -> NDArray[np.intp]:
    """Return numbers (n,) that are equal where the cells of a column are."""
    if column.values is None:
        return groups(_texts(table, [column.name]))
    cells = np.full(column.rows, np.nan)
    cells[column.there] = column.values
    return groups(cells)


def _grouped(
    table: Table, found: Sequence[Facts], chosen: dict[str, tuple[str, ...]], keys: Iterable[str]
) -> NDArray[np.intp]:
    """Return numbers (n,) that are equal where all columns of these keys are."""
    names = {name for key in keys for name in chosen.get(key, ())}
    parts = [_numbered(table, column) for column in found if column.name in names]
    return groups(np.zeros(len(table.rows), np.intp), *parts)


def _counting(table: Table, found: Sequence[Facts], chosen: dict[str, tuple[str, ...]]) -> dict[str, str]:
    """Return which columns without a role are certainly clocks, counters or trial numbers, and why."""
    owner = _grouped(table, found, chosen, ("subject", "session"))
    group = groups(owner, _grouped(table, found, chosen, ("label", "object")))
    trial = groups(group, _grouped(table, found, chosen, ("trial",)))
    time = _time(table, chosen)
    name = chosen["time"][0] if time is not None and not np.isnan(time).any() else ""
    course = Course(owner, group, trial, time if name else None, name)
    taken = {name for columns in chosen.values() for name in columns}
    signs = {}
    for column in found:
        if column.name in taken or column.values is None or column.bits or column.distinct < 2:
            continue
        if (sign := course.sign(column.over_rows)) and sign.certain:
            signs[column.name] = sign.reason
    return signs


def _may_be(key: str, column: Facts) -> bool:
    if key == "time":
        return column.values is not None and column.distinct > 1 and is_time(column.words) and _dates(column)
    named = column.words <= WORDS[key] | WORDS["number"] if column.bits else True
    fits = named and column.nominal and (key != "label" or 1 < column.distinct <= _TYPES)
    return fits and bool(column.words & WORDS[key])


def _dates(column: Facts) -> bool:
    """Return whether a column with the name of a time dates rows: whole seconds do not, nor what wraps every second."""
    assert column.values is not None
    steps = np.diff(column.values)
    wraps = column.values.max() < 1e9 and unit_of_time(column.name, column.values) == "ns"
    return bool(2 * np.count_nonzero(steps) > len(steps) and not (wraps and (steps < 0).any()))


def _none(labels: NDArray[np.str_]) -> tuple[str, ...]:
    """Return the labels that mean that nothing is held.

    They are found by their words; or, in a stream, an empty label, 0 or -1 is one, if nearly all runs of other labels
    lie between runs of it. Unless two other labels remain, only "none" is taken.
    """
    found = np.unique(labels).tolist()
    none = {label for label in found if plain(label).removesuffix("s") in WORDS["none"]}
    changes = np.flatnonzero(labels[1:] != labels[:-1])
    for label in {"", "0", "-1"}.intersection(found) if in_runs(labels) else ():
        if np.mean((labels[changes] == label) | (labels[changes + 1] == label)) >= _BETWEEN:
            none.add(label)
    if len({*found} - none - {""}) < 2:
        none = {label for label in none if plain(label) == NONE}
    return tuple(sorted(none))


def _label(what: str, found: Sequence[Facts], chosen: dict[str, tuple[str, ...]]) -> tuple[tuple[str, ...], str]:
    """Return the column that is most likely the label if none has such a name."""
    if "object" in chosen:
        return chosen.pop("object"), "no column is called label, grasp or class: the objects are what can be recognised"
    taken = {name for columns in chosen.values() for name in columns}
    few = [column for column in found if column.nominal and 1 < column.distinct <= _TYPES and column.name not in taken]
    texts = [column for column in few if column.values is None]
    if not texts:
        raise TableError(f"{what}: no column looks like the grasp type: name it in a columns.toml (`label`)")
    best = min(texts, key=lambda column: column.distinct)
    return (best.name,), f"no column is called label, grasp or class: it is text, {best.distinct} different"


def _texts(table: Table, columns: Iterable[str]) -> NDArray[np.str_]:
    parts = [names(table.columns[name], table.cells, table.size).values for name in columns]
    return parts[0] if len(parts) == 1 else np.array([" ".join(row) for row in zip(*parts, strict=True)])


def _frames(
    table: Table,
    found: Sequence[Facts],
    chosen: dict[str, tuple[str, ...]],
    why: dict[str, str],
    held: NDArray[np.bool_],
) -> tuple[Literal["restart"] | None, str]:
    """Find how trials are delimited; return the value of `frames`, and what only the user can say.

    held  (n,) where the label does not mean that nothing is held
    """
    if not held.all() and _is_stream(table, chosen, held):
        if chosen.pop("trial", None):
            del why["trial"]
        why["label"] += "; a run of rows of one label is a trial (frames = restart)"
        return "restart", ""
    who = [name for key in ("label", "subject", "object", "session", "trial") for name in chosen.get(key, ())]
    ids = groups(*(_texts(table, [name]) for name in who))
    time = _time(table, chosen)
    if "trial" in chosen:
        taken = {*who, *chosen.get("time", ())}
        _add_parts(table, ids, time, [column for column in found if column.name not in taken], chosen, why)
        return None, ""
    if ids.max(initial=0) + 1 == len(ids):
        return None, ""
    if time is not None:
        trials = int(restarts(ids, time)[-1])
        if 2 * trials <= len(ids):
            why["time"] += f"; it starts anew {trials} times: these are the trials (frames = restart)"
            return "restart", ""
    return None, (
        "no column tells which rows are frames of one trial: name it (trial = ...), or state that each row is a "
        'separate trial (frames = "independent")'
    )


def _is_stream(table: Table, chosen: dict[str, tuple[str, ...]], held: NDArray[np.bool_]) -> bool:
    """Return whether runs of labels delimit trials better than a number of trials.

    A number that many runs share in which nothing is held is not the number of a movement.
    """
    who = [_texts(table, [name]) for key in ("label", "subject", "session", "trial") for name in chosen.get(key, ())]
    if "trial" not in chosen or not in_runs(*who):
        return in_runs(*who)
    ids = groups(*who)
    runs = np.count_nonzero((np.diff(ids, prepend=-1) != 0) & ~held)
    return bool(runs > _SHARED * len(np.unique(ids[~held])))


def _time(table: Table, chosen: dict[str, tuple[str, ...]]) -> NDArray[np.float64] | None:
    return times(table.columns[chosen["time"][0]], table.decimal).values if "time" in chosen else None


def _add_parts(
    table: Table,
    ids: NDArray[np.intp],
    time: NDArray[np.float64] | None,
    rest: Sequence[Facts],
    chosen: dict[str, tuple[str, ...]],
    why: dict[str, str],
) -> None:
    """Add columns to those of the trial without which a time would occur twice in one trial."""
    if time is None:
        return
    twice = len(ids) - len(np.unique(np.stack([ids, groups(time)]), axis=1).T)
    texts = [column for column in rest if column.values is None and 1 < column.distinct <= _TYPES]
    for column in sorted(texts, key=lambda column: column.distinct) if twice else ():
        finer = groups(ids, _texts(table, [column.name]))
        left = len(ids) - len(np.unique(np.stack([finer, groups(time)]), axis=1).T)
        if 2 * left < twice:
            ids, twice = finer, left
            chosen["trial"] = (column.name, *chosen["trial"])
            why["trial"] = f"with {column.name}, no time occurs twice in a trial"
    if len(chosen["trial"]) > 1:
        why["trial"] += f"; {int(ids.max()) + 1} trials"
