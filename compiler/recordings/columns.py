"""`columns.toml`: which column of a table is the label, the subject, a switch, a joint, and how joints become codes."""

import glob
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import translate
from itertools import islice
from pathlib import Path
from typing import Literal

import msgspec

from thenar.runtime.names import LONGEST_NAME, nearest, shortened
from thenar.runtime.toml_source import read_source
from thenar.runtime.toml_struct import convert

from .errors import ColumnsError

DEFAULT_GRID = 0.5
# A name whose every letter is escaped is three times as long.
LONGEST_GLOB = 3 * LONGEST_NAME
# Globs times columns: some seconds.
COMPARISONS = 20_000_000


class Calibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Two points of the straight line between codes and values, as in `Joint`."""

    code_a: int
    value_a: float
    code_b: int
    value_b: float


class JointColumns(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Joint columns that are coded alike.

    codes = true: the table holds integer codes 0..65535, with a `calibration` or without. Otherwise it holds values in
    `unit`: coded by `calibration`, or on a `grid` that starts at `origin` (default: the column's least value, rounded
    down to the grid).
    """

    columns: tuple[str, ...]
    unit: str = "deg"
    codes: bool = False
    grid: float | None = None
    origin: float | None = None
    calibration: Calibration | None = None

    def __post_init__(self) -> None:
        if (self.codes or self.calibration) and (self.grid is not None or self.origin is not None):
            raise ValueError("`grid` and `origin` are for values without a `calibration`: leave them out")
        if not (math.isfinite(self.step) and self.step > 0):
            raise ValueError(f"`grid` must be above 0, not {self.grid}")
        if self.origin is not None and not math.isfinite(self.origin):
            raise ValueError(f"`origin` must be a finite number, not {self.origin}")

    @property
    def step(self) -> float:
        """The grid's width, in `unit`."""
        return DEFAULT_GRID if self.grid is None else self.grid


class Columns(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A columns.toml, key by key. Column lists hold globs (`*`, `?`, `[...]`); the other keys hold one column each."""

    label: str
    subject: str | None = None
    object: str | None = None
    trial: str | None = None
    switches: tuple[str, ...] = ()
    joints: tuple[JointColumns, ...] = ()
    taxonomy: str | tuple[str, ...] = "own"
    labels: dict[str, str] = {}
    missing: Literal["error", "drop"] = "error"
    delimiter: str = ","

    def __post_init__(self) -> None:
        if len(self.delimiter) != 1 or self.delimiter in '\r\n"':
            raise ValueError(f"`delimiter` must be one character, not {self.delimiter!r}")


@dataclass(frozen=True, slots=True)
class Selection:
    """The columns of one table, by what they are; `joints` beside the entry that says how to code each."""

    switches: tuple[str, ...]
    joints: tuple[tuple[str, JointColumns], ...]


def read_columns(path: Path) -> Columns:
    """Read a columns.toml; raises ColumnsError with file, line and key."""
    source = read_source(path, ColumnsError)
    return convert(source, (), source.tables(), Columns)


def select(columns: Columns, names: Sequence[str]) -> Selection:
    """Find the columns that `columns` speaks of among a table's `names`.

    Raises ColumnsError if a column is missing, used twice, a glob matches nothing, or nothing is a switch or a joint.
    """
    meta = {
        "label": columns.label,
        "subject": columns.subject,
        "object": columns.object,
        "trial": columns.trial,
    }
    there = set(names)
    for key, column in meta.items():
        if column is not None and column not in there:
            raise ColumnsError(f"{key}: the table has no column {shortened(repr(column))}{nearest(column, names)}")
    _check_globs([*columns.switches, *(pattern for entry in columns.joints for pattern in entry.columns)], names)
    # One match more than there are columns, and some column is matched twice.
    found = list(islice(_matched(columns, names), len(names) + 1))
    switches = tuple(name for name, entry in found if entry is None)
    joints = tuple((name, entry) for name, entry in found if entry is not None)
    used = Counter([*filter(None, meta.values()), *switches, *(name for name, _ in joints)])
    if twice := [name for name, times in used.items() if times > 1]:
        raise ColumnsError(f"column {twice[0]!r} is used {used[twice[0]]} times: name it once, or narrow the globs")
    if not switches and not joints:
        raise ColumnsError("no column is a switch or a joint: name some under `switches` or `[[joints]]`")
    return Selection(switches, joints)


def _check_globs(globs: Sequence[str], names: Sequence[str]) -> None:
    """Raise ColumnsError where finding the columns of so many globs, or of such long ones, would take too long."""
    longest = max(globs, key=len, default="")
    if len(longest) > LONGEST_GLOB:
        raise ColumnsError(f"the glob {shortened(repr(longest))} has more than {LONGEST_GLOB} characters: shorten it")
    if sum(map(_is_wild, globs)) * len(names) > COMPARISONS:
        raise ColumnsError(
            f"{len(globs)} globs are too many for {len(names)} columns: name columns, or use fewer globs"
        )


def _matched(columns: Columns, names: Sequence[str]) -> Iterator[tuple[str, JointColumns | None]]:
    """Yield each column that a glob finds, with the entry of the joint that it is, None for a switch."""
    there = frozenset(names)
    for pattern in columns.switches:
        yield from ((name, None) for name in _matches("switches", pattern, names, there))
    for entry in columns.joints:
        for pattern in entry.columns:
            yield from ((name, entry) for name in _matches("joints", pattern, names, there))


def _matches(what: str, pattern: str, names: Sequence[str], there: frozenset[str]) -> list[str]:
    if _is_wild(pattern):
        found = list(filter(re.compile(translate(pattern)).match, names))
    else:
        found = [pattern] if pattern in there else []
    if not found:
        advice = f"; for the column of that name write {shortened(repr(glob.escape(pattern)), LONGEST_GLOB)}"
        advice = advice if pattern in there else nearest(pattern, names)
        raise ColumnsError(f"{what}: {shortened(repr(pattern))} matches no column of the table{advice}")
    return found


def _is_wild(pattern: str) -> bool:
    return any(letter in pattern for letter in "*?[")
