"""Propose a columns.toml for a table: the role of each column, from its name and values, with reasons."""

import glob
import re
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec
import numpy as np
import tomli_w
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.runtime.names import list_names, printable, shortened
from thenar.runtime.published import NONE

from .cells import bits, names, numbers, times
from .coding import sound_grid
from .columns import KEYS, PLAIN, Columns, JointColumns, TaxelColumns, TextFormat, TimeUnit
from .errors import FileRows, TableError
from .graspset import CODES
from .headers import skipped
from .oddities import first_oddity
from .sniff import sniff
from .table import Table, is_text, read_table
from .taxonomy import plain, published_for
from .trial_files import Report, emptied, find_files, is_pattern, read_files
from .trials import groups, in_runs, restarts, unit_of_time

# Words in the names of columns, as people write them in several languages.
_LISTS = {
    "label": "grasp grip label class gesture posture pose category target action griff griffart greifart "
    "klasse geste prise classe agarre clase presa restimulus y",
    "subject": "subject subj who wer participant person user wearer proband teilnehmer sujet participante sujeto",
    "object": "object obj item thing objekt gegenstand objet objeto oggetto",
    "session": "session day visit sitzung tag jour séance sesión sessione",
    "trial": "trial rep repetition rerepetition repeat attempt take run versuch wiederholung durchgang essai "
    "répétition ensayo",
    "time": "time timestamp stamp elapsed clock frame t zeit zeitstempel bild temps tiempo tempo",
    "unit": "ms s us sec second millisecond microsecond no nr number",
    "note": "n num id idx duration age date gender sex row stimulus emg acc accel gyro inclin",
    "pad": "pad taxel fsr pressure force tactile touch press contact druck kraft pression presión",
    # Labels that mean that nothing is held, in plain spelling.
    "none": "none nothing null nograsp nogrip nograsping noobject nomovement nomotion nogesture rest resting restpose "
    "restposition idle idling idlemovement relax relaxed neutral neutralposition open openhand handopen openpalm "
    "empty emptyhand free freehand background pause wait waiting approach approaching release releasing released ruhe "
    "ruhelage ruheposition leerlauf offen offenehand leer leerehand keine keingriff entspannt repos aucun aucune rien "
    "mainouverte vide reposo descanso ninguno ninguna nada manoabierta riposo nessuno nessuna manoaperta",
    "joint": "flex bend joint angle glove cyberglove enc encoder mcp pip dip cmc abduction winkel biegung",
}
# Without a plural s, since words are looked up that way.
_WORDS = {role: frozenset(word.removesuffix("s") or word for word in words.split()) for role, words in _LISTS.items()}
# The share of a stream's label changes that lead to or from the label for nothing held.
_BETWEEN = 0.9
# Nothing is held before and after a grasp; a number shared by more runs than these is not the number of a movement.
_SHARED = 3
# Columns with more distinct values than this are not grasp types.
_TYPES = 200
# An unknown analog column is a pad if this share of its cells is at rest, in the lowest tenth of its range.
_AT_REST, _REST = 0.5, 0.1
# Resolutions in bits of existing converters.
_CONVERTERS = (8, 10, 12, 14, 16)
_PADS = ': a placement chooses their levels (threshold = 0.4, or "otsu", makes switches of them)'
_CODES, _MOST_JOINTS = "whole numbers, taken as codes", 24
# The start of the reason for joints with values, followed by their grid.
_NUMBERS = "numbers, coded on a grid of "


class Role(msgspec.Struct, frozen=True):
    """The assumed role of some columns, and the reason."""

    columns: tuple[str, ...]
    role: str
    reason: str


class Proposal(msgspec.Struct, frozen=True):
    """The proposed roles of a table's columns; `lacks` is what only the user can say, "" if nothing."""

    columns: Columns
    roles: tuple[Role, ...]
    remarks: tuple[str, ...]
    lacks: str = ""

    def independent(self) -> "Proposal":
        """Return the proposal with the statement that each row is a separate trial."""
        return replace(self, columns=replace(self.columns, frames="independent"), lacks="")

    def toml(self) -> str:
        """Return the text of the columns.toml, with the reasons."""
        said = [*self.remarks, *(f"{listed(role.columns)}: {role.role}: {role.reason}" for role in self.roles)]
        said += [f"TO DO: {self.lacks}"] if self.lacks else []
        return (
            "".join(f"# {printable(line)}\n" for line in said) + "\n" + tomli_w.dumps(msgspec.to_builtins(self.columns))
        )


