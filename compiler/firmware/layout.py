"""The layout of a build's integer tables in a microcontroller's flash: which switches share a lookup, how wide an entry
is, and how a joint's code selects a row.

    score_k = start_k + sum over lookups l of rows_l[n_l, k] + sum over slopes of distance * row[k]

where n_l is the byte of a group of at most four switches, one bit per switch, or the place of a joint's code among its
thresholds. A pair of joints is a lookup of both, in addition to those of each joint alone. A frame holds the switches
as they are read, a byte for each port: eight wires of an expander, eight keys of a matrix, or eight kept switches in
their order; a group is assembled from fields of such bytes. Every row is the exact sum of its switches' and joints'
rows, so the scores are those of `IntegerTables`, bit for bit. Entries are the narrowest that hold a build's rows:

    8 bits,  added up in 8, where the proved bound of all scores is at most 127.
    8 bits,  added up in 16, where no lookup spans more than 255 steps: entries are offsets from the minimum of their
             lookup and class; the minima are part of `start`. Where tables have slopes and all offsets are multiples of
             256 (`grid`), entries are their upper halves.
    16 bits, added up in 16, elsewhere.

Sums may wrap around, since all scores fit. Row 0 of a group of switches is zero except of offsets, so that one switch's
change is plus or minus row 2^bit.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.tables import COARSE, IntegerTables

from . import FirmwareError

MOST_INLINE = 8  # up to this number, thresholds are compared one by one; more are searched
MOST_ROWS = 256  # a bin is one byte
MOST_ENTRY = 255  # the largest unsigned byte
MOST_BYTE = 127  # the largest bound of scores that are added up in a byte
GROUP_SIZE = 4  # switches that share a lookup: half of a port's byte

Rows = NDArray[np.integer]


@dataclass(frozen=True, slots=True, eq=False)
class JointLayout:
    """Joint `number`, and its contribution to the number of a lookup's row: `weight` times the number of thresholds
    that are not below the code, so that the highest codes add nothing.

    Codes of 8 bits with many thresholds have bins[clamped code - first], from the first threshold to one beyond the
    last: uint8 (n,), already multiplied by the weight. Otherwise there are no bins, and the thresholds are compared.
    Bins begin at byte `first_bin` of all bins, thresholds at `first_step` of all that are searched.
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
        """The contribution of code 0, which is the largest."""
        return self.weight * len(self.thresholds)

    def places(self, codes: NDArray[np.uint16]) -> NDArray[np.int64]:
        """Return the contribution of each code (n,), computed in the same way as in the firmware."""
        if self.compared:
            return self.weight * (len(self.thresholds) - np.searchsorted(self.thresholds, codes)).astype(np.int64)
        held = np.clip(codes.astype(np.int64), self.first, self.first + len(self.bins) - 1)
        return self.bins[held - self.first].astype(np.int64)


# Comparing up to this many thresholds of a byte is no slower than clamping and looking up, and takes less flash.
_COMPARED = 6


def _bins(thresholds: NDArray[np.uint16], weight: int, code_bits: int) -> tuple[int, NDArray[np.uint8]]:
    """Return the first code of a joint's bins, and the bins, none where thresholds are compared."""
    if code_bits == 16 or len(thresholds) <= _COMPARED:
        return 0, np.zeros(0, np.uint8)
    codes = np.arange(int(thresholds[0]), int(thresholds[-1]) + 2)
    places = weight * (len(thresholds) - np.searchsorted(thresholds, codes))
    return int(codes[0]), places.astype(np.uint8)


def code_bits(tables: IntegerTables) -> int:
    """Return the width of the codes: 8 where no joint's thresholds or slope distinguish codes above 254, else 16."""
    steps = [tables.steps_of(joint) for joint in range(tables.n_joints)]
    last = [int(each[-1]) + 1 for each in steps if len(each)] + [slope.high for slope in tables.slopes]
    return 16 if any(code > 255 for code in last) else 8


def check_joints(tables: IntegerTables) -> None:
    """Raise FirmwareError if a joint has more rows than a byte can number."""
    own = list(enumerate(tables.thresholds))
    own += [each for pair in tables.pairs for each in zip(pair.joints, pair.thresholds, strict=True)]
    for number, steps in own:
        if len(steps) + 1 > MOST_ROWS:
            raise FirmwareError(
                f"joint {number} has {len(steps) + 1} rows, but firmware has at most {MOST_ROWS} a joint: "
                "compile the build with fewer rounds or coarser codes"
            )


Ports = tuple[tuple[int, ...], ...]
"""For each port the switches of its bits, bit 0 first, at most eight; NO_SWITCH for a bit without a switch."""
NO_SWITCH = -1


def consecutive(n_switches: int) -> Ports:
    """Return the ports of switches whose wiring is unknown: eight consecutive switches each."""
    return tuple(tuple(range(first, min(first + 8, n_switches))) for first in range(0, n_switches, 8))


