"""How a build's integer tables lie in a microcontroller's flash: which switches share a look-up, how wide an entry is,
how a joint's code becomes a row.

    score_k = start_k + sum over groups g of group_rows[g][byte_g, k] + sum over joints a of joints[a].rows[bin_a, k]

where byte_g holds one bit per switch of group g. A frame holds the switches as they come, a byte for each port: eight
wires of an expander, eight keys of a matrix, or eight kept switches in their order. A group is a field of one such
byte, or put together from fields of several. Every row of a group is the exact sum of its switches' rows, so the
scores are those of `IntegerTables`, bit for bit. With 16-bit entries row 0 of a group is zero, so that one switch's
change is plus or minus row 2^bit. With 8-bit entries every entry is what exceeds the least of its look-up and class,
0 to 255; the leasts are part of `start`.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.tables import IntegerTables

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


def code_bits(thresholds: Sequence[NDArray[np.uint16]]) -> int:
    """Return the width of the codes, 8 where no joint's thresholds tell codes above 254 apart, else 16."""
    return 16 if any(len(steps) and steps[-1] >= 255 for steps in thresholds) else 8


def check_joints(thresholds: Sequence[NDArray[np.uint16]], bins: Bins) -> None:
    """Raise FirmwareError if a joint's rows are more than a byte can number, or cannot be found by `bins`."""
    if bins == "direct" and code_bits(thresholds) == 16:
        raise FirmwareError('codes have 16 bits: their rows are found by "trimmed" or "search", not "direct"')
    for number, steps in enumerate(thresholds):
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


Ports = tuple[tuple[int, ...], ...]
"""For each port the switches of its bits, bit 0 first, at most eight; NO_SWITCH where a bit shows none."""
NO_SWITCH = -1


def consecutive(n_switches: int) -> Ports:
    """Return the ports of switches that are wired to nothing known: eight after eight."""
    return tuple(tuple(range(first, min(first + 8, n_switches))) for first in range(0, n_switches, 8))


