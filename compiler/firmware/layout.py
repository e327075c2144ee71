"""How a build's integer tables lie in a microcontroller's flash: which switches share a look-up, how wide an entry is,
how a joint's code becomes a row.

    score_k = start_k + sum over groups g of group_rows[g][byte_g, k] + sum over joints a of joints[a].rows[bin_a, k]

              + sum over slopes of distance * row[k]

where byte_g holds one bit per switch of group g. Every row of a group is the exact sum of its switches' rows, so the
scores are those of `IntegerTables`, bit for bit. With 16-bit entries row 0 of a group is zero, so that one switch's
change is plus or minus row 2^bit. With 8-bit entries every entry is what exceeds the least of its look-up and class,
0 to 255; the leasts are part of `start`. Where tables have slopes and all these are multiples of 256 (`grid`), entries
are of their upper halves.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import COARSE, IntegerTables

from . import FirmwareError

MOST_ROWS = 256  # a bin is one byte
MOST_BINS = 256  # and so is what is left of a code when the first of a joint's bins is taken from it

Bins = Literal["direct", "trimmed", "search"]
Rows = NDArray[np.integer]


@dataclass(frozen=True, slots=True, eq=False)
class JointLayout:
    """A joint's rows (m, K), as stored, and the bytes `bins` (n,) that say which row a code takes.

    "direct": bins[code] for all 256 codes. "trimmed": bins[clamped code - first] from the first threshold, where codes
    still take row 0, to one beyond the last, where they take the last row. "search": no bins; the row is the number of
    thresholds (m - 1,) uint16 below the code.
    """

    first: int
    bins: NDArray[np.uint8]
    rows: Rows
    thresholds: NDArray[np.uint16]

    @property
    def constant(self) -> bool:
        """Whether all codes take the same row, which is then zero: it is part of the layout's start."""
        return len(self.thresholds) == 0

    def bin_of(self, codes: NDArray[np.uint16]) -> NDArray[np.int64]:
        """Return the row (n,) of each code (n,), found in the way that the firmware finds it."""
        if len(self.bins) == 0:
            return np.searchsorted(self.thresholds, codes, side="left").astype(np.int64)
        held = np.clip(codes.astype(np.int64), self.first, self.first + len(self.bins) - 1)
        return self.bins[held - self.first].astype(np.int64)


def joint_layout(thresholds: NDArray[np.uint16], rows: Rows, bins: Bins) -> JointLayout:
    """Return the layout of a joint whose stored rows are `rows` (T + 1, K)."""
    first, last = 0, 255
    if bins == "trimmed":
        first, last = (int(thresholds[0]), int(thresholds[-1]) + 1) if len(thresholds) else (0, 0)
    codes = np.arange(first, last + 1) if bins != "search" else np.arange(0)
    return JointLayout(first, np.searchsorted(thresholds, codes, side="left").astype(np.uint8), rows, thresholds)


def code_bits(tables: IntegerTables) -> int:
    """Return the width of the codes, 8 where no joint's thresholds or slope tell codes above 254 apart, else 16."""
    last = [int(steps[-1]) + 1 for steps in tables.thresholds if len(steps)] + [slope.high for slope in tables.slopes]
    return 16 if any(code > 255 for code in last) else 8


def check_joints(tables: IntegerTables, bins: Bins) -> None:
    """Raise FirmwareError if a joint's rows are more than a byte can number, or cannot be found by `bins`."""
    if bins == "direct" and code_bits(tables) == 16:
        raise FirmwareError('codes have 16 bits: their rows are found by "trimmed" or "search", not "direct"')
    for number, steps in enumerate(tables.thresholds):
        if len(steps) + 1 > MOST_ROWS:
            raise FirmwareError(
                f"joint {number} has {len(steps) + 1} rows, firmware has at most {MOST_ROWS} a joint: "
                "compile the build with fewer rounds or coarser codes"
            )
        if bins == "trimmed" and len(steps) and int(steps[-1]) - int(steps[0]) + 2 > MOST_BINS:
            raise FirmwareError(
                f"the thresholds of joint {number} are {steps[0]} to {steps[-1]}: "
                f'more than {MOST_BINS - 2} codes apart, their rows are found by "search"'
            )


SMALLEST_GROUP, LARGEST_GROUP = 2, 6
MOST_TABLE_ROWS = 65535  # their numbers are 16 bits wide

Adding = Literal["called", "unrolled"]


MOST_CLASSES = 14  # of a pass: an AVR has registers for fourteen sums of 16 bits


@dataclass(frozen=True, slots=True)
class Parts:
    """Every part has `width` classes; part p begins at class firsts[p]. The last two overlap where K is no multiple."""

    width: int
    firsts: tuple[int, ...]