def ports_of(pairs: Iterable[tuple[int, int]]) -> Ports:
    """Return the ports of a chip's reply or of a bitmap of keys, given as `pairs` of bit and switch; bytes without a
    switch are left out.
    """
    ports: dict[int, list[int]] = {}
    for bit, number in sorted(pairs):
        ports.setdefault(bit // 8, [NO_SWITCH] * 8)[bit % 8] = number
    return tuple(map(tuple, ports.values()))


def ports_of_scan(scan: ScanMap | None) -> Ports | None:
    """Return the ports of a build compiled for a harness: those of its streams, then of its readings, byte by byte."""
    if scan is None:
        return None
    # Levels are not bits of any port: a device compares them, and gives them in the order of their codes.
    levels = [[level[-1] for level in stream.levels] for stream in scan.streams]
    levels += [[switch for _, switch in port.levels] for port in scan.ports]
    streams = (stream.switches for stream in scan.streams)
    pairs = (*streams, *(port.switches for port in scan.ports), *map(enumerate, levels))
    return tuple(chain(*map(ports_of, pairs)))


@dataclass(frozen=True, slots=True)
class Field:
    """`width` bits of the byte of a port from `bit` on, which become the bits of a group from `to` on."""

    port: int
    bit: int
    width: int
    to: int


MOST_TABLE_ROWS = 65535  # row numbers are 16 bits wide

_REGISTERS = 28  # registers that an AVR has for sums


@dataclass(frozen=True, slots=True)
class Parts:
    """Equal parts of `width` classes; part p begins at class firsts[p]. The last two overlap if K is no multiple."""

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

    Its number is the byte of the group of switches `group`, or the sum of the contributions of `joints`.
    """

    index: int
    first_row: int
    rows: Rows
    group: int | None
    joints: tuple[JointLayout, ...]


@dataclass(frozen=True, eq=False)
class Layout:
    """An arrangement of `tables` for K classes, s switches and j joints, each switch in one of `ports`.

    groups[g] are the numbers of the switches of a group, bit 0 first; rows of lookups are int16, uint8
    or int8 according to entry_bits and sum_bits; code_bits is that function's result; start (K,) int64.
    """

    tables: IntegerTables
    ports: Ports
    groups: tuple[tuple[int, ...], ...]
    entry_bits: int
    sum_bits: int
    code_bits: int
    start: NDArray[np.int64]
    lookups: tuple[Lookup, ...]

    @property
    def biased(self) -> bool:
        """Whether entries are offsets from the minimum of their lookup and class."""
        return self.entry_bits < self.sum_bits

    @property
    def entry_shift(self) -> int:
        """The left shift of entries before they are added: 8 where they are upper halves, else 0."""
        return 8 if self.entry_bits == 8 and self.tables.grid == COARSE else 0

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
        """The passes that add up the classes: all classes, or all but the last, where the others are relative to it."""
        return parts_of(self.tables.n_classes - self.tables.relative, self.sum_bits)

    @cached_property
    def joints(self) -> tuple[JointLayout, ...]:
        """The joints that have thresholds, in the order of their bins; the others are part of the start."""
        return tuple(joint for lookup in self.lookups for joint in lookup.joints)

    @cached_property
    def batches(self) -> list[list[int]]:
        """The lookups in batches, in order: where entries are narrower than sums, those whose rows always add up to a
        value that fits in an entry; else one batch of all.
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
        """The number of rows of all lookups together."""
        return sum(len(lookup.rows) for lookup in self.lookups)

    @property
    def places(self) -> tuple[tuple[int, int], ...]:
        """The port and the bit of each switch."""
        found = {n: (p, bit) for p, port in enumerate(self.ports) for bit, n in enumerate(port) if n != NO_SWITCH}
        return tuple(found[number] for number in range(self.tables.n_switches))

    @cached_property
    def fields(self) -> tuple[tuple[Field, ...], ...]:
        """The fields that form each group's byte; consecutive bits in one port are one field."""
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
        """The contribution (s + j, K) of each switch, then each joint, while it is missing, relative to that of 0."""
        return _means(self.tables)

    @property
    def narrow_means(self) -> bool:
        """Whether each of the `means` fits in a byte."""
        return bool((np.abs(self.means) <= MOST_BYTE).all())

    def group_bytes(self, bits: NDArray[np.bool_]) -> NDArray[np.uint8]:
        """Return the byte of each group (n, groups) for the switches (n, s)."""
        packed = np.zeros((len(bits), len(self.groups)), np.uint8)
        for g, numbers in enumerate(self.groups):
            packed[:, g] = np.packbits(np.asarray(bits, bool)[:, numbers], axis=1, bitorder="little")[:, 0]
        return packed

    def scores(self, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.int64]:
        """Return the scores (n, K) of the switches (n, s) and codes (n, j), added up as in the firmware."""
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
        """Return the contents of the firmware's input structure, (n, F): ports, padding, codes (little-endian).

        Where a code has 8 bits, codes above 255 become 255: no threshold distinguishes them.
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


def seen_by(tables: IntegerTables, number: int) -> tuple[tuple[int, NDArray[np.uint16]], ...]:
    """Return the joints that the number of a joint, or of a pair (they follow the joints), refers to, and their
    thresholds; empty without thresholds.
    """
    if number < tables.n_joints:
        joints: Iterable[tuple[int, NDArray[np.uint16]]] = ((number, tables.thresholds[number]),)
    else:
        pair = tables.pairs[number - tables.n_joints]
        joints = zip(pair.joints, pair.thresholds, strict=True)
    return tuple((joint, steps) for joint, steps in joints if len(steps))


def looked_up(tables: IntegerTables) -> list[int]:
    """Return the numbers of joints, and of pairs after them, that have more than one row."""
    return [number for number in range(tables.n_joints + len(tables.pairs)) if seen_by(tables, number)]


def arrange(tables: IntegerTables, ports: Ports | None = None) -> Layout:
    """Return `tables` with the switches in groups of at most four, in the order of `ports`, and the narrowest entries.

    There are as few groups as that size allows, as even as possible, and none spans two ports if the same number of
    groups can avoid that. Without known wiring, `ports` are left out, and switches are taken by number. Every joint
    with thresholds, and every pair, has a lookup. Raises FirmwareError if the tables cannot be laid out like this: more
    than 256 rows in a lookup, no inputs at all.
    """
    if tables.n_switches + tables.n_joints == 0:
        raise FirmwareError("the build uses no switch and no joint: compile it with at least one input")
    check_joints(tables)
    ports = consecutive(tables.n_switches) if ports is None else ports
    groups, varying, wide = _grouped(ports), looked_up(tables), code_bits(tables)
    constant = (number for number in range(tables.n_joints + len(tables.pairs)) if number not in varying)
    start = sum((_falling(tables, number)[0] for number in constant), tables.bias.astype(np.int64))
    whole = [*(_group_sums(tables, numbers) for numbers in groups), *(_falling(tables, number) for number in varying)]
    if most := max((len(rows) for rows in whole if len(rows) > MOST_ROWS), default=0):
        raise FirmwareError(f"a pair of joints has {most} rows, but firmware has at most {MOST_ROWS} in a lookup")
    entry_bits, sum_bits = _widths(tables, whole)
    made: list[Lookup] = []
    first_row = first_bin = first_step = 0
    for index, rows in enumerate(whole):
        weight, joints = 1, []
        for number, steps in seen_by(tables, varying[index - len(groups)]) if index >= len(groups) else ():
            first, held = _bins(steps, weight, wide)
            joints.append(JointLayout(number, weight, steps, first, held, first_bin, first_step))
            first_bin, weight = first_bin + len(held), weight * (len(steps) + 1)
            first_step += len(steps) if len(held) == 0 and len(steps) > MOST_INLINE else 0
        least = rows.min(axis=0) if entry_bits < sum_bits else 0 * rows[0]
        entries = (rows - least) // (tables.grid if entry_bits == 8 else 1)
        kind = np.int16 if entry_bits == 16 else np.int8 if sum_bits == 8 else np.uint8
        group = index if index < len(groups) else None
        made.append(Lookup(index, first_row, entries.astype(kind), group, tuple(joints)))
        start, first_row = start + least, first_row + len(rows)
    if first_row > MOST_TABLE_ROWS:
        raise FirmwareError(f"{first_row} rows: firmware has at most {MOST_TABLE_ROWS}; keep fewer inputs")
    return Layout(tables, ports, groups, entry_bits, sum_bits, wide, start, tuple(made))


def _widths(tables: IntegerTables, whole: Iterable[NDArray[np.int64]]) -> tuple[int, int]:
    """Return the bits of an entry and of a sum, for the rows of all lookups."""
    if tables.bound <= MOST_BYTE and not tables.slopes:
        return 8, 8
    spans = (np.ptp(rows, axis=0).max() // tables.grid for rows in whole)
    return (8 if all(span <= MOST_ENTRY for span in spans) else 16), 16


def _falling(tables: IntegerTables, number: int) -> NDArray[np.int64]:
    """Return the rows that a joint or a pair adds, from the last; a pair's first joint contributes bin after bin."""
    if number < tables.n_joints:
        return tables.joint_rows[number][::-1].astype(np.int64)
    rows = tables.pairs[number - tables.n_joints].rows.astype(np.int64)
    return rows.swapaxes(0, 1).reshape(-1, tables.n_classes)[::-1]


def _grouped(ports: Ports) -> tuple[tuple[int, ...], ...]:
    shown = [[number for number in port if number != NO_SWITCH] for port in ports]
    switches = [*chain(*shown)]
    count = -(-len(switches) // GROUP_SIZE)
    within = [part for port in shown for part in _even(port, -(-len(port) // GROUP_SIZE))]
    return tuple(within if len(within) == count else _even(switches, count))


def _even(numbers: Sequence[int], count: int) -> list[tuple[int, ...]]:
    return [tuple(part.tolist()) for part in np.array_split(np.asarray(numbers, int), count)] if count else []


def _group_sums(tables: IntegerTables, numbers: Sequence[int]) -> NDArray[np.int64]:
    """Return the sum of the rows of every subset of switches, in the order of the bytes that encode it: (2^n, K)."""
    sums = np.zeros((1, tables.n_classes), np.int64)
    for number in numbers:
        sums = np.vstack([sums, sums + tables.switch_rows[number]])
    return sums