def ports_of(pairs: Iterable[tuple[int, int]]) -> Ports:
    """Return the ports of an answer, or of a bitmap of keys, of which `pairs` say bit and switch; bytes that show no
    switch are left out.
    """
    ports: dict[int, list[int]] = {}
    for bit, number in sorted(pairs):
        ports.setdefault(bit // 8, [NO_SWITCH] * 8)[bit % 8] = number
    return tuple(map(tuple, ports.values()))


def ports_of_scan(scan: ScanMap | None) -> Ports | None:
    """Return the ports of a build that was compiled for a harness: its boards', then its readings', byte by byte."""
    if scan is None:
        return None
    return tuple(chain(*map(ports_of, (*scan.scanners, *(port.switches for port in scan.ports)))))


@dataclass(frozen=True, slots=True)
class Field:
    """`width` bits of the byte of a port, from `bit` on, which are those of a group from `to` on."""

    port: int
    bit: int
    width: int
    to: int


SMALLEST_GROUP, LARGEST_GROUP = 2, 6
MOST_MEAN = 127
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


@dataclass(frozen=True, eq=False)
class Layout:
    """An arrangement of `tables` for K classes, s switches and j joints, each switch in one of `ports`.

    groups[g] are the numbers of the switches that share look-up g, bit 0 first; group_rows[g] are its rows
    (2^len(groups[g]), K), int16 or uint8 as `entry_bits` says; joints (j) likewise; start (K,) int64.
    """

    tables: IntegerTables
    ports: Ports
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
        return code_bits(self.tables.thresholds)

    @property
    def padding(self) -> int:
        """Bytes, 0 or 1, between the ports' bytes and the codes, so that codes of 16 bits lie at even offsets."""
        return len(self.ports) % 2 if self.code_bits == 16 else 0

    @property
    def frame_size(self) -> int:
        """Bytes of a frame as `frame_bytes` makes them."""
        return len(self.ports) + self.padding + len(self.joints) * self.code_bits // 8

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

    @property
    def places(self) -> tuple[tuple[int, int], ...]:
        """The port and the bit of each switch."""
        found = {n: (p, bit) for p, port in enumerate(self.ports) for bit, n in enumerate(port) if n != NO_SWITCH}
        return tuple(found[number] for number in range(self.tables.n_switches))

    @cached_property
    def fields(self) -> tuple[tuple[Field, ...], ...]:
        """What each group's byte is put together from: bits that follow each other in one port are one field."""
        places, found = self.places, []
        for numbers in self.groups:
            fields: list[Field] = []
            for to, (port, bit) in enumerate(places[number] for number in numbers):
                last = fields[-1] if fields else None
                if last is not None and (last.port, last.bit + last.width) == (port, bit):
                    fields[-1] = replace(last, width=last.width + 1)
                else:
                    fields.append(Field(port, bit, 1, to))
            found.append(tuple(fields))
        return tuple(found)

    def port_bytes(self, bits: NDArray[np.bool_]) -> NDArray[np.uint8]:
        """Return the byte of each port (n, ports) for the switches (n, s)."""
        shown = np.zeros((len(bits), len(self.ports), 8), bool)
        for number, (port, bit) in enumerate(self.places):
            shown[:, port, bit] = bits[:, number]
        return np.packbits(shown, axis=2, bitorder="little")[:, :, 0]

    def group_bytes(self, bits: NDArray[np.bool_]) -> NDArray[np.uint8]:
        """Return the byte of each group (n, groups) for the switches (n, s)."""
        packed = np.zeros((len(bits), len(self.groups)), np.uint8)
        for g, numbers in enumerate(self.groups):
            packed[:, g] = np.packbits(np.asarray(bits, bool)[:, numbers], axis=1, bitorder="little")[:, 0]
        return packed

    @property
    def means(self) -> NDArray[np.int64]:
        """What each switch, then each joint, adds to the scores while it is missing, beyond its row 0: (s + j, K)."""
        pairs = zip(self.tables.joint_means, self.tables.joint_rows, strict=True)
        joints = [mean.astype(np.int64) - rows[0] for mean, rows in pairs]
        return np.vstack([self.tables.switch_means.astype(np.int64), *joints])

    @property
    def narrow_means(self) -> bool:
        """Whether a byte holds each of the `means`."""
        return bool((np.abs(self.means) <= MOST_MEAN).all())

    def scores(self, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.int64]:
        """Return the scores (n, K) of the switches (n, s) and codes (n, j), as the firmware adds them up."""
        scores = np.tile(self.start, (len(bits), 1))
        for byte, rows in zip(self.group_bytes(bits).T, self.group_rows, strict=True):
            scores += rows[byte]
        for column, joint in zip(codes.T, self.joints, strict=True):
            scores += joint.rows[joint.bin_of(column)]
        return scores

    def frame_bytes(self, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.uint8]:
        """Return what the firmware's input structure holds, (n, F): ports, padding, codes (little-endian).

        Where a code has 8 bits, codes above 255 become 255: no threshold tells them apart.
        """
        padding = np.zeros((len(bits), self.padding), np.uint8)
        if self.code_bits == 8:
            held = np.minimum(codes, 255).astype(np.uint8)
        else:
            held = np.ascontiguousarray(codes, "<u2").view(np.uint8).reshape(len(bits), 2 * codes.shape[1])
        return np.hstack([self.port_bytes(bits), padding, held])


def arrange(
    tables: IntegerTables,
    *,
    ports: Ports | None = None,
    group_size: int = 5,
    n_groups: int | None = None,
    entry_bits: int = 16,
    bins: Bins = "direct",
    adding: Adding = "called",
) -> Layout:
    """Return `tables` with the switches in groups of at most `group_size` (2 to 6), in the order of `ports`.

    There are as few groups as that size allows, or `n_groups` where given: more look-ups and less flash. They are as
    even as can be, and none is of two ports where as few can do without. Where no wiring is known, `ports` are left
    out, and switches follow each other by number. Raises FirmwareError if the tables cannot be laid out so: 8-bit
    entries for look-ups that span more than 255 steps, a joint with more than 256 rows, "direct" for codes of 16 bits,
    "trimmed" for thresholds further apart than 254 codes, no inputs at all.
    """
    if tables.n_switches + tables.n_joints == 0:
        raise FirmwareError("the build looks at no switch and no joint: there is nothing to make firmware of")
    if entry_bits not in (8, 16):
        raise FirmwareError(f"entries of {entry_bits} bits: firmware has 8 or 16")
    check_joints(tables.thresholds, bins)
    ports = consecutive(tables.n_switches) if ports is None else ports
    groups = _grouped(ports, group_size, n_groups)
    sums = [_group_sums(tables.switch_rows[list(numbers)].astype(np.int64)) for numbers in groups]
    wide_joints = [rows.astype(np.int64) for rows in tables.joint_rows]
    leasts = [_least(rows, entry_bits, group=True) for rows in sums]
    joint_leasts = [_least(rows, entry_bits, group=False) for rows in wide_joints]
    layout = Layout(
        tables=tables,
        ports=ports,
        groups=groups,
        entry_bits=entry_bits,
        bins=bins,
        adding=adding,
        start=sum([*leasts, *joint_leasts], tables.bias.astype(np.int64)),
        group_rows=tuple(
            _entries(rows - least, entry_bits, f"switch group {g}")
            for g, (rows, least) in enumerate(zip(sums, leasts, strict=True))
        ),
        joints=tuple(
            joint_layout(thresholds, _entries(rows - least, entry_bits, f"joint {a}"), bins)
            for a, (thresholds, rows, least) in enumerate(
                zip(tables.thresholds, wide_joints, joint_leasts, strict=True)
            )
        ),
    )
    if layout.n_rows > MOST_TABLE_ROWS:
        raise FirmwareError(f"{layout.n_rows} rows: firmware has at most {MOST_TABLE_ROWS}; keep fewer inputs")
    return layout


def _grouped(ports: Ports, group_size: int, n_groups: int | None) -> tuple[tuple[int, ...], ...]:
    if not SMALLEST_GROUP <= group_size <= LARGEST_GROUP:
        raise FirmwareError(f"groups of {group_size} switches: {SMALLEST_GROUP} to {LARGEST_GROUP} share a look-up")
    shown = [[number for number in port if number != NO_SWITCH] for port in ports]
    switches = [*chain(*shown)]
    fewest = -(-len(switches) // group_size)
    count = fewest if n_groups is None else n_groups
    if not fewest <= count <= len(switches):
        raise FirmwareError(f"{count} groups of at most {group_size} for {len(switches)} switches: {fewest} or more")
    within = [part for port in shown for part in _even(port, -(-len(port) // group_size))]
    return tuple(within if len(within) == count else _even(switches, count))


def _even(numbers: Sequence[int], count: int) -> list[tuple[int, ...]]:
    return [tuple(part.tolist()) for part in np.array_split(np.asarray(numbers, int), count)] if count else []


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