def listed(columns: Sequence[str]) -> str:
    """Return the names of columns; if more than three, only the first and the last."""
    if len(columns) <= 3:
        return ", ".join(map(shortened, columns))
    return f"{shortened(columns[0])} ... {shortened(columns[-1])} ({len(columns)})"


class _Column(NamedTuple):
    """Facts about a column: the words of its name; its numbers, None for text; the number of distinct values, and which
    rows have one.
    """

    name: str
    words: frozenset[str]
    values: NDArray[np.float64] | None
    bits: bool
    distinct: int
    there: NDArray[np.bool_]

    @property
    def rows(self) -> int:
        """Number of its rows."""
        return len(self.there)

    @property
    def whole(self) -> bool:
        """Whether it holds integers."""
        return self.values is not None and bool((self.values == np.rint(self.values)).all())

    @property
    def nominal(self) -> bool:
        """Whether it may be categorical."""
        return bool(self.distinct) and (self.values is None or self.whole)

    @property
    def counts_rows(self) -> bool:
        """Whether it numbers the rows."""
        return self.whole and self.values is not None and self.rows > 2 and bool((np.diff(self.values) == 1).all())


def _look(table: Table, name: str) -> _Column:
    column = table.columns[name]
    found = re.findall(r"[A-Z]{2,}(?![^\W\dA-Z_])|[^\W\d_][^\W\dA-Z_]*", name)
    words = frozenset(word.casefold().removesuffix("s") or word for word in found)
    parsed = (times if _is_time(words) else numbers)(column, table.decimal)
    if parsed.wrong.any():
        switch = bits(column, table.decimal)
        if not switch.wrong.any():
            closed = switch.values[~switch.missing].astype(np.float64)
            return _Column(name, words, closed, True, 2, ~switch.missing)
        read = names(column, table.cells, table.size)
        return _Column(name, words, None, False, len(np.unique(read.values[~read.missing])), ~read.missing)
    values = parsed.values[~parsed.missing]
    distinct = np.unique(values)
    two = bool(len(distinct)) and bool(np.isin(distinct, (0, 1)).all())
    return _Column(name, words, values, two, len(distinct), ~parsed.missing)


def propose_file(path: Path, progress: Report = lambda _done, _total: None) -> tuple[Table, Proposal]:
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
        raise TableError(f"{reason}; {odd}" if (odd := first_oddity(table)) else str(reason)) from reason
    if others:
        left = f"{len(others)} tables next to them do not match: {list_names([shortened(name) for name in others])}"
        proposal = replace(proposal, remarks=(f"files: {len(files)}; {left}", *proposal.remarks))
    return table, _by_file(table, proposal, tuple(paths)) if files else proposal


def _by_file(table: Table, proposal: Proposal, paths: tuple[str, ...]) -> Proposal:
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


