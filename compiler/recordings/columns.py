"""`columns.toml`: the role of each column of a table (label, subject, switch, joint ...), and how to read it."""

import codecs
import glob
import math
import re
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import translate
from itertools import islice
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import msgspec
import numpy as np
import tomli_w
from numpy.typing import NDArray

from thenar.runtime.names import LONGEST_NAME, nearest, shortened
from thenar.runtime.toml_source import read_source
from thenar.runtime.toml_struct import convert

from . import TableError
from .cells import TimeUnit
from .graspset import CODES, LARGEST_VALUE

DEFAULT_GRID = 0.5
# Codecs of Python that are not text encodings.
_NO_ENCODINGS = {"idna", "punycode", "undefined", "unicode_escape", "raw_unicode_escape", "mbcs", "oem"}
# A name in which every letter is escaped is three times as long.
LONGEST_GLOB = 3 * LONGEST_NAME
# The limit on globs times columns: some seconds.
COMPARISONS = 20_000_000


class CalibrationPoints(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Two points of the straight line between codes and values, as in `Joint`."""

    code_a: int
    value_a: float
    code_b: int
    value_b: float


class JointColumns(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Joint columns with the same coding.

    codes = true: the table holds integer codes 0..65535, with or without a `calibration`. Otherwise it holds values in
    `unit`: coded by `calibration`, or on a `grid` that starts at `origin` (default: the column's smallest value,
    rounded down to the grid).
    """

    columns: tuple[str, ...]
    unit: str = "deg"
    codes: bool = False
    grid: float | None = None
    origin: float | None = None
    calibration: CalibrationPoints | None = None

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

    @property
    def is_counts(self) -> bool:
        """Whether the columns hold codes."""
        return self.codes


class TaxelColumns(JointColumns, frozen=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True):
    """Analog columns. With threshold "learnt" they are kept as codes, like joints, and a placement chooses their
    levels.

    With another threshold, a number or "otsu" (computed per column), they become switches that close above it. Without
    settings for the codes, integers are used as they are, and other numbers are put on a suitable grid. `bits` means
    counts of a converter with this many bits: the ends of its range become the two points of the calibration.
    """

    threshold: float | Literal["otsu", "learnt"] = "learnt"
    unit: str = "counts"
    bits: Annotated[int, msgspec.Meta(ge=1, le=16)] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.threshold, str) and not math.isfinite(self.threshold):
            raise ValueError(f"`threshold` must be a finite number, 'otsu' or 'learnt', not {self.threshold}")
        if self.threshold != "learnt" and self.is_coded:
            raise ValueError("`codes`, `bits`, `grid`, `origin` and `calibration` are for taxels without `threshold`")
        if self.bits and (self.grid is not None or self.origin is not None):
            raise ValueError("`grid` and `origin` are for values, `bits` is for counts: leave one out")

    @property
    def is_counts(self) -> bool:
        """Whether the columns hold codes."""
        return self.codes or self.bits is not None

    @property
    def is_coded(self) -> bool:
        """Whether the coding of the columns is given."""
        return self.is_counts or not (self.grid is None and self.origin is None and self.calibration is None)


class TextFormat(NamedTuple):
    """The format of a text table: `delimiter` None means the default, a tab for .tsv and a comma otherwise.

    A blank as delimiter means any run of blanks and tabs. `skip` lines precede the header, also in a spreadsheet, where
    None means that reading finds them.
    """

    delimiter: str | None = None
    decimal: str = "."
    encoding: str = "utf-8"
    quote: str = '"'
    header: bool = True
    skip: int | None = 0


PLAIN = TextFormat()


