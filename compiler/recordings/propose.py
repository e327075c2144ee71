"""Propose a columns.toml for a table: the role of each column, from its name and values, with reasons."""

import dataclasses
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.runtime.names import list_names, printable, shortened
from thenar.runtime.published import NONE

from ..arrays import groups
from . import FileRows, TableError, list_rows
from .cells import names, numbers, times, unit_of_time
from .columns import KEYS, PLAIN, ColumnRoles, JointColumns, TaxelColumns, TextFormat, globs_of
from .inputs import MOST_TYPES, ON_GRID, WORDS, Course, Facts, Role, doubts, facts_of, inputs_of, may_be, numbers_trials
from .joining import read_joined
from .readings import in_runs, restarts
from .table import Table
from .taxonomy import plain, published_for
from .trial_files import Report

# The share of a stream's label changes that lead to or from the label for nothing held.
_BETWEEN = 0.9
# Nothing is held before and after a grasp; a number shared by more runs than these is not the number of a movement.
_SHARED = 3
# Resolutions in bits of existing converters.
_CONVERTERS = (8, 10, 12, 14, 16)


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


def listed(columns: Sequence[str]) -> str:
    """Return the names of columns; if more than three, only the first and the last."""
    if len(columns) <= 3:
        return ", ".join(map(shortened, columns))
    return f"{shortened(columns[0])} ... {shortened(columns[-1])} ({len(columns)})"


def propose_file(
    path: Path, progress: Report = lambda _done, _total: None, more: Sequence[Path] = ()
) -> tuple[Table, ColumnProposal]:
    """Return the table in `path`, or in the files that match it as a pattern, and the proposed roles of its columns.

    Further tables of the same trials are `more`. `progress` takes the number of files that were read, and of all.
    Raises TableError, OSError.
    """
    table, text, remarks = read_joined(path, more, progress)
    # What a path says is no input, and only a field that is called so has a role.
    rows = table.rows
    paths = [*sorted({*rows.fields} - {*KEYS}), rows.column] if isinstance(rows, FileRows) else []
    paths += [table.segment] if table.segment else []
    emptied = dict.fromkeys(paths, np.full(len(rows), ""))
    try:
        proposal = propose(dataclasses.replace(table, columns={**table.columns, **emptied}), text, remarks)
    except TableError as reason:
        raise TableError(f"{reason}; {odd}" if (odd := _first_oddity(table)) else str(reason)) from reason
    return table, _by_file(table, proposal, tuple(paths)) if paths else proposal


def _first_oddity(table: Table) -> str:
    """Return the first oddity of `table` as the end of a sentence, with what to do; "" if there is none."""
    if len(table.columns) == 1:
        (name,) = table.columns
        return f"its rows have one cell each, under {shortened(repr(name))}: name the `delimiter` in a columns.toml"
    return min(_oddities(table, table.columns), default=(0, "", ""))[2]


def _oddities(table: Table, names: Iterable[str]) -> Iterator[tuple[int, str, str]]:
    """Yield the first cell that is no number, of each column of numbers: its row, the column, and a sentence."""
    for name in names:
        column = table.columns[name]
        wrong = np.flatnonzero(numbers(column, table.decimal).wrong)
        if not wrong.size:
            continue
        row, cell = int(wrong[0]), str(column[wrong[0]]).strip()
        shown = f"{list_rows(table.rows[[row]])} has {shortened(repr(cell))} in column {shortened(repr(name))}"
        if cell[:1] in ("[", "("):
            yield row, name, f"{shown}: write a list of numbers in each cell, or a column for each number"
        elif 2 * wrong.size < len(column):
            yield row, name, f"{shown}, which holds numbers elsewhere: correct the cell or delete the row"