def propose(table: Table, text: TextFormat = PLAIN, remarks: Sequence[str] = ()) -> Proposal:
    """Return the proposed roles of the columns of `table`. Raises TableError if there is no label or no input."""
    found = [_look(table, name) for name in table.columns]
    chosen, why = _named(found)
    if "label" not in chosen:
        chosen["label"], why["label"] = _label(table.what, found, chosen)
    labels = _texts(table, chosen["label"])
    none = _none(labels)
    held = ~np.isin(labels, none)
    frames, lacks = _frames(table, found, chosen, why, held)
    if (unit := _unit(table, chosen)) is not None:
        why["time"] += f"; in {unit}"
    taken = {name for columns in chosen.values() for name in columns}
    inputs = _inputs([column for column in found if column.name not in taken], held)
    if not any(role.role in ("switches", "taxels", "joints") for role in inputs):
        raise TableError(f"{table.what}: no column holds numbers that change: it has no inputs")
    used = taken | {name for role in inputs if role.role != "left out" for name in role.columns}
    excused = {name for key in ("label", "object", "session", "trial") for name in chosen.get(key, ())}
    missing = sum(
        bool((~column.there & (held | (column.name not in excused))).any()) for column in found if column.name in used
    )
    taxonomy = published_for({*labels[held].tolist()} - {""}) or "own"
    columns = Columns(
        **{key: those[0] if len(those) == 1 else those for key, those in chosen.items()},  # type: ignore[arg-type]
        time_unit=unit,
        none=none[0] if len(none) == 1 else none,
        frames=frames,
        taxonomy=taxonomy,
        missing="keep" if missing else "refuse",
        **text._asdict(),
        switches=_globs((name for role in inputs if role.role == "switches" for name in role.columns), table.columns),
        taxels=tuple(
            TaxelColumns(_globs(role.columns, table.columns), bits=_bits_of(role, found))
            for role in inputs
            if role.role == "taxels"
        ),
        joints=tuple(_joints(role, table.columns) for role in inputs if role.role == "joints"),
    )
    notes = [f"{missing} columns miss cells, which are filled: see `missing`"] if missing else []
    notes += [f"the labels are grasp types of {taxonomy}"] if taxonomy != "own" else []
    if none:
        shown = ", ".join(shortened(repr(label)) for label in none)
        notes += [f"nothing is held where the label is {shown} ({np.mean(~held):.0%} of the rows): see `none`"]
    roles = [Role(chosen[key], key, why[key]) for key in KEYS if key in chosen]
    return Proposal(columns, (*roles, *inputs), (*remarks, *notes), lacks)


def _named(found: Sequence[_Column]) -> tuple[dict[str, tuple[str, ...]], dict[str, str]]:
    """Return the columns with a role given by their names, and the reasons."""
    chosen: dict[str, tuple[str, ...]] = {}
    for key in ("time", "session", "trial", "subject", "object", "label"):
        best = [
            (not column.words <= _WORDS[key] | _WORDS["unit"], column.distinct == column.rows, place)
            for place, column in enumerate(found)
            if (column.name,) not in chosen.values() and _may_be(key, column)
        ]
        if best:
            chosen[key] = (found[min(best)[2]].name,)
    distinct = {column.name: column.distinct for column in found}
    return chosen, {key: f"its name; {distinct[name]} different" for key, (name,) in chosen.items()}


def _may_be(key: str, column: _Column) -> bool:
    if key == "time":
        return column.values is not None and column.distinct > 1 and _is_time(column.words)
    named = column.words <= _WORDS[key] | _WORDS["unit"] if column.bits else True
    fits = named and column.nominal and (key != "label" or 1 < column.distinct <= _TYPES)
    return fits and bool(column.words & _WORDS[key])


def _is_time(words: frozenset[str]) -> bool:
    return bool(words & _WORDS["time"]) and words <= _WORDS["time"] | _WORDS["unit"]


def _none(labels: NDArray[np.str_]) -> tuple[str, ...]:
    """Return the labels that mean that nothing is held.

    They are found by their words; or, in a stream, an empty label, 0 or -1 is one, if nearly all runs of other labels
    lie between runs of it. Unless two other labels remain, only "none" is taken.
    """
    found = np.unique(labels).tolist()
    none = {label for label in found if plain(label).removesuffix("s") in _WORDS["none"]}
    changes = np.flatnonzero(labels[1:] != labels[:-1])
    for label in {"", "0", "-1"}.intersection(found) if in_runs(labels) else ():
        if np.mean((labels[changes] == label) | (labels[changes + 1] == label)) >= _BETWEEN:
            none.add(label)
    if len({*found} - none - {""}) < 2:
        none = {label for label in none if plain(label) == NONE}
    return tuple(sorted(none))


def _unit(table: Table, chosen: dict[str, tuple[str, ...]]) -> TimeUnit | None:
    time = _time(table, chosen)
    return None if time is None else unit_of_time(chosen["time"][0], time[~np.isnan(time)])


def _label(what: str, found: Sequence[_Column], chosen: dict[str, tuple[str, ...]]) -> tuple[tuple[str, ...], str]:
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
    found: Sequence[_Column],
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
    rest: Sequence[_Column],
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


