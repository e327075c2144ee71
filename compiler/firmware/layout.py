"""How a build's integer tables lie in a microcontroller's flash: which switches share a look-up, how wide an entry is,
how a joint's code becomes a row.

    score_k = start_k + sum over look-ups l of rows_l[n_l, k] + sum over slopes of distance * row[k]

where n_l is the byte of a group of switches, one bit per switch, or is added up from the codes of one or a few joints,
or both. What a pair of joints adds is a look-up of both, besides those that they have alone. A frame holds the switches
as they come, a byte for each port: eight wires of an expander, eight keys of a matrix, or eight kept switches in their
order; a group is put together from fields of such bytes. Every row is the exact sum of its switches' and joints' rows,
so the scores are those of `IntegerTables`, bit for bit. There are three kinds of entries:

    16 bits, added up in 16. They wrap around at will, for all scores fit; row 0 of a group of switches is zero, so that
             one switch's change is plus or minus row 2^bit.
    8 bits,  added up in 8, just so, where the proved bound of all scores is at most 127.
    8 bits,  added up in 16, where it is not: entries are what exceeds the least of their look-up and class, 0 to 255;
             the leasts are part of `start`. Where tables have slopes and all these are multiples of 256 (`grid`),
             entries are of their upper halves.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import chain
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.tables import COARSE, IntegerTables

from . import FirmwareError

MOST_INLINE = 8  # thresholds are compared one by one; where there are more, they are searched
MOST_ROWS = 256  # a bin is one byte
MOST_ENTRY = 255  # that a byte without a sign holds
MOST_BYTE = 127  # the largest bound of scores that are added up in a byte
MOST_BINS = 256  # and so is what is left of a code when the first of a joint's bins is taken from it

Bins = Literal["direct", "trimmed", "search"]
Rows = NDArray[np.integer]


@dataclass(frozen=True, slots=True, eq=False)
class JointLayout:
    """Joint `number`, and what its code adds to the number of a look-up's row: `weight` times the number of thresholds
    that are not below the code, so that the highest codes add nothing.

    "direct": bins[code] for all 256 codes. "trimmed": bins[clamped code - first] from the first threshold to one beyond
    the last. Both hold uint8 (n,) with the weight in them. "search": no bins, the thresholds are compared; and so are
    few of them in "trimmed", where that is faster. Bins begin at byte `first_bin` of all bins, thresholds at
    `first_step` of all that are compared.
    """

    number: int
    weight: int
    thresholds: NDArray[np.uint16]
    first: int
    bins: NDArray[np.uint8]
    first_bin: int
    first_step: int

    @property
    def compared(self) -> bool:
        """Whether thresholds are compared with the code."""
        return len(self.bins) == 0

    @property
    def most(self) -> int:
        """What code 0 adds, and no code more."""
        return self.weight * len(self.thresholds)

    def places(self, codes: NDArray[np.uint16]) -> NDArray[np.int64]:
        """Return what each code (n,) adds, found in the way that the firmware finds it."""
        if self.compared:
            return self.weight * (len(self.thresholds) - np.searchsorted(self.thresholds, codes)).astype(np.int64)
        held = np.clip(codes.astype(np.int64), self.first, self.first + len(self.bins) - 1)
        return self.bins[held - self.first].astype(np.int64)


# Up to so many thresholds of a byte are compared no slower than a code is clamped and looked up, and in less flash.
_COMPARED = 6


def _bins(thresholds: NDArray[np.uint16], weight: int, bins: Bins, code_bits: int) -> tuple[int, NDArray[np.uint8]]:
    """Return the first code of a joint's bins, and the bins."""
    first, last = 0, 255
    if bins == "trimmed":
        first, last = int(thresholds[0]), int(thresholds[-1]) + 1
        if code_bits == 8 and len(thresholds) <= _COMPARED:
            bins = "search"
    codes = np.arange(first, last + 1) if bins != "search" else np.arange(0)
    places = weight * (len(thresholds) - np.searchsorted(thresholds, codes))
    return first, places.astype(np.uint8)


def code_bits(tables: IntegerTables) -> int:
    """Return the width of the codes, 8 where no joint's thresholds or slope tell codes above 254 apart, else 16."""
    steps = [tables.steps_of(joint) for joint in range(tables.n_joints)]
    last = [int(each[-1]) + 1 for each in steps if len(each)] + [slope.high for slope in tables.slopes]
    return 16 if any(code > 255 for code in last) else 8