def _by_file(table: Table, proposal: ColumnProposal, paths: tuple[str, ...]) -> ColumnProposal:
    """Return the proposal with the file among the columns of the trial, unless no trial is in two files.

    Not in a stream with rest, whose trials are runs of rows of one label; and segments are trials. `paths` are the
    columns that nothing but the path or the segments fill.
    """
    columns, rows = proposal.columns, table.rows
    roles = [
        replace(role, columns=tuple(name for name in role.columns if name not in paths)) for role in proposal.roles
    ]
    roles = [role for role in roles if role.columns]
    if table.segment:
        trials: tuple[str, ...] = (table.segment,)
        reason = "each segment is one trial"
    else:
        assert isinstance(rows, FileRows)
        parts = [name for key in KEYS if key != "time" for name in columns.parts(key)]
        file, trial = groups(_texts(table, [rows.column])), groups(*(_texts(table, [name]) for name in parts))
        is_stream = columns.frames == "restart" and columns.none
        if is_stream or (columns.parts("trial") and len(np.unique(groups(trial, file))) == trial.max() + 1):
            return replace(proposal, roles=(*roles, Role(paths, "left out", "of the path")))
        trials = (rows.column, *columns.parts("trial"))
        reason = "each file is one trial" if len(trials) == 1 else "numbers of trials are of one file"
    rest = tuple(name for name in paths if name not in trials)
    return replace(
        proposal,
        columns=replace(columns, trial=trials if len(trials) > 1 else trials[0], frames=None),
        roles=(
            *(role for role in roles if role.role != "trial"),
            Role(trials, "trial", reason),
            *([Role(rest, "left out", "of the path")] if rest else ()),
        ),
        lacks="",
    )


@np.errstate(over="ignore", invalid="ignore")
def propose(table: Table, text: TextFormat = PLAIN, remarks: Sequence[str] = ()) -> ColumnProposal:
    """Return the proposed roles of the columns of `table`. Raises TableError if there is no label or no input."""
    search = _Search(table)
    search.by_names()
    search.names_of_numbers()
    labels = _texts(table, search.chosen["label"])
    none = _none(labels)
    held = ~np.isin(labels, none)
    search.trial_number()
    search.constant_texts()
    frames, lacks = search.frames(held)
    time, unit = search.time, None
    if time is not None and (unit := unit_of_time(search.chosen["time"][0], time[~np.isnan(time)])):
        search.why["time"] += f"; in {unit}"
    inputs = inputs_of(search.rest, held, search.clocks() | search.out)
    if not any(role.role in ("switches", "taxels", "joints") for role in inputs):
        out_of = [f"{listed(role.columns)} ({role.reason})" for role in inputs if role.reason not in ("text", "empty")]
        left = f"; left out are {list_names(out_of)}" if out_of else ""
        raise TableError(f"{table.what}: no column holds numbers that change: it has no inputs{left}")
    used = {*search.named(*KEYS), *(name for role in inputs if role.role != "left out" for name in role.columns)}
    excused = {*search.named("label", "object", "session", "trial")}
    missing = sum(
        bool((~column.there & (held | (column.name not in excused))).any())
        for column in search.columns
        if column.name in used
    )
    taxonomy = published_for({*labels[held].tolist()} - {""}) or "own"
    columns = ColumnRoles(
        **{key: those[0] if len(those) == 1 else those for key, those in search.chosen.items()},  # type: ignore[arg-type]
        time_unit=unit,
        none=none[0] if len(none) == 1 else none,
        frames=frames,
        taxonomy=taxonomy,
        missing="keep" if missing else "refuse",
        **text._asdict(),
        switches=globs_of((name for role in inputs if role.role == "switches" for name in role.columns), table.columns),
        taxels=tuple(
            TaxelColumns(globs_of(role.columns, table.columns), bits=_bits_of(role, search.columns))
            for role in inputs
            if role.role == "taxels"
        ),
        joints=tuple(_joints_of(role, table.columns) for role in inputs if role.role == "joints"),
    )
    notes = [f"{missing} columns miss cells, which are filled: see `missing`"] if missing else []
    notes += [f"the labels are grasp types of {taxonomy}"] if taxonomy != "own" else []
    if none:
        shown = ", ".join(shortened(repr(label)) for label in none)
        notes += [f"nothing is held where the label is {shown} ({np.mean(~held):.0%} of the rows): see `none`"]
    roles = [Role(search.chosen[key], key, search.why[key]) for key in KEYS if key in search.chosen]
    return ColumnProposal(columns, (*roles, *inputs), (*remarks, *notes), lacks)