def _inputs(columns: Sequence[_Column], held: NDArray[np.bool_]) -> list[Role]:
    """Return the roles of the other columns, grouped; held (n,) are rows of grasps."""
    found: dict[tuple[str, str], list[str]] = {}
    stems: dict[str, list[_Column]] = {}
    for column in columns:
        if out := _no_input(column):
            found.setdefault(("left out", out), []).append(column.name)
        else:
            stems.setdefault("" if column.bits else _stem(column.name), []).append(column)
    # Columns whose names differ only in a number have the same role, whatever the range of each.
    for several in stems.values():
        found.setdefault(_input(several, held), []).extend(column.name for column in several)
    if len(found.get(("joints", _CODES), ())) > _MOST_JOINTS:
        found[("taxels", f"whole numbers in more columns than a hand has joints{_PADS}")] = found.pop(
            ("joints", _CODES)
        )
    order = ["switches", "taxels", "joints", "left out"]
    return [Role(tuple(alike), *key) for key, alike in sorted(found.items(), key=lambda item: order.index(item[0][0]))]


def _stem(name: str) -> str:
    return name.rstrip("0123456789")


def _input(columns: Sequence[_Column], held: NDArray[np.bool_]) -> tuple[str, str]:
    """Return the role of a group of inputs, and the reason; held (n,) are rows of grasps."""
    words = frozenset[str]().union(*(column.words for column in columns))
    values = np.concatenate([column.values for column in columns if column.values is not None])
    if all(column.bits for column in columns):
        return "switches", "0 and 1 only"
    if words & _WORDS["pad"]:
        return "taxels", f"pads by their names{_PADS}"
    if not all(column.whole for column in columns) or values.min() < 0 or values.max() >= CODES:
        return "joints", f"{_NUMBERS}{sound_grid(values):g}"
    # A pad rests at the lower end of its range while others are touched; between supply and converter, at the upper.
    each = [column.values[held[column.there]] for column in columns if column.values is not None]
    places = [(part - part.min()) / max(float(np.ptp(part)), 1.0) for part in each if part.size]
    rest = max(np.mean([np.mean(place <= _REST) for place in of]) for of in (places, [1 - place for place in places]))
    if not words & _WORDS["joint"] and rest > _AT_REST:
        return "taxels", f"at rest in most rows, as a pad is{_PADS}"
    return "joints", _CODES


def _bits_of(role: Role, found: Sequence[_Column]) -> int | None:
    """Return the bits of the smallest converter that gives these counts, None if they are not counts."""
    each = [column.values for column in found if column.name in role.columns and column.values is not None]
    whole = all(column.whole for column in found if column.name in role.columns)
    if not whole or min(part.min() for part in each) < 0:
        return None
    most = max(part.max() for part in each)
    return next((bits for bits in _CONVERTERS if most < 2**bits), None)


def _no_input(column: _Column) -> str:
    """Return why a column is not an input, "" if it is one."""
    if not column.distinct:
        return "empty"
    if column.values is None:
        return "text"
    if column.counts_rows:
        return "it numbers the rows"
    if column.bits:
        return ""
    if column.distinct == 1:
        return "it never changes"
    if column.words & _WORDS["note"] or _is_time(column.words):
        return "by its name a note on the row"
    if column.words and any(column.words <= _WORDS[key] - {"y"} for key in ("label", "trial")) and column.nominal:
        return "by its name another label, or number of a trial"
    return ""


def _joints(role: Role, every: Iterable[str]) -> JointColumns:
    """Return the entry of joints: with codes, or with values on one grid."""
    columns = _globs(role.columns, every)
    if not role.reason.startswith(_NUMBERS):
        return JointColumns(columns, "counts", codes=True)
    words = {word for name in role.columns for word in re.findall(r"[a-z]+", name.casefold())}
    unit = next((unit for unit in ("deg", "rad", "mm", "cm") if unit in words), "units")
    return JointColumns(columns, unit, grid=float(role.reason.removeprefix(_NUMBERS)))


def _globs(columns: Iterable[str], every: Iterable[str]) -> tuple[str, ...]:
    """Return globs that match exactly `columns` among `every` one: a star if a stem has no others."""
    there = sorted(every)
    stems: dict[str, list[str]] = {}
    for name in columns:
        stems.setdefault(_stem(name), []).append(name)
    found: list[str] = []
    for stem, alike in stems.items():
        others = bisect_left(there, stem + "\U0010ffff") - bisect_left(there, stem) - len(alike)
        found += [f"{glob.escape(stem)}*"] if stem and len(alike) > 2 and not others else map(glob.escape, alike)
    return tuple(found)