def parts_of(n_classes: int) -> Parts:
    """Return the fewest parts of equal width, at most 14, that cover `n_classes`."""
    count = -(-n_classes // MOST_CLASSES)
    width = -(-n_classes // count)
    return Parts(width, tuple(min(part * width, n_classes - width) for part in range(count)))


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """An arrangement of `tables` for K classes, s switches and j joints.

    groups[g] are the numbers of the switches that share look-up g, bit 0 first; group_rows[g] are its rows
    (2^len(groups[g]), K), int16 or uint8 as `entry_bits` says; joints (j) likewise; start (K,) int64.
    """

    tables: IntegerTables
    groups: tuple[tuple[int, ...], ...]
    entry_bits: int
    bins: Bins
    adding: Adding
    start: NDArray[np.int64]
    group_rows: tuple[Rows, ...]
    joints: tuple[JointLayout, ...]

    @property
    def code_bits(self) -> int:
        """Width of a joint's code: 8 where no threshold tells codes above 254 apart, else 16."""
        return code_bits(self.tables)

    @property
    def entry_shift(self) -> int:
        """How far entries are shifted before they are added: 8 where they are upper halves, else 0."""
        return 8 if self.entry_bits == 8 and self.tables.grid == COARSE else 0

    @property
    def padding(self) -> int:
        """Bytes, 0 or 1, between the groups' bytes and the codes, so that codes of 16 bits lie at even offsets."""
        return len(self.groups) % 2 if self.code_bits == 16 else 0

    @property
    def frame_size(self) -> int:
        """Bytes of a frame as `frame_bytes` makes them."""
        return len(self.groups) + self.padding + len(self.joints) * self.code_bits // 8

    @property
    def parts(self) -> Parts:
        """How the classes are divided among passes."""
        return parts_of(self.tables.n_classes)

    @property
    def n_lookups(self) -> int:
        """Rows added per frame: one per group and one per joint that has thresholds."""
        return len(self.groups) + sum(not joint.constant for joint in self.joints)

    @property
    def n_rows(self) -> int:
        """Rows of all look-ups together; a constant joint's is in none."""
        looked_up = [joint.rows for joint in self.joints if not joint.constant]
        return sum(len(rows) for rows in [*self.group_rows, *looked_up])

    @property
    def all_open(self) -> NDArray[np.int64]:
        """The scores (K,) of the frame in which every look-up takes its row 0: all switches open, all codes 0."""
        nothing = np.zeros((1, self.tables.n_switches), bool), np.zeros((1, self.tables.n_joints), np.uint16)
        scores: NDArray[np.int64] = self.scores(*nothing)[0]
        return scores

    def group_bytes(self, bits: NDArray[np.bool_]) -> NDArray[np.uint8]:
        """Return the byte of each group (n, groups) for the switches (n, s)."""
        packed = np.zeros((len(bits), len(self.groups)), np.uint8)
        for g, numbers in enumerate(self.groups):
            packed[:, g] = np.packbits(np.asarray(bits, bool)[:, numbers], axis=1, bitorder="little")[:, 0]
        return packed

    def scores(self, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.int64]:
        """Return the scores (n, K) of the switches (n, s) and codes (n, j), as the firmware adds them up."""
        scores = np.tile(self.start, (len(bits), 1))
        for byte, rows in zip(self.group_bytes(bits).T, self.group_rows, strict=True):
            scores += rows[byte].astype(np.int64) << self.entry_shift
        for column, joint in zip(codes.T, self.joints, strict=True):
            scores += joint.rows[joint.bin_of(column)].astype(np.int64) << self.entry_shift
        for slope in self.tables.slopes:
            scores += slope.of(codes[:, slope.joint])
        return scores

    def frame_bytes(self, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.uint8]:
        """Return what the firmware's input structure holds, (n, F): groups, padding, codes (little-endian).

        Where a code has 8 bits, codes above 255 become 255: no threshold tells them apart.
        """
        padding = np.zeros((len(bits), self.padding), np.uint8)
        if self.code_bits == 8:
            held = np.minimum(codes, 255).astype(np.uint8)
        else:
            held = np.ascontiguousarray(codes, "<u2").view(np.uint8).reshape(len(bits), 2 * codes.shape[1])
        return np.hstack([self.group_bytes(bits), padding, held])


def arrange(
    tables: IntegerTables,
    *,
    group_size: int = 5,
    n_groups: int | None = None,
    entry_bits: int = 16,
    bins: Bins = "direct",
    adding: Adding = "called",
) -> Layout:
    """Return `tables` with the switches in groups of at most `group_size` (2 to 6), consecutive and as even as can be.

    There are as few groups as that size allows, or `n_groups` where given: more look-ups and less flash. Raises
    FirmwareError if the tables cannot be laid out so: 8-bit entries for look-ups that span more than 255 steps, a joint
    with more than 256 rows, "direct" for codes of 16 bits, "trimmed" for thresholds further apart than 254 codes, no
    inputs at all.
    """
    if tables.n_switches + tables.n_joints == 0:
        raise FirmwareError("the build looks at no switch and no joint: there is nothing to make firmware of")
    if entry_bits not in (8, 16):
        raise FirmwareError(f"entries of {entry_bits} bits: firmware has 8 or 16")
    check_joints(tables, bins)
    coarse = tables.grid if entry_bits == 8 else 1
    groups = _grouped(tables.n_switches, group_size, n_groups)
    sums = [_group_sums(tables.switch_rows[list(numbers)].astype(np.int64)) for numbers in groups]
    wide_joints = [rows.astype(np.int64) for rows in tables.joint_rows]
    leasts = [_least(rows, entry_bits, group=True) for rows in sums]
    joint_leasts = [_least(rows, entry_bits, group=False) for rows in wide_joints]
    layout = Layout(
        tables=tables,
        groups=groups,
        entry_bits=entry_bits,
        bins=bins,
        adding=adding,
        start=sum([*leasts, *joint_leasts], tables.bias.astype(np.int64)),
        group_rows=tuple(
            _entries((rows - least) // coarse, entry_bits, f"switch group {g}")
            for g, (rows, least) in enumerate(zip(sums, leasts, strict=True))
        ),
        joints=tuple(
            joint_layout(thresholds, _entries((rows - least) // coarse, entry_bits, f"joint {a}"), bins)
            for a, (thresholds, rows, least) in enumerate(
                zip(tables.thresholds, wide_joints, joint_leasts, strict=True)
            )
        ),
    )
    if layout.n_rows > MOST_TABLE_ROWS:
        raise FirmwareError(f"{layout.n_rows} rows: firmware has at most {MOST_TABLE_ROWS}; keep fewer inputs")
    return layout


def _grouped(n_switches: int, group_size: int, n_groups: int | None) -> tuple[tuple[int, ...], ...]:
    if not SMALLEST_GROUP <= group_size <= LARGEST_GROUP:
        raise FirmwareError(f"groups of {group_size} switches: {SMALLEST_GROUP} to {LARGEST_GROUP} share a look-up")
    if n_switches == 0:
        return ()
    fewest = -(-n_switches // group_size)
    count = fewest if n_groups is None else n_groups
    if not fewest <= count <= n_switches:
        raise FirmwareError(f"{count} groups of at most {group_size} for {n_switches} switches: {fewest} or more")
    return tuple(tuple(part.tolist()) for part in np.array_split(np.arange(n_switches), count))


def _group_sums(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the sum of every subset of rows (n, K), in the order of the bytes that say which: (2^n, K)."""
    sums = np.zeros((1, rows.shape[1]), np.int64)
    for row in rows:
        sums = np.vstack([sums, sums + row])
    return sums


def _least(rows: NDArray[np.int64], entry_bits: int, *, group: bool) -> NDArray[np.int64]:
    """Return what the look-up always adds, (K,). A 16-bit group's is nothing: its row 0 stays zero."""
    folded = entry_bits == 8 or (not group and len(rows) == 1)
    return np.asarray(rows.min(axis=0) if folded else 0 * rows[0])


def _entries(rows: NDArray[np.int64], entry_bits: int, what: str) -> Rows:
    if entry_bits == 16:
        return rows.astype(np.int16)
    if rows.max() > 255:
        raise FirmwareError(
            f"{what} spans {rows.max()} steps, an 8-bit entry holds 255: compile the build with --table-bits 8"
        )
    return rows.astype(np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Lookup:
    """One row added per frame.

    `index` counts the look-ups, `number` the groups or, where `joint` is given, all joints; the rows begin at row
    `first_row` of the table, and a joint's bins at byte `first_bin` of the bins, or its thresholds at that threshold.
    """

    index: int
    number: int
    first_row: int
    rows: Rows
    joint: JointLayout | None = None
    first_bin: int = 0


def lookups(layout: Layout) -> Iterator[Lookup]:
    """Yield the groups of switches and then the joints that have thresholds."""
    index = first_row = first_bin = 0
    for number, rows in enumerate(layout.group_rows):
        yield Lookup(index, number, first_row, rows)
        index, first_row = index + 1, first_row + len(rows)
    for number, joint in enumerate(layout.joints):
        if joint.constant:
            continue
        yield Lookup(index, number, first_row, joint.rows, joint, first_bin)
        index, first_row = index + 1, first_row + len(joint.rows)
        first_bin += len(joint.thresholds) if layout.bins == "search" else len(joint.bins)