class _Search:
    """The columns of a table, and the roles of those other than inputs, as far as they are found.

    chosen  the columns of each key of a columns.toml
    why     the reasons for them
    out     the reasons why other columns are left out
    """

    def __init__(self, table: Table) -> None:
        self.table = table
        self.columns = [facts_of(table, name) for name in table.columns]
        self.chosen: dict[str, tuple[str, ...]] = {}
        self.why: dict[str, str] = {}
        texts = (column.name for column in self.columns if column.values is None)
        self.out = {name: sentence for _, name, sentence in _oddities(table, texts)}

    def choose(self, key: str, column: Facts, why: str) -> None:
        """Give a column the role `key`."""
        self.chosen[key], self.why[key] = (column.name,), why

    def named(self, *keys: str) -> list[str]:
        """Return the columns with the roles `keys`."""
        return [name for key in keys for name in self.chosen.get(key, ())]

    @property
    def rest(self) -> list[Facts]:
        """The columns without a role."""
        names = {*self.named(*KEYS)}
        return [column for column in self.columns if column.name not in names]

    @property
    def free(self) -> list[Facts]:
        """The columns without a role that are not left out."""
        return [column for column in self.rest if column.name not in self.out]

    @cached_property
    def time(self) -> NDArray[np.float64] | None:
        """The times (n,), after a search by names."""
        (name,) = self.chosen.get("time", ("",))
        return times(self.table.columns[name], self.table.decimal).values if name else None

    def numbered(self, column: Facts) -> NDArray[np.intp]:
        """Return numbers (n,) that are equal where the cells of a column are."""
        if column.values is None:
            return groups(_texts(self.table, [column.name]))
        cells = np.full(column.rows, np.nan)
        cells[column.there] = column.values
        return groups(cells)

    def grouped(self, *keys: str) -> NDArray[np.intp]:
        """Return numbers (n,) that are equal where all columns of these keys are."""
        names = self.named(*keys)
        parts = [self.numbered(column) for column in self.columns if column.name in names]
        return groups(np.zeros(len(self.table.rows), np.intp), *parts)

    def by_names(self) -> None:
        """Choose columns by their names; without such a label, the objects, or the text with the fewest values."""
        for key in ("time", "session", "trial", "subject", "object", "label"):
            if fitting := [column for column in self.rest if may_be(key, column)]:
                best = min(fitting, key=lambda column: doubts(key, column))
                self.choose(key, best, f"its name; {best.distinct} different")
        if "label" in self.chosen:
            return
        unnamed = "no column is called label, grasp or class"
        if "object" in self.chosen:
            self.chosen["label"] = self.chosen.pop("object")
            self.why["label"] = f"{unnamed}: the objects are what can be recognised"
            return
        texts = [column for column in self.free if column.values is None and 1 < column.distinct <= MOST_TYPES]
        if not texts:
            raise TableError(
                f"{self.table.what}: no column looks like the grasp type: name it in a columns.toml (`label`)"
            )
        best = min(texts, key=lambda column: column.distinct)
        self.choose("label", best, f"{unnamed}: it is text, {best.distinct} different")

    def names_of_numbers(self) -> None:
        """Replace numbers of labels, subjects, objects and sessions by their names; leave out other such numbers."""
        for key in ("label", "subject", "object", "session"):
            if key not in self.chosen:
                continue
            column = next(column for column in self.columns if column.name == self.chosen[key][0])
            alike = [other for other in self.free if not other.bits and self._corresponds(other, column)]
            words = frozenset[str]().union(*(WORDS[role] for role in WORDS.keys() & {*KEYS} - {key}))
            names = [other for other in alike if other.values is None and not other.words & words]
            if column.values is not None and names:
                best = max(names, key=lambda other: bool(other.words & (WORDS[key] | WORDS["person"])))
                self.choose(key, best, f"the name of each number in {column.name}; {best.distinct} different")
                alike = [column, *(other for other in alike if other is not best)]
            self.out |= {
                other.name: f"the number of {shortened(self.chosen[key][0])}"
                for other in alike
                if other.values is not None and other.distinct == 1 + np.ptp(other.values)
            }

    def _corresponds(self, other: Facts, column: Facts) -> bool:
        """Return whether a column has one value for each of another's, more than one and fewer than there are rows."""
        if not (other.nominal and 1 < other.distinct == column.distinct < other.rows):
            return False
        return int(groups(self.numbered(other), self.numbered(column)).max()) + 1 == column.distinct

    def trial_number(self) -> None:
        """Take a column that numbers the trials for the trial, if none has such a name."""
        if "trial" in self.chosen:
            return
        group = self.grouped("label", "subject", "object", "session")
        for column in self.free:
            if not column.bits and column.whole and column.distinct > 1 and numbers_trials(column.over_rows, group):
                why = f"consecutive numbers, one for each run of rows; {column.distinct} different"
                self.choose("trial", column, why)
                return

    def constant_texts(self) -> None:
        """Take texts that are constant within trials for the subject, the session or the object."""
        label = self.grouped("label")
        trial = np.cumsum(np.diff(self.grouped("label", "subject", "object", "session", "trial"), prepend=-1) != 0)
        types = len(np.unique(label))
        for column in self.free:
            if column.values is not None or not 1 < column.distinct <= MOST_TYPES:
                continue
            text = _texts(self.table, [column.name])
            changes = text[1:] != text[:-1]
            inside = np.count_nonzero(changes & (trial[1:] == trial[:-1]))
            if 2 * column.distinct > np.count_nonzero(changes) + 1 + trial[-1] or (inside and "trial" in self.chosen):
                continue
            pairs = len(np.unique(groups(label, text)))
            if pairs == types:
                self.out[column.name] = f"text that {shortened(self.chosen['label'][0])} determines"
            elif key := self._who(column, crossed=pairs >= types * column.distinct / 2):
                why = f"text, constant within trials; {column.distinct} different: is it the {key}?"
                self.choose(key, column, why)
            else:
                self.out[column.name] = "text, constant within trials: name it (subject, object, session) if it is one"

    def _who(self, column: Facts, crossed: bool) -> str:
        """Return the role of a text that is constant within trials, by its name, or by whether most labels have it.

        A text of two values without a name that tells is none: it may be a remark, such as "left" or "ok".
        """
        if column.words & WORDS["person"] and "subject" not in self.chosen:
            return "subject"
        if column.words & WORDS["occasion"] and "session" not in self.chosen:
            return "session"
        likely = ("subject", "session") if crossed else ("object",)
        return next((key for key in likely if key not in self.chosen and column.distinct > 2), "")

    def frames(self, held: NDArray[np.bool_]) -> tuple[Literal["restart"] | None, str]:
        """Find how trials are delimited; return the value of `frames`, and what only the user can say.

        held  (n,) where the label does not mean that nothing is held
        """
        if not held.all() and self._is_stream(held):
            if self.chosen.pop("trial", None):
                del self.why["trial"]
            self.why["label"] += "; a run of rows of one label is a trial (frames = restart)"
            return "restart", ""
        parts = self.named("label", "subject", "object", "session", "trial")
        ids = groups(*(_texts(self.table, [name]) for name in parts))
        if "trial" in self.chosen:
            self._add_parts(ids)
            return None, ""
        if ids.max(initial=0) + 1 == len(ids):
            return None, ""
        trials = len(ids) if self.time is None else int(restarts(ids, self.time)[-1])
        if 2 * trials <= len(ids):
            self.why["time"] += f"; it starts anew {trials} times: these are the trials (frames = restart)"
            return "restart", ""
        return None, (
            "no column tells which rows are frames of one trial: name it (trial = ...), or state that each row is a "
            'separate trial (frames = "independent")'
        )

    def _is_stream(self, held: NDArray[np.bool_]) -> bool:
        """Return whether runs of labels delimit trials better than a number of trials.

        A number that many runs share in which nothing is held is not the number of a movement.
        """
        parts = [_texts(self.table, [name]) for name in self.named("label", "subject", "session", "trial")]
        if "trial" not in self.chosen or not in_runs(*parts):
            return in_runs(*parts)
        ids = groups(*parts)
        runs = np.count_nonzero((np.diff(ids, prepend=-1) != 0) & ~held)
        return bool(runs > _SHARED * len(np.unique(ids[~held])))

    def _add_parts(self, ids: NDArray[np.intp]) -> None:
        """Add columns to those of the trial without which a time would occur twice in one trial."""
        if self.time is None:
            return
        time = groups(self.time)
        twice = len(ids) - len(np.unique(groups(ids, time)))
        texts = [column for column in self.rest if column.values is None and 1 < column.distinct <= MOST_TYPES]
        for column in sorted(texts, key=lambda column: column.distinct) if twice else ():
            finer = groups(ids, _texts(self.table, [column.name]))
            left = len(ids) - len(np.unique(groups(finer, time)))
            if 2 * left < twice:
                ids, twice = finer, left
                self.chosen["trial"] = (column.name, *self.chosen["trial"])
                self.why["trial"] = f"with {column.name}, no time occurs twice in a trial"
        if len(self.chosen["trial"]) > 1:
            self.why["trial"] += f"; {int(ids.max()) + 1} trials"

    def clocks(self) -> dict[str, str]:
        """Return which columns without a role are certainly clocks, counters or trial numbers, and why."""
        owner = self.grouped("subject", "session")
        group = groups(owner, self.grouped("label", "object"))
        trial = groups(group, self.grouped("trial"))
        name = self.chosen["time"][0] if self.time is not None and not np.isnan(self.time).any() else ""
        course = Course(owner, group, trial, self.time if name else None, name)
        signs = {}
        for column in self.free:
            if column.values is None or column.bits or column.distinct < 2:
                continue
            reason, certain = course.sign(column.over_rows) or ("", False)
            if certain:
                signs[column.name] = reason
        return signs


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


