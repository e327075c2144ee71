"""Tell from names and values which columns of a table are switches, taxels or joints, and which are no inputs."""

import glob
import re
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import shortened

from .cells import bits, names, numbers, times
from .clocks import is_count, is_time, words_of
from .coding import sound_grid
from .columns import JointColumns
from .graspset import CODES
from .table import Table

# Words in the names of columns, as people write them in several languages.
_LISTS = {
    "label": "grasp grip label class gesture posture pose category target action griff griffart greifart "
    "klasse geste prise classe agarre clase presa restimulus y",
    "subject": "subject subj who wer participant person user wearer proband teilnehmer sujet participante sujeto",
    "object": "object obj item thing objekt gegenstand objet objeto oggetto",
    "session": "session day visit sitzung tag jour séance sesión sessione",
    "trial": "trial rep repetition rerepetition repeat attempt take run versuch wiederholung durchgang essai "
    "répétition ensayo",
    "number": "no nr number",
    # Words in the names of texts that are subjects or sessions if they are constant within trials.
    "person": "name tester operator volunteer",
    "occasion": "batch date round block group week recording",
    "note": "n num id idx duration age date gender sex row stimulus emg acc accel gyro inclin",
    "finger": "thumb index middle ring little pinky pinkie finger daumen zeigefinger mittelfinger ringfinger pouce "
    "majeur annulaire auriculaire pulgar indice medio anular",
    "pad": "pad taxel fsr tip pressure force tactile touch press contact druck kraft pression presión",
    # Labels that mean that nothing is held, in plain spelling.
    "none": "none nothing null nograsp nogrip nograsping noobject nomovement nomotion nogesture rest resting restpose "
    "restposition idle idling idlemovement relax relaxed neutral neutralposition open openhand handopen openpalm "
    "empty emptyhand free freehand background pause wait waiting approach approaching release releasing released ruhe "
    "ruhelage ruheposition leerlauf offen offenehand leer leerehand keine keingriff entspannt repos aucun aucune rien "
    "mainouverte vide reposo descanso ninguno ninguna nada manoabierta riposo nessuno nessuna manoaperta",
    "joint": "flex bend joint angle glove cyberglove enc encoder mcp pip dip cmc abduction winkel biegung",
}
WORDS = {role: words_of(words) for role, words in _LISTS.items()}
# An unknown analog column is a pad if this share of its cells is at rest, in the lowest tenth of its range.
_AT_REST, _REST = 0.5, 0.1
# Resolutions in bits of existing converters.
_CONVERTERS = (8, 10, 12, 14, 16)
_PADS = ': a placement chooses their levels (threshold = 0.4, or "otsu", makes switches of them)'
_RESTS = "at rest in most rows, as a pad is"
_CODES, _MOST_JOINTS = "whole numbers, taken as codes", 24
# The start of the reason for joints with values, followed by their grid.
_NUMBERS = "numbers, coded on a grid of "


class Role(msgspec.Struct, frozen=True):
    """The assumed role of some columns, and the reason."""

    columns: tuple[str, ...]
    role: str
    reason: str


def listed(columns: Sequence[str]) -> str:
    """Return the names of columns; if more than three, only the first and the last."""
    if len(columns) <= 3:
        return ", ".join(map(shortened, columns))
    return f"{shortened(columns[0])} ... {shortened(columns[-1])} ({len(columns)})"


class Facts(NamedTuple):
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
    def over_rows(self) -> NDArray[np.float64]:
        """Its numbers (n,), interpolated where they are missing."""
        assert self.values is not None
        rows = np.arange(self.rows)
        return self.values if len(self.values) == self.rows else np.interp(rows, rows[self.there], self.values)


def facts_of(table: Table, name: str) -> Facts:
    """Return the facts about the column `name` of `table`."""
    column = table.columns[name]
    words = words_of(name)
    parsed = (times if is_time(words) else numbers)(column, table.decimal)
    if parsed.wrong.any():
        switch = bits(column, table.decimal)
        if not switch.wrong.any():
            closed = switch.values[~switch.missing].astype(np.float64)
            return Facts(name, words, closed, True, 2, ~switch.missing)
        read = names(column, table.cells, table.size)
        return Facts(name, words, None, False, len(np.unique(read.values[~read.missing])), ~read.missing)
    values = parsed.values[~parsed.missing]
    distinct = np.unique(values)
    two = bool(len(distinct)) and bool(np.isin(distinct, (0, 1)).all())
    return Facts(name, words, values, two, len(distinct), ~parsed.missing)