def check_joints(tables: IntegerTables, bins: Bins) -> None:
    """Raise FirmwareError if a joint's rows are more than a byte can number, or cannot be found by `bins`."""
    if bins == "direct" and code_bits(tables) == 16:
        raise FirmwareError('codes have 16 bits: their rows are found by "trimmed" or "search", not "direct"')
    own = list(enumerate(tables.thresholds))
    own += [each for pair in tables.pairs for each in zip(pair.joints, pair.thresholds, strict=True)]
    for number, steps in own:
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
    # Levels are bits of nothing: a device compares, and gives them in the order of their codes.
    levels = [[level[-1] for level in board] for board in (*scan.taxels, *(each.levels for each in scan.streams))]
    levels += [[switch for _, switch in port.levels] for port in scan.ports]
    boards = (*scan.scanners, *(stream.switches for stream in scan.streams))
    pairs = (*boards, *(port.switches for port in scan.ports), *map(enumerate, levels))
    return tuple(chain(*map(ports_of, pairs)))


@dataclass(frozen=True, slots=True)
class Field:
    """`width` bits of the byte of a port, from `bit` on, which are those of a group from `to` on."""

    port: int
    bit: int
    width: int
    to: int


SMALLEST_GROUP, LARGEST_GROUP = 2, 8
MOST_TABLE_ROWS = 65535  # their numbers are 16 bits wide

Adding = Literal["called", "unrolled"]

_REGISTERS = 28  # that an AVR has for sums


@dataclass(frozen=True, slots=True)
class Parts:
    """Every part has `width` classes; part p begins at class firsts[p]. The last two overlap where K is no multiple."""

    width: int
    firsts: tuple[int, ...]