def _texts(table: Table, columns: Iterable[str]) -> NDArray[np.str_]:
    """Return the texts (n,) of columns, joined with blanks."""
    parts = [names(table.columns[name], table.cells, table.size).values for name in columns]
    return parts[0] if len(parts) == 1 else np.array([" ".join(row) for row in zip(*parts, strict=True)])


def _bits_of(role: Role, columns: Sequence[Facts]) -> int | None:
    """Return the bits of the smallest converter that gives these counts, None if they are not counts."""
    several = [column for column in columns if column.name in role.columns]
    values = [column.values for column in several if column.values is not None]
    if not all(column.whole for column in several) or min(part.min() for part in values) < 0:
        return None
    most = max(part.max() for part in values)
    return next((bits for bits in _CONVERTERS if most < 2**bits), None)


def _joints_of(role: Role, columns: Iterable[str]) -> JointColumns:
    """Return the entry of joints: with codes, or with values on one grid."""
    globs = globs_of(role.columns, columns)
    if not role.reason.startswith(ON_GRID):
        return JointColumns(globs, "counts", codes=True)
    words = {word for name in role.columns for word in re.findall(r"[a-z]+", name.casefold())}
    unit = next((unit for unit in ("deg", "rad", "mm", "cm") if unit in words), "units")
    return JointColumns(globs, unit, grid=float(role.reason.removeprefix(ON_GRID)))
