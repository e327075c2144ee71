"""Tell from names and values which columns of a table are switches, taxels or joints, and which are no inputs.

Clocks, counters and trial numbers are judged over the whole table. It is no evidence that a column rises within trials,
because a closing hand does, or that it is constant within them, because a static grasp is. A clock goes on rising from
one trial to the next, or takes the same course in all of them.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import list_names
from thenar.runtime.recording.reader import Oddity

from .cells import UNITS, bits, names, numbers, times, unit_of_time
from .columns import sound_grid, stem_of
from .graspset import CODES
from .table import Table

Values = NDArray[np.float64]
Bits = NDArray[np.bool_]

# The kind of the finding about inputs that may be clocks.
POSSIBLE_CLOCKS = "possible clocks"
# Clocks seldom fall: the largest share of falling steps from trial to trial, of one that is certain or suspicious, and
# within trials.
_FALLS, _SUSPICIOUS_FALLS = 0.05, 0.25
# The least number of trials whose first values do not all rise by chance; and the least excess of rises, in standard
# errors, among repetitions of one grasp, which may be pairs.
_TRIALS, _ERRORS = 8, 4.4
# The least share of equal steps, and of rows on a straight line.
_EQUAL, _ON_LINE = 0.9, 0.95
# Steps of a clock are within this factor of each other, and its rates in different trials within the second.
_JITTER, _RATES = 2.0, 1.05
# Columns with more distinct values than this are not grasp types.
MOST_TYPES = 200
# The fewest rises that are suspicious, rows that tell much, and frames of a trial on average.
_RISES, _MANY_ROWS, _FRAMES = 5, 20, 10


def _set(words: str) -> frozenset[str]:
    return frozenset(map(_singular, words.split()))


def _singular(word: str) -> str:
    return word.removesuffix("s") if len(word) > 3 else word


_TIMES = _set(
    "time timestamp stamp elapsed clock frame t ts epoch unix datetime zeit zeitstempel bild temps tempo tiempo"
)
# Names that hold one of the former count; names of the latter do if they hold nothing else.
_COUNTERS, _COUNTS = _set("seq sequence counter packet"), _set("count sample nr no number num")
_UNITS = frozenset(_singular(word) for words, _, _ in UNITS.values() for word in words)
_BESIDE = _UNITS | _set("no nr number in since start of system sensor host device header ros")


def words_of(name: str) -> frozenset[str]:
    """Return the words in the name of a column, in lower case and without a plural s."""
    return frozenset(
        _singular(word.casefold()) for word in re.findall(r"[A-Z]{2,}(?![^\W\dA-Z_])|[^\W\d_][^\W\dA-Z_]*", name)
    )


def is_time(words: frozenset[str]) -> bool:
    """Return whether `words` are the name of a time: the unit alone is one too, unless it is a single letter."""
    return bool(words & (_TIMES | _UNITS - {"s"})) and words <= _TIMES | _BESIDE


def is_count(words: frozenset[str]) -> bool:
    """Return whether `words` are the name of a counter."""
    return bool(words & _COUNTERS) or (bool(words & _COUNTS) and words <= _COUNTS | _BESIDE)


# Why a column may be a clock, a counter or a trial number, and whether that is certain.
Sign = tuple[str, bool]


@dataclass(eq=False)
class Course:
    """The order of the rows of a table: which ones make a trial, which trials are alike, and the time if there is one.

    Parameters
    ----------
    owner : (n,) array of intp
        Equal for rows of one subject and session.
    group : (n,) array of intp
        Equal for rows of one owner, label and object.
    trial_ids : (n,) array of intp
        Equal for rows of one trial.
    time : (n,) array of float, optional
        A recognised clock, and its name.
    """

    owner: NDArray[np.intp]
    group: NDArray[np.intp]
    trial_ids: NDArray[np.intp]
    time: Values | None = None
    time_name: str = ""

    @np.errstate(over="ignore", invalid="ignore")
    def __post_init__(self) -> None:
        begins = np.diff(self.trial_ids, prepend=-1) != 0
        if self.time is not None:
            begins[1:] |= np.diff(self.time) < 0
        self.first = np.flatnonzero(begins)
        self.within = ~begins[1:]
        self.run = np.cumsum(begins) - 1
        self.sizes = np.bincount(self.run)
        # Where each label and object comes once, the first values may rise because the labels are sorted.
        self.sorted = len(self.first) == len(np.unique(self.group))

    @cached_property
    def orders(self) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """The first rows of trials, and of the next trial: in the file, of one owner, and of one group."""
        # Only when a column changes: a table of a million equal rows has a million trials.
        return [_successors(self.first, of) for of in (np.zeros_like(self.owner), self.owner, self.group)]

    @np.errstate(over="ignore", invalid="ignore")
    def sign(self, values: Values) -> Sign | None:
        """Return the sign in `values` (n,) that they are not a sensor's, None without one."""
        steps = np.diff(values)
        if np.count_nonzero(steps < 0) > np.count_nonzero(steps > 0):
            values, steps = -values, -steps
        if len(steps) < 2 or not steps.any():
            return None
        signs, inside = [self._equal_steps(values, steps)], steps[self.within]
        # Sensors fall as often as they rise, nearly all of them: the rest is for what hardly falls within trials.
        if np.count_nonzero(inside < 0) <= _FALLS * len(inside):
            signs += [self._over_trials(values, steps), self._along(values), self._few(steps)]
        return max(filter(None, signs), key=itemgetter(1), default=None)

    def _equal_steps(self, values: Values, steps: Values) -> Sign | None:
        """Judge by steps that are all equal: over the file, or within trials that start with one value."""
        usual = float(np.median(steps[self.within] if self.within.any() else steps))
        equal = np.abs(steps - usual) <= 1e-6 * usual + 1e-12 * np.abs(values).max()
        # Nothing but a row number has steps of one in a table of few rows.
        enough = len(steps) >= _MANY_ROWS or (usual == 1 and bool(equal.all()))
        if usual > 0 and enough and np.mean(equal) >= _EQUAL:
            return "it counts the rows", True
        if usual > 0 and enough and self.within.any() and equal[self.within].all() and self._same_start(values, usual):
            return "it counts the frames of each trial", True
        return None

    def _same_start(self, values: Values, step: float) -> bool:
        """Return whether nearly all trials start with one value, up to a step."""
        starts = values[self.first]
        return bool(np.mean(np.abs(starts - np.median(starts)) <= step) >= _EQUAL)

    def _over_trials(self, values: Values, steps: Values) -> Sign | None:
        """Judge by the rise from trial to trial: in the file, of one subject and session, and among repetitions."""
        inside, found = steps[self.within], None
        for order, (before, after) in enumerate(self.orders):
            rise = values[after] - values[before]
            up, down = np.count_nonzero(rise > 0), np.count_nonzero(rise < 0)
            excess = up > 0 and up - down >= _ERRORS * (up + down) ** 0.5
            seldom = down <= _FALLS * len(rise) and 2 * up >= len(rise)
            if seldom and (excess or (order < 2 and len(rise) >= _TRIALS - 1)):
                if order == 2 or not self.sorted or self._one_rate(steps):
                    return "it rises from trial to trial, as a clock or a counter does", True
                found = ("it rises from trial to trial", False)
            elif excess and down <= _SUSPICIOUS_FALLS * len(rise) and 2 * np.count_nonzero(inside > 0) > len(inside):
                found = found or ("it rises within trials and from most of them to the next", False)
        return found

    def _one_rate(self, steps: Values) -> bool:
        """Return whether steps within trials are regular, and rates alike in all trials, as no closing hand's are."""
        inside, run = steps[self.within], self.run[1:][self.within]
        usual = float(np.median(inside)) if len(inside) >= _MANY_ROWS else 0.0
        regular = np.mean((inside >= usual / _JITTER) & (inside <= usual * _JITTER)) if usual > 0 else 0.0
        if regular < _EQUAL:
            return False
        counts = np.bincount(run, minlength=len(self.sizes))
        rates = np.bincount(run, inside, len(self.sizes))[counts > 0] / counts[counts > 0]
        return len(rates) > 1 and bool(rates.max() <= _RATES * rates.min())

    def _along(self, values: Values) -> Sign | None:
        """Judge by the distance from a straight line: over the time, and within trials over the time or the frames."""
        if len(values) < _MANY_ROWS:
            return None
        place = np.arange(len(values), dtype=np.float64)
        inside = place - place[self.first][self.run]
        if self.time is not None and _on_line(self.time - self.time.mean(), values - values.mean(), self.time):
            return f"it runs with {self.time_name}", True
        if len(values) < _FRAMES * len(self.first):
            return None
        for what, name in ((self.time, self.time_name), (inside, "the frames of a trial")):
            if what is None or not (step := _on_line(self._centred(what), self._centred(values), what)):
                continue
            certain = len(self.first) >= _TRIALS and self._same_start(values, step)
            return f"it runs with {name} in all trials", certain
        return None

    def _centred(self, values: Values) -> Values:
        centred: Values = values - (np.bincount(self.run, values) / self.sizes)[self.run]
        return centred

    def _few(self, steps: Values) -> Sign | None:
        """Judge a table of too few trials by all its rows."""
        up, down = np.count_nonzero(steps > 0), np.count_nonzero(steps < 0)
        if len(self.first) >= _TRIALS or up < _RISES or down > _FALLS * up:
            return None
        return "it rises over the whole table", self._one_rate(steps)


