"""`columns.toml`: which column of a table is the label, the subject, a switch, a joint, and how joints become codes."""

import glob
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Literal

import msgspec

from thenar.runtime.toml_source import read_source
from thenar.runtime.toml_struct import convert

from .errors import ColumnsError
from .names import nearest, shortened

DEFAULT_GRID = 0.5


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
    switches = tuple(_matches("switches", columns.switches, names))
    joints = tuple((name, entry) for entry in columns.joints for name in _matches("joints", entry.columns, names))
    used = Counter([*filter(None, meta.values()), *switches, *(name for name, _ in joints)])
    if twice := [name for name, times in used.items() if times > 1]:
        raise ColumnsError(f"column {twice[0]!r} is used {used[twice[0]]} times: name it once, or narrow the globs")
    if not switches and not joints:
        raise ColumnsError("no column is a switch or a joint: name some under `switches` or `[[joints]]`")
    return Selection(switches, joints)


def _matches(what: str, globs: Sequence[str], names: Sequence[str]) -> Iterator[str]:
    for pattern in globs:
        found = [name for name in names if fnmatchcase(name, pattern)]
        if not found:
            advice = f"; for the column of that name write {glob.escape(pattern)!r}"
            advice = advice if pattern in names else nearest(pattern, names)
            raise ColumnsError(f"{what}: {pattern!r} matches no column of the table{advice}")
        yield from found