def inputs_of(columns: Sequence[Facts], held: NDArray[np.bool_], out: dict[str, str]) -> list[Role]:
    """Return the roles of the other columns, grouped; held (n,) are rows of grasps, `out` is left out for a reason."""
    found: dict[tuple[str, str], list[str]] = {}
    families: dict[object, list[Facts]] = {}
    for column in columns:
        if reason := out.get(column.name) or _no_input(column):
            found.setdefault(("left out", reason), []).append(column.name)
        else:
            families.setdefault("bits" if column.bits else _family(column), []).append(column)
    # Columns whose names differ only in a finger or a number have the same role, whatever the range of each.
    judged: dict[str, tuple[str, str]] = {}
    for several in sorted(families.values(), key=len, reverse=True):
        role = _input(several, held)
        if len(several) == 1:
            role = _as_on_finger(several[0], role, [column for column in columns if column.name in judged], judged)
        judged |= dict.fromkeys((column.name for column in several), role)
    for name, role in judged.items():
        found.setdefault(role, []).append(name)
    if len(found.get(("joints", _CODES), ())) > _MOST_JOINTS:
        found[("taxels", f"whole numbers in more columns than a hand has joints{_PADS}")] = found.pop(
            ("joints", _CODES)
        )
    order = ["switches", "taxels", "joints", "left out"]
    return [Role(tuple(alike), *key) for key, alike in sorted(found.items(), key=lambda item: order.index(item[0][0]))]


def _family(column: Facts) -> object:
    """Return the words of the name except fingers, or a name without words up to its number: siblings share them."""
    return column.words - WORDS["finger"] if column.words else _stem(column.name)


def _as_on_finger(
    column: Facts, role: tuple[str, str], others: Sequence[Facts], judged: dict[str, tuple[str, str]]
) -> tuple[str, str]:
    """Return the role of the other sensors of the same finger and range, if they agree, for a column judged by rest."""
    if role != ("joints", _CODES) and role[1] != f"{_RESTS}{_PADS}":
        return role
    fingers, most = column.words & WORDS["finger"], np.abs(column.over_rows).max()
    near = {
        judged[other.name]
        for other in others
        if other.words & fingers and most / 4 <= np.abs(other.over_rows).max() <= 4 * most
    }
    if {kind for kind, _ in near} == {"joints"}:
        return "joints", _CODES
    return near.pop() if {kind for kind, _ in near} == {"taxels"} else role


def _stem(name: str) -> str:
    return name.rstrip("0123456789")


def _input(columns: Sequence[Facts], held: NDArray[np.bool_]) -> tuple[str, str]:
    """Return the role of a group of inputs, and the reason; held (n,) are rows of grasps."""
    words = frozenset[str]().union(*(column.words for column in columns))
    values = np.concatenate([column.values for column in columns if column.values is not None])
    if all(column.bits for column in columns):
        return "switches", "0 and 1 only"
    if words & WORDS["pad"]:
        return "taxels", f"pads by their names{_PADS}"
    if not all(column.whole for column in columns) or values.min() < 0 or values.max() >= CODES:
        return "joints", f"{_NUMBERS}{sound_grid(values):g}"
    # A pad rests at the lower end of its range while others are touched; between supply and converter, at the upper.
    each = [column.values[held[column.there]] for column in columns if column.values is not None]
    places = [(part - part.min()) / max(float(np.ptp(part)), 1.0) for part in each if part.size]
    rest = max(np.mean([np.mean(place <= _REST) for place in of]) for of in (places, [1 - place for place in places]))
    if not words & WORDS["joint"] and rest > _AT_REST:
        return "taxels", f"{_RESTS}{_PADS}"
    return "joints", _CODES


def bits_of(role: Role, found: Sequence[Facts]) -> int | None:
    """Return the bits of the smallest converter that gives these counts, None if they are not counts."""
    each = [column.values for column in found if column.name in role.columns and column.values is not None]
    whole = all(column.whole for column in found if column.name in role.columns)
    if not whole or min(part.min() for part in each) < 0:
        return None
    most = max(part.max() for part in each)
    return next((bits for bits in _CONVERTERS if most < 2**bits), None)


def _no_input(column: Facts) -> str:
    """Return why a column is not an input, "" if it is one."""
    if not column.distinct:
        return "empty"
    if column.values is None:
        return "text"
    if column.bits:
        return ""
    if column.distinct == 1:
        return "it never changes"
    if is_time(column.words) or is_count(column.words):
        return "by its name a clock or a counter"
    if column.words & WORDS["note"]:
        return "by its name a note on the row"
    if column.words and any(column.words <= WORDS[key] - {"y"} for key in ("label", "trial")) and column.nominal:
        return "by its name another label, or number of a trial"
    return ""


def joints_of(role: Role, every: Iterable[str]) -> JointColumns:
    """Return the entry of joints: with codes, or with values on one grid."""
    columns = globs(role.columns, every)
    if not role.reason.startswith(_NUMBERS):
        return JointColumns(columns, "counts", codes=True)
    words = {word for name in role.columns for word in re.findall(r"[a-z]+", name.casefold())}
    unit = next((unit for unit in ("deg", "rad", "mm", "cm") if unit in words), "units")
    return JointColumns(columns, unit, grid=float(role.reason.removeprefix(_NUMBERS)))


def globs(columns: Iterable[str], every: Iterable[str]) -> tuple[str, ...]:
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