def _successors(first: NDArray[np.intp], of: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first rows of trials, and those of the next trial with the same value of `of` (n,)."""
    order = first[np.argsort(of[first], kind="stable")]
    same = of[order[1:]] == of[order[:-1]]
    return order[:-1][same], order[1:][same]


def _on_line(reference: Values, values: Values, time: Values) -> float:
    """Return the usual step of `values` (n,) if they lie on a rising line over `reference`, both centred; 0 if not."""
    scale = float(reference @ reference)
    slope = float(reference @ values) / scale if scale else 0.0
    moves = np.diff(time)
    step = slope * float(np.median(moves[moves > 0])) if (moves > 0).any() else 0.0
    return step if step > 0 and np.mean(np.abs(values - slope * reference) <= step / 2) >= _ON_LINE else 0.0


def numbers_trials(values: Values, group: NDArray[np.intp]) -> bool:
    """Return whether `values` (n,) are consecutive integers, one for each run of rows of one `group` (n,).

    They may start anew where the group changes, nowhere else.
    """
    steps = np.diff(values)
    same = group[1:] == group[:-1]
    anew = ~same & (values[1:] == values.min())
    next_one = steps == 1
    runs = int(np.count_nonzero(steps)) + 1
    if 2 * runs > len(values) or np.count_nonzero(next_one) < _TRIALS:
        return False
    return bool((values == np.rint(values)).all() and ((steps == 0) | next_one | anew).all())


def possible_clocks(inputs: Iterable[tuple[str, Values]], course: Course) -> list[Oddity]:
    """Return a finding about those of the `inputs` that may be clocks, counters or trial numbers."""
    found = {}
    for name, values in inputs:
        words = words_of(name)
        if is_time(words) or is_count(words):
            found[name] = "its name is that of a clock or a counter"
        elif sign := course.sign(values):
            found[name] = sign[0]
    if not found:
        return []
    listed = list_names([f"{name} ({reason})" for name, reason in found.items()])
    message = (
        f"{len(found)} inputs may be clocks, counters or trial numbers, which say nothing about the hand: {listed}; "
        "leave out those that are (columns.toml)"
    )
    return [Oddity(POSSIBLE_CLOCKS, len(found), message, columns=tuple(found))]


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
    "file": "file filename path recording bag datei fichier archivo",
    "start": "start begin onset from beginn von début inicio",
    "end": "end stop offset to until ende bis fin",
    "row": "row sample index frame bild",
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
_PADS = ': a placement chooses their levels (threshold = 0.4, or "otsu", makes switches of them)'
_RESTS = "at rest in most rows, as a pad is"
_CODES, _MOST_JOINTS = "whole numbers, taken as codes", 24
# The start of the reason for joints with values, followed by their grid.
ON_GRID = "numbers, coded on a grid of "


class Role(msgspec.Struct, frozen=True):
    """The assumed role of some columns, and the reason."""

    columns: tuple[str, ...]
    role: str
    reason: str


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
            # Columns whose names differ only in a finger, or without words in a number, have the same role.
            family = column.words - WORDS["finger"] if column.words else stem_of(column.name)
            families.setdefault("bits" if column.bits else family, []).append(column)
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


def _input(columns: Sequence[Facts], held: NDArray[np.bool_]) -> tuple[str, str]:
    """Return the role of a group of inputs, and the reason; held (n,) are rows of grasps."""
    words = frozenset[str]().union(*(column.words for column in columns))
    values = np.concatenate([column.values for column in columns if column.values is not None])
    if all(column.bits for column in columns):
        return "switches", "0 and 1 only"
    if words & WORDS["pad"]:
        return "taxels", f"pads by their names{_PADS}"
    if not all(column.whole for column in columns) or values.min() < 0 or values.max() >= CODES:
        return "joints", f"{ON_GRID}{sound_grid(values):g}"
    # A pad rests at the lower end of its range while others are touched; between supply and converter, at the upper.
    each = [column.values[held[column.there]] for column in columns if column.values is not None]
    places = [(part - part.min()) / max(float(np.ptp(part)), 1.0) for part in each if part.size]
    rest = max(np.mean([np.mean(place <= _REST) for place in of]) for of in (places, [1 - place for place in places]))
    if not words & WORDS["joint"] and rest > _AT_REST:
        return "taxels", f"{_RESTS}{_PADS}"
    return "joints", _CODES


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
    # A unit is no word of the name: "Force (N)".
    if words_of(re.sub(r"[(\[][^)\]]*[)\]]", "", column.name)) & WORDS["note"]:
        return "by its name a note on the row"
    if column.words and any(column.words <= WORDS[key] - {"y"} for key in ("label", "trial")) and column.nominal:
        return "by its name another label, or number of a trial"
    return ""


def may_be(key: str, column: Facts) -> bool:
    """Return whether name and values of a column fit the role `key`."""
    if key == "time":
        if column.values is None or column.distinct < 2 or not is_time(column.words):
            return False
        # Whole seconds date no rows, nor does what wraps every second.
        steps = np.diff(column.values)
        wraps = column.values.max() < 1e9 and unit_of_time(column.name, column.values) == "ns"
        return bool(2 * np.count_nonzero(steps) > len(steps) and not (wraps and (steps < 0).any()))
    named = column.words <= WORDS[key] | WORDS["number"] if column.bits else True
    fits = named and column.nominal and (key != "label" or 1 < column.distinct <= MOST_TYPES)
    return fits and bool(column.words & WORDS[key])


def doubts(key: str, column: Facts) -> tuple[int, bool, bool]:
    """Return the doubts about a column for `key`: a vague unit of time, other words in its name, no value twice."""
    vague = 0
    if key == "time" and column.values is not None and not unit_of_time(column.name, column.values[:0]):
        vague = 1 if unit_of_time(column.name, column.values) else 2
    other = key != "time" and not column.words <= WORDS[key] | WORDS["number"]
    return vague, other, column.distinct == column.rows


def time_of(table: Table) -> str:
    """Return the column of time of `table` by its name and values, "" without one."""
    fitting = (facts_of(table, name) for name in table.columns if is_time(words_of(name)))
    best = min(
        (column for column in fitting if may_be("time", column)),
        key=lambda column: doubts("time", column),
        default=None,
    )
    return best.name if best else ""


def is_span(end: str, name: str) -> bool:
    """Return whether a column called `name` holds the starts or ends of segments, as `end` says."""
    words = words_of(name)
    return bool(words & WORDS[end]) and words <= WORDS[end] | WORDS["row"] | _TIMES | _BESIDE