def parts_of(n_classes: int, sum_bits: int = 16) -> Parts:
    """Return the fewest parts of equal width that cover `n_classes`: an AVR has 28 registers for their sums."""
    most = _REGISTERS * 8 // sum_bits
    count = -(-n_classes // most)
    width = -(-n_classes // count)
    return Parts(width, tuple(min(part * width, n_classes - width) for part in range(count)))


@dataclass(frozen=True, slots=True, eq=False)
class Lookup:
    """One row added per frame, of `rows` (m, K), which begin at row `first_row` of the table.

    Its number is the byte of the group of switches `group`, if there is one, plus what the codes of `joints` add.
    """

    index: int
    first_row: int
    rows: Rows
    group: int | None
    joints: tuple[JointLayout, ...]

    @property
    def zero_row(self) -> int:
        """The number of the row that is added while all switches are open and all codes are 0."""
        return sum(joint.most for joint in self.joints)


@dataclass(frozen=True, eq=False)
class Layout:
    """An arrangement of `tables` for K classes, s switches and j joints, each switch in one of `ports`.

    groups[g] are the numbers of the switches of a group, bit 0 first; rows of look-ups are int16,
    uint8 or int8, as entry_bits and sum_bits say; code_bits as the function of that name says; start (K,) int64.
    """

    tables: IntegerTables
    ports: Ports
    groups: tuple[tuple[int, ...], ...]
    entry_bits: int
    sum_bits: int
    code_bits: int
    bins: Bins
    adding: Adding
    start: NDArray[np.int64]
    lookups: tuple[Lookup, ...]

    @property
    def biased(self) -> bool:
        """Whether entries are what exceeds the least of their look-up and class."""
        return self.entry_bits < self.sum_bits

    @property
    def entry_shift(self) -> int:
        """How far entries are shifted before they are added: 8 where they are upper halves, else 0."""
        return 8 if self.entry_bits == 8 and self.tables.grid == COARSE else 0

    @property
    def stores_distances(self) -> bool:
        """Whether portable C looks the distances of slopes' codes up, as it does bins."""
        return self.bins == "direct" and self.code_bits == 8

    @property
    def padding(self) -> int:
        """Bytes, 0 or 1, between the ports' bytes and the codes, so that codes of 16 bits lie at even offsets."""
        return len(self.ports) % 2 if self.code_bits == 16 else 0

    @property
    def frame_size(self) -> int:
        """Bytes of a frame as `frame_bytes` makes them."""
        return len(self.ports) + self.padding + self.tables.n_joints * self.code_bits // 8

    @cached_property
    def parts(self) -> Parts:
        """How the classes that are added up are divided among passes: all, or all but the last, where the others are
        relative to it.
        """
        return parts_of(self.tables.n_classes - self.tables.relative, self.sum_bits)

    @cached_property
    def joints(self) -> tuple[JointLayout, ...]:
        """The joints that have thresholds, in the order of their bins; the others are part of the start."""
        return tuple(joint for lookup in self.lookups for joint in lookup.joints)

    @cached_property
    def batches(self) -> list[list[int]]:
        """The look-ups, in their order, in batches: where entries are smaller than sums, those whose rows add up to
        what an entry holds, whichever rows they are; else all of them.
        """
        found: list[list[int]] = []
        held = np.zeros(self.tables.n_classes, np.int64)
        for number, lookup in enumerate(self.lookups):
            most = lookup.rows.max(axis=0).astype(np.int64)
            if found and (not self.biased or (held + most).max() <= MOST_ENTRY):
                found[-1].append(number)
                held += most
            else:
                found.append([number])
                held = most
        return found

    @property
    def n_rows(self) -> int:
        """Rows of all look-ups together."""
        return sum(len(lookup.rows) for lookup in self.lookups)

    @property
    def all_open(self) -> NDArray[np.int64]:
        """The scores (K,) of the frame in which all switches are open and all codes 0."""
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

    @property
    def means(self) -> NDArray[np.int64]:
        """What each switch, then each joint, adds to the scores while it is missing, beyond what 0 adds: (s + j, K)."""
        return _means(self.tables)

    @property
    def narrow_means(self) -> bool:
        """Whether a byte holds each of the `means`."""
        return bool((np.abs(self.means) <= MOST_BYTE).all())

    def group_bytes(self, bits: NDArray[np.bool_]) -> NDArray[np.uint8]:
        """Return the byte of each group (n, groups) for the switches (n, s)."""
        packed = np.zeros((len(bits), len(self.groups)), np.uint8)
        for g, numbers in enumerate(self.groups):
            packed[:, g] = np.packbits(np.asarray(bits, bool)[:, numbers], axis=1, bitorder="little")[:, 0]
        return packed

    def scores(self, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.int64]:
        """Return the scores (n, K) of the switches (n, s) and codes (n, j), as the firmware adds them up."""
        scores = np.tile(self.start, (len(bits), 1))
        groups = self.group_bytes(bits).astype(np.int64)
        for lookup in self.lookups:
            row = np.zeros(len(bits), np.int64) if lookup.group is None else groups[:, lookup.group]
            row = sum((joint.places(codes[:, joint.number]) for joint in lookup.joints), row)
            scores += lookup.rows[row].astype(np.int64) << self.entry_shift
        for slope in self.tables.slopes:
            scores += slope.of(codes[:, slope.joint])
        return scores if self.sum_bits == 16 else scores.astype(np.int8).astype(np.int64)

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


@lru_cache(maxsize=8)
def _means(tables: IntegerTables) -> NDArray[np.int64]:
    joints = [mean.astype(np.int64) - rows[0] for mean, rows in zip(tables.joint_means, tables.joint_rows, strict=True)]
    for slope in tables.slopes:
        joints[slope.joint] = joints[slope.joint] - slope.of(np.zeros(1, np.uint16))[0]
    return np.vstack([tables.switch_means.astype(np.int64), *joints])


Shared = tuple[int | None, tuple[int, ...]]
"""A look-up: the number of a group of switches or None, and those of joints; pairs are numbered after all joints."""


def seen_by(tables: IntegerTables, number: int) -> tuple[tuple[int, NDArray[np.uint16]], ...]:
    """Return the joints that a number in `Shared` names, and their thresholds: a joint itself, or those of a pair; none
    without thresholds.
    """
    if number < tables.n_joints:
        joints: Iterable[tuple[int, NDArray[np.uint16]]] = ((number, tables.thresholds[number]),)
    else:
        pair = tables.pairs[number - tables.n_joints]
        joints = zip(pair.joints, pair.thresholds, strict=True)
    return tuple((joint, steps) for joint, steps in joints if len(steps))


def looked_up(tables: IntegerTables) -> list[int]:
    """Return the numbers, as in `Shared`, of joints and pairs that have more than one row."""
    return [number for number in range(tables.n_joints + len(tables.pairs)) if seen_by(tables, number)]


def arrange(
    tables: IntegerTables,
    *,
    ports: Ports | None = None,
    group_size: int = 5,
    n_groups: int | None = None,
    entry_bits: int = 16,
    bins: Bins = "direct",
    adding: Adding = "called",
    shared: Sequence[Shared] = (),
) -> Layout:
    """Return `tables` with the switches in groups of at most `group_size` (2 to 8), in the order of `ports`.

    There are as few groups as that size allows, or `n_groups` where given: more look-ups and less flash. They are as
    even as can be, and none is of two ports where as few can do without. Where no wiring is known, `ports` are left
    out, and switches follow each other by number. What `shared` names shares look-ups, none of which sees a joint
    twice; every other group, every pair and every other joint that has thresholds has one of its own. Raises
    FirmwareError if the tables cannot be laid out so: 8-bit entries for look-ups that span more than 255 steps, more
    than 256 rows in a look-up, "direct" for codes of 16 bits, "trimmed" for thresholds further apart than 254 codes, no
    inputs at all.
    """
    if tables.n_switches + tables.n_joints == 0:
        raise FirmwareError("the build looks at no switch and no joint: there is nothing to make firmware of")
    if entry_bits not in (8, 16):
        raise FirmwareError(f"entries of {entry_bits} bits: firmware has 8 or 16")
    check_joints(tables, bins)
    coarse = tables.grid if entry_bits == 8 else 1
    ports = consecutive(tables.n_switches) if ports is None else ports
    groups = _grouped(ports, group_size, n_groups)
    sum_bits = 8 if entry_bits == 8 and tables.bound <= MOST_BYTE and not tables.slopes else 16
    varying = set(looked_up(tables))
    constant = (number for number in range(tables.n_joints + len(tables.pairs)) if number not in varying)
    start = sum((_falling(tables, number)[0] for number in constant), tables.bias.astype(np.int64))
    wide = code_bits(tables)
    made: list[Lookup] = []
    first_row = first_bin = first_step = 0
    for group, numbers in _all_shared(tables, len(groups), shared):
        rows = np.zeros((1, tables.n_classes), np.int64) if group is None else _group_sums(tables, groups[group])
        weight, joints = len(rows), []
        for number, steps in chain(*(seen_by(tables, each) for each in numbers)):
            first, held = _bins(steps, weight, bins, wide)
            joints.append(JointLayout(number, weight, steps, first, held, first_bin, first_step))
            first_bin, weight = first_bin + len(held), weight * (len(steps) + 1)
            first_step += len(steps) if len(held) == 0 and len(steps) > MOST_INLINE else 0
        for number in numbers:
            rows = (_falling(tables, number)[:, np.newaxis] + rows).reshape(-1, tables.n_classes)
        if len(rows) > MOST_ROWS:
            raise FirmwareError(f"a look-up of {len(rows)} rows: firmware has at most {MOST_ROWS}")
        what = f"the look-up of switch group {group}" if group is not None else "the look-up of joints"
        what += f" {', '.join(str(joint.number) for joint in joints)}" if joints else ""
        least = rows.min(axis=0) if entry_bits < sum_bits else 0 * rows[0]
        made.append(
            Lookup(
                len(made),
                first_row,
                _entries((rows - least) // coarse, entry_bits, sum_bits, what),
                group,
                tuple(joints),
            )
        )
        start, first_row = start + least, first_row + len(rows)
    if first_row > MOST_TABLE_ROWS:
        raise FirmwareError(f"{first_row} rows: firmware has at most {MOST_TABLE_ROWS}; keep fewer inputs")
    return Layout(tables, ports, groups, entry_bits, sum_bits, wide, bins, adding, start, tuple(made))


def _falling(tables: IntegerTables, number: int) -> NDArray[np.int64]:
    """Return the rows that a joint adds, or a pair, of which the first joint's bins come one by one; from the last."""
    if number < tables.n_joints:
        return tables.joint_rows[number][::-1].astype(np.int64)
    rows = tables.pairs[number - tables.n_joints].rows.astype(np.int64)
    return rows.swapaxes(0, 1).reshape(-1, tables.n_classes)[::-1]


def _all_shared(tables: IntegerTables, n_groups: int, shared: Sequence[Shared]) -> list[Shared]:
    """Return all look-ups: `shared`, every other group and every other joint with thresholds, groups first."""
    taken = {group for group, _ in shared}
    placed = {number for _, numbers in shared for number in numbers}
    alone: list[Shared] = [(group, ()) for group in range(n_groups) if group not in taken]
    alone += [(None, (number,)) for number in looked_up(tables) if number not in placed]
    return sorted([*alone, *shared], key=lambda lookup: (lookup[0] is None, lookup[0] or 0, lookup[1]))


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


def _group_sums(tables: IntegerTables, numbers: Sequence[int]) -> NDArray[np.int64]:
    """Return the sum of the rows of every subset of switches, in the order of the bytes that say which: (2^n, K)."""
    sums = np.zeros((1, tables.n_classes), np.int64)
    for number in numbers:
        sums = np.vstack([sums, sums + tables.switch_rows[number]])
    return sums


def _entries(rows: NDArray[np.int64], entry_bits: int, sum_bits: int, what: str) -> Rows:
    if entry_bits == 16:
        return rows.astype(np.int16)
    if sum_bits == 8:
        return rows.astype(np.int8)
    if rows.max() > MOST_ENTRY:
        raise FirmwareError(
            f"{what} spans {rows.max()} steps, an 8-bit entry holds {MOST_ENTRY}: compile the build with --table-bits 8"
        )
    return rows.astype(np.uint8)