class ColumnRoles(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A columns.toml, key by key. Lists of inputs hold globs (`*`, `?`, `[...]`); other keys hold columns by name.

    A label, subject, object, session or trial may be spread over several columns, whose values are combined. Otherwise
    `frames` defines the trials: "independent" makes each row one; with "restart" a trial begins where `time` starts
    again, or the label, subject, object or session changes. Labels in `none` mean that nothing is held, as "none"
    always does; with "" among them, so does an empty cell. `rename` gives columns of the table other names, which all
    other keys use, and the set has.
    """

    label: str | tuple[str, ...]
    subject: str | tuple[str, ...] | None = None
    object: str | tuple[str, ...] | None = None
    session: str | tuple[str, ...] | None = None
    trial: str | tuple[str, ...] | None = None
    time: str | None = None
    time_unit: TimeUnit | None = None
    none: str | tuple[str, ...] = ()
    frames: Literal["independent", "restart"] | None = None
    taxonomy: str | tuple[str, ...] | dict[str, tuple[str, ...]] = "own"
    simulated: str = ""
    switches: tuple[str, ...] = ()
    missing: Literal["refuse", "drop", "keep"] = "refuse"
    delimiter: str | None = None
    decimal: Literal[".", ","] = "."
    encoding: str = "utf-8"
    quote: str = '"'
    header: bool = True
    skip: Annotated[int, msgspec.Meta(ge=0)] = 0
    rename: dict[str, str] = {}
    labels: dict[str, str] = {}
    taxels: tuple[TaxelColumns, ...] = ()
    joints: tuple[JointColumns, ...] = ()

    def __post_init__(self) -> None:
        for key, least in (("delimiter", 1), ("quote", 0)):
            sign = getattr(self, key)
            if sign is not None and (not least <= len(sign) <= 1 or sign in ("\r", "\n")):
                raise ValueError(f"`{key}` must be one character, not {shortened(repr(sign))}")
        if (self.delimiter or ",") == self.quote:
            raise ValueError(f"`delimiter` must be one character that is not the `quote`, not {self.delimiter!r}")
        if not _is_encoding(self.encoding):
            raise ValueError(f"`encoding` must be one that Python knows, not {shortened(repr(self.encoding))}")
        if self.frames is not None and self.trial is not None:
            raise ValueError(f"`trial` and `frames` = {self.frames!r} both say what a trial is: leave one out")
        if self.time_unit is not None and self.time is None:
            raise ValueError("`time_unit` is given without `time`")
        if isinstance(self.taxonomy, dict) and len(self.taxonomy) != 1:
            raise ValueError("`taxonomy` as a table holds one name and its list of types")
        if not self.parts("label"):
            raise ValueError("`label` must name a column")

    def parts(self, key: str) -> tuple[str, ...]:
        """The columns named by this key."""
        value: str | tuple[str, ...] | None = getattr(self, key)
        return (value,) if isinstance(value, str) else value or ()

    def toml(self) -> str:
        """Return the text of the columns.toml."""
        return tomli_w.dumps(msgspec.to_builtins(self))

    @property
    def text(self) -> TextFormat:
        """The format of the table."""
        return TextFormat(self.delimiter, self.decimal, self.encoding, self.quote, self.header, self.skip)


def _is_encoding(name: str) -> bool:
    try:
        known = codecs.lookup(name).name not in _NO_ENCODINGS
        # Codecs from bytes to bytes cannot decode.
        return known and bool(b"  ".decode(name, "replace"))
    except (LookupError, ValueError, TypeError):
        return False


@dataclass(frozen=True, slots=True)
class Selection:
    """The inputs in one table, by name, with the entries that say how to read them.

    switches  the switches, without an entry, then the taxels with a threshold
    coded     the columns that become codes: the joints, then the analog taxels
    """

    switches: tuple[tuple[str, TaxelColumns | None], ...]
    coded: tuple[tuple[str, JointColumns], ...]


def read_columns(path: Path) -> ColumnRoles:
    """Read a columns.toml; raises TableError with file, line and key."""
    source = read_source(path, TableError)
    return convert(source, (), source.tables(), ColumnRoles)


# The keys that name columns other than inputs.
KEYS = ("label", "subject", "object", "session", "trial", "time")


def select(columns: ColumnRoles, names: Sequence[str]) -> Selection:
    """Find the inputs that `columns` refers to among a table's `names`.

    Raises TableError if a column is missing or used twice, a glob matches nothing, or there are no inputs.
    """
    there = set(names)
    for key in KEYS:
        for column in columns.parts(key):
            if column not in there:
                raise TableError(f"{key}: the table has no column {shortened(repr(column))}{nearest(column, names)}")
    lists: list[tuple[str, JointColumns | None, tuple[str, ...]]] = [
        ("switches", None, columns.switches),
        *(("taxels", entry, entry.columns) for entry in columns.taxels),
        *(("joints", entry, entry.columns) for entry in columns.joints),
    ]
    every = [glob for _, _, globs in lists for glob in globs]
    longest = max(every, key=len, default="")
    if len(longest) > LONGEST_GLOB:
        raise TableError(f"the glob {shortened(repr(longest))} has more than {LONGEST_GLOB} characters: shorten it")
    if sum(map(_is_wild, every)) * len(names) > COMPARISONS:  # which would take too long
        raise TableError(f"{len(every)} globs are too many for {len(names)} columns: name columns, or use fewer globs")
    matched = (
        (name, entry)
        for what, entry, globs in lists
        for pattern in globs
        for name in _matches(what, pattern, names, there)
    )
    # One match more than there are columns means that some column is matched twice.
    found = list(islice(matched, len(names) + 1))
    used = Counter([*(name for key in KEYS for name in columns.parts(key)), *(name for name, _ in found)])
    if twice := [name for name, times in used.items() if times > 1]:
        raise TableError(f"column {twice[0]!r} is used {used[twice[0]]} times: name it once, or narrow the globs")
    if not found:
        raise TableError("no column is an input: name some under `switches`, `[[taxels]]` or `[[joints]]`")
    taxels = [(name, entry) for name, entry in found if isinstance(entry, TaxelColumns)]
    joints = [(name, entry) for name, entry in found if entry is not None and not isinstance(entry, TaxelColumns)]
    return Selection(
        switches=(
            *((name, None) for name, entry in found if entry is None),
            *((name, entry) for name, entry in taxels if entry.threshold != "learnt"),
        ),
        coded=(*joints, *((name, entry) for name, entry in taxels if entry.threshold == "learnt")),
    )


def _matches(what: str, pattern: str, names: Sequence[str], there: set[str]) -> list[str]:
    if _is_wild(pattern):
        found = list(filter(re.compile(translate(pattern)).match, names))
    else:
        found = [pattern] if pattern in there else []
    if not found:
        advice = f"; for the column of that name write {shortened(repr(glob.escape(pattern)), LONGEST_GLOB)}"
        advice = advice if pattern in there else nearest(pattern, names)
        raise TableError(f"{what}: {shortened(repr(pattern))} matches no column of the table{advice}")
    return found


def _is_wild(pattern: str) -> bool:
    return any(letter in pattern for letter in "*?[")


def stem_of(name: str) -> str:
    """Return a name without its number."""
    return name.rstrip("0123456789")


def globs_of(names: Iterable[str], columns: Iterable[str]) -> tuple[str, ...]:
    """Return globs that match exactly `names` among all `columns`: a star if a stem has no others."""
    ordered = sorted(columns)
    stems: dict[str, list[str]] = {}
    for name in names:
        stems.setdefault(stem_of(name), []).append(name)
    made: list[str] = []
    for stem, alike in stems.items():
        others = bisect_left(ordered, stem + "\U0010ffff") - bisect_left(ordered, stem) - len(alike)
        made += [f"{glob.escape(stem)}*"] if stem and len(alike) > 2 and not others else map(glob.escape, alike)
    return tuple(made)


# The most codes for values that share a decimal place; the fewest between the 1st and 99th percentiles of others.
_OWN_STEPS, _STEPS = 20_000, 1000


def sound_grid(values: NDArray[np.float64]) -> float:
    """Return a grid for finite `values`.

    It is the last decimal place of the values, if that takes at most 20,000 codes; otherwise 1, 2 or 5 times a power of
    ten: the widest with a thousand steps between the 1st and 99th percentiles, unless the other values would then have
    no codes.
    """
    least, largest = float(values.min()), float(values.max())
    span, far = largest - least, max(abs(least), abs(largest))
    if not 0 < span <= LARGEST_VALUE:
        return 1.0
    finest = _rounded(max(span / (CODES - 2), far * 1e-8, 1 / LARGEST_VALUE), up=True)
    for exponent in range(
        min(0, math.floor(math.log10(span))), math.ceil(math.log10(max(span / _OWN_STEPS, finest)) - 1e-9) - 1, -1
    ):
        steps = values / float(f"1e{exponent}")
        if np.allclose(steps, np.rint(steps), 0, 1e-6):
            return float(f"1e{exponent}")
    low, high = np.percentile(values, [1, 99]).tolist()
    return max(_rounded(max((high - low) / _STEPS, finest), up=False), finest)


def _rounded(number: float, *, up: bool) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above `number`, or the smallest not below."""
    exponent = math.floor(math.log10(number) + 1e-9)
    steps = [float(f"{factor}e{exponent}") for factor in (0.5, 1, 2, 5, 10)]
    if up:
        return next(step for step in steps[1:] if step >= number * (1 - 1e-9))
    return next(step for step in steps[3::-1] if step <= number * (1 + 1e-9))
