"""The integer score tables of a build, and `tables.bin`.

    score_k = bias_k + sum over switches s of bits_s * switch_rows[s, k] + sum over joints a of joint_rows[a][bin_a, k]
              + sum over slopes l of distance_l * row_l[k] + sum over grids g of joints rows_g[bin_a, bin_b, k]

where bin_a is the number of thresholds of joint a below its code, and distance_l is the distance of its joint's code
from the middle of a range (`Line`). Distances and their rows are int8, everything else is int16, and no partial sum,
in any order, leaves int16: `IntegerTables` checks this when made, so a table that could overflow cannot be loaded.

The payload of `tables.bin`, inside the envelope of `sealed.py`, all little-endian (K classes, s switches, j joints):

    offset  bytes       meaning
    0       2           K, 2 to 1024
    2       2           s, at most 4096
    4       2           j, at most 256
    6       2           zero
    8       8           scale: steps per unit of score, IEEE double, 2^-64 to 2^30
    16      2 j         T_a: number of thresholds of each joint, uint16
            2 K         bias, int16
            2 s K       switch_rows, int16, a row of K per switch
            2 s K       switch_means, int16: replaces a missing switch
            2 j K       joint_means, int16: replaces a missing joint
            2 sum T     thresholds, uint16, joint after joint, strictly increasing within a joint
            2 sum(T+1)K joint_rows, int16, joint after joint, bin after bin, a row of K each

Tables with n > 0 slopes are of format 2: offset 6 holds n, and these follow

            2           grid, uint16: 256 if rows of switches and bins are multiples of 256, else 1
            8 n         joint, low, high, uint16, and gain, int16, of each slope
            K n         rows, int8, a row of K per slope

Tables with n > 0 grids of two joints, and no slopes, are of format 3: offset 6 holds n, and these follow

            8 n         the joints a < b of each grid, and its numbers of thresholds T_a and T_b, uint16
            2 sum T     thresholds, uint16, grid after grid, a's before b's
            2 sum R K   rows, int16, grid after grid, R = (T_a + 1)(T_b + 1): a's bins one by one, in each b's; K a row
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..errors import BuildError
from ..sealed import seal, unseal
from .tables import Additive, terms_of
from .terms.base import HIGHEST_CODE
from .terms.bins import Bins
from .terms.bit import Bit
from .terms.grid import Grid
from .terms.line import Line

KIND = b"THNRTABL"
PLAIN, SLOPED, PAIRED = 1, 2, 3  # formats
LIMIT = 32767
MAX_CLASSES, MAX_SWITCHES, MAX_JOINTS = 1024, 4096, 256
MAX_BYTES = 16 << 20
# Steps per unit of score. At the finest scale the least safe margin, 2 steps, is still more than the ensemble's tie
# tolerance (tables.TIE): a safe row is never one that the ensemble decided by the number of the class.
COARSEST_SCALE, FINEST_SCALE = 2.0**-64, 2.0**30
_COUNTS = struct.Struct("<HHHHd")
_GRID = struct.Struct("<H")
_SLOPE = struct.Struct("<HHHh")
_PAIR = struct.Struct("<HHHH")
# The grid of rows of which an entry of 8 bits holds the upper half.
COARSE = 256
LOST = -1
# Largest number of bin combinations of a grid: no bound is calculated for more.
_MOST_CELLS = 1 << 20

Rows = NDArray[np.int16]
Steps = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class IntegerTables(Additive):
    """Score tables in int16. Raises BuildError if terms disagree or a sum could leave -32767..32767.

    bias (K,); terms: a `Bit` for each switch, `Bins` for each joint, and a `Line` for some joints, or a `Grid` for
    some pairs of joints, each joint in one at most, in the order of the (first) joints. switch_means (s, K) and
    joint_means (j, K) replace missing inputs; scale in steps per unit of score. Firmware stores means in bytes:
    `quantise.in_bytes` rounds them.

    grid is 1, or 256 for tables with slopes whose rows of switches and bins were rounded to multiples of 256 steps, and
    whose scores are relative to the last class.
    """

    switch_means: Rows
    joint_means: Rows
    scale: float
    grid: int = 1

    _arguments = (*Additive._arguments, "switch_means", "joint_means", "scale", "grid")

    @classmethod
    def of(
        cls,
        bias: Rows,
        switch_rows: Rows,
        thresholds: Sequence[NDArray[np.uint16]],
        joint_rows: Sequence[Rows],
        switch_means: Rows,
        joint_means: Rows,
        scale: float,
        further: Sequence[Line | Grid] = (),
        grid: int = 1,
    ) -> Self:
        """Return tables of the rows of switches (s, K), of thresholds (T_a,) and rows (T_a + 1, K) of each joint, and
        of further terms.
        """
        if len(joint_rows) != len(thresholds):
            raise BuildError(f"rows for {len(joint_rows)} joints and thresholds for {len(thresholds)}")
        terms = (*terms_of(switch_rows, thresholds, joint_rows), *further)
        return cls(bias, terms, switch_means, joint_means, scale, grid)

    def __post_init__(self) -> None:
        _check_counts(self.n_classes, self.n_switches, self.n_joints)
        _check_shapes(self)
        _check_grid(self)
        if not 0 < self.scale <= FINEST_SCALE:
            raise BuildError(f"the scale is {self.scale!r}, it must be above 0 and at most 2^30 steps per unit")
        for number, thresholds in enumerate(self.thresholds):
            if np.any(thresholds[1:] <= thresholds[:-1]):
                raise BuildError(f"the thresholds of joint {number} are not strictly increasing")
        if self.bound > LIMIT:
            raise BuildError(f"a sum could reach {self.bound}, beyond {LIMIT}: these tables could overflow")

    @property
    def bound(self) -> int:
        """The largest absolute value of any partial sum, in any order, with any inputs or missing ones."""
        return max(int(_furthest(self, +1).max()), int(_furthest(self, -1).max()))

    @cached_property
    def units(self) -> tuple[tuple[int, ...], ...]:
        """The joints, with those of a grid together: the contributions of different units are independent."""
        together = {joint: grid.joints for grid in self.grids for joint in grid.joints}
        return tuple(sorted({together.get(joint, (joint,)) for joint in range(self.n_joints)}))

    @property
    def relative(self) -> bool:
        """Whether scores are relative to the last class, to which no input adds anything."""
        rows = [self.bias, self.switch_means, self.joint_means, *(end for term in self.core_terms for end in term.ends)]
        return not any(each[..., -1].any() for each in rows)

    def of_joint(self, joint: int) -> tuple[Bins | Line, ...]:
        """Return the terms of a joint alone: its bins, and its slope if it has one."""
        return (self.bins[joint], *(slope for slope in self.lines if slope.joint == joint))

    def turning_codes(self, joint: int, steps: Steps) -> Steps:
        """Return codes at which a joint's contribution is greatest and least between the codes `steps`, after which its
        bins, or its grid, change.
        """
        if len(self.of_joint(joint)) == 1:
            return np.append(0, steps + 1)
        codes = np.unique(np.concatenate([[0, HIGHEST_CODE], steps, steps + 1]))
        return codes[codes <= HIGHEST_CODE]

    def choices(self, joint: int) -> tuple[Steps, Steps]:
        """Return codes (c,) at which a joint alone adds most and least in each bin, and what it adds there (c, K)."""
        codes = self.turning_codes(joint, self.bins[joint].thresholds.astype(np.int64))
        return codes, np.sum([term.of(codes) for term in self.of_joint(joint)], axis=0, dtype=np.int64)

    def states(self, unit: tuple[int, ...]) -> tuple[Steps, Steps]:
        """Return all states of a unit's joints, codes or LOST (c, joints), and the contributions in each (t, c, K): of
        the bins of each joint, or the mean that replaces it, and of further terms. The last is that all are lost.
        """
        codes = [np.append(self.turning_codes(joint, self.steps_of(joint)), LOST) for joint in unit]
        states = np.stack([each.ravel() for each in np.meshgrid(*codes, indexing="ij")], axis=1)
        contributions = []
        for joint, own in zip(unit, states.T, strict=True):
            rows = self.bins[joint].of(own).astype(np.int64)
            contributions.append(np.where((own == LOST)[:, np.newaxis], self.joint_means[joint], rows))
        for term in self.further:
            if set(term.inputs) <= set(unit):
                # A joint of a grid that is lost reads as code 0; the mean of a single joint includes its slope.
                rows = term.of(*(np.maximum(states[:, unit.index(joint)], 0) for joint in term.inputs))
                lost = (states == LOST).any(axis=1) & (len(unit) == 1)
                contributions.append(np.where(lost[:, np.newaxis], 0, rows))
        return states, np.stack(contributions).astype(np.int64)

    def binned(self, joint: int) -> Bins:
        """Return the contribution of a joint alone, as if each distance of its slope were a bin."""
        bins, *slopes = self.of_joint(joint)
        thresholds = np.unique(np.concatenate([term.steps[0].astype(np.int64) for term in (bins, *slopes)]))
        codes = np.append(0, thresholds + 1)
        rows = sum((slope.of(codes) for slope in slopes), bins.of(codes)).astype(np.int16)
        return Bins(joint, thresholds.astype(np.uint16), rows)

    @cached_property
    def ends(self) -> tuple[Steps, Steps]:
        """The least and the most that each input alone adds, (s + j, K): switches first."""
        added = [np.stack([0 * row, row]) for row in self.switch_rows]
        added += [self.choices(joint)[1] for joint in range(self.n_joints)]
        shape = len(added), self.n_classes
        least, most = (np.array([end(each, axis=0) for each in added], np.int64) for end in (np.min, np.max))
        return least.reshape(shape), most.reshape(shape)

    @property
    def missing(self) -> Steps:
        """What each missing input adds to an open switch, or to code 0 of a joint, (s + j, K): switches first."""
        joints = self.joint_means.astype(np.int64)
        for number in range(self.n_joints):
            joints[number] -= sum(term.of(np.zeros(1, np.uint16))[0].astype(np.int64) for term in self.of_joint(number))
        return np.vstack([self.switch_means.astype(np.int64), joints])

    @property
    def missing_shifts(self) -> Steps:
        """How many bits each row of `missing` has to be shifted right to fit signed bytes, (s + j,)."""
        most = np.abs(self.missing).max(axis=1).tolist()
        return np.array([max(0, number.bit_length() - 7) for number in most], np.int64)

    def joint_sums(self, codes: NDArray[np.uint16]) -> NDArray[np.int32]:
        """Return the bias plus the contribution of the joints' codes (n, j), (n, K)."""
        # No partial sum leaves int16, so nothing overflows here.
        sums = np.repeat(self.bias[np.newaxis].astype(np.int32), len(codes), axis=0)
        for term in self.terms:
            if not isinstance(term, Bit):
                sums += term.of(*(codes[:, joint] for joint in term.inputs)).astype(np.int32)
        return sums

    def scores(self, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.int32]:
        """Return the scores (n, K), in steps, of the kept switches (n, s) and the joints' codes (n, j)."""
        # No partial sum leaves int16; a product of small integers is exact.
        scores: NDArray[np.int32] = self.joint_sums(codes) + bits.astype(np.int32) @ self.switch_rows.astype(np.int32)
        return scores


def _furthest(tables: IntegerTables, sign: int) -> Steps:
    """Return, per class, the largest possible sum of the rows in the direction of `sign`; (K,)."""
    reach = np.maximum(sign * tables.bias.astype(np.int64), 0)
    switches = np.stack([tables.switch_rows, tables.switch_means]).astype(np.int64)
    reach += np.maximum(sign * switches, 0).max(axis=0).sum(axis=0)
    for unit in tables.units:
        reach += np.maximum(sign * tables.states(unit)[1], 0).sum(axis=0).max(axis=0)
    return reach


def _check_counts(n_classes: int, n_switches: int, n_joints: int) -> None:
    if not 2 <= n_classes <= MAX_CLASSES:
        raise BuildError(f"{n_classes} grasp types: a build has 2 to {MAX_CLASSES}")
    if n_switches > MAX_SWITCHES:
        raise BuildError(f"{n_switches} switches: a build has at most {MAX_SWITCHES}")
    if n_joints > MAX_JOINTS:
        raise BuildError(f"{n_joints} joints: a build has at most {MAX_JOINTS}")


def _check_shapes(tables: IntegerTables) -> None:
    K, s, j = tables.n_classes, tables.n_switches, tables.n_joints
    expected = [
        ("bias", tables.bias, np.int16, (K,)),
        ("switch_means", tables.switch_means, np.int16, (s, K)),
        ("joint_means", tables.joint_means, np.int16, (j, K)),
        *((f"switch_rows[{bit.switch}]", bit.row, np.int16, (K,)) for bit in tables.bits),
        *((f"joint_rows[{a.joint}]", a.rows, np.int16, (len(a.thresholds) + 1, K)) for a in tables.bins),
        *((f"the row of the slope of joint {slope.joint}", slope.row, np.int8, (K,)) for slope in tables.lines),
    ]
    _check_further(tables)
    if any(line.gain is None for line in tables.lines):
        raise BuildError("the tables have a line of scores: quantise them first")
    for grid in tables.grids:
        bins = (len(grid.thresholds[0]) + 1, len(grid.thresholds[1]) + 1, K)
        expected.append((f"the rows of the grid of joints {grid.joints}", grid.rows, np.int16, bins))
    for name, rows, dtype, shape in expected:
        if rows.shape != shape or rows.dtype != dtype:
            raise BuildError(f"{name} is {rows.dtype} {rows.shape}, it must be {np.dtype(dtype)} {shape}")


def _check_further(tables: IntegerTables) -> None:
    j = tables.n_joints
    if any(not isinstance(term, Bit | Bins | Line | Grid) for term in tables.terms):
        raise BuildError("the tables have terms that no board reads: collapse them first")
    numbers = [term.inputs[0] for term in (*tables.bits, *tables.bins)]
    if numbers != [*range(tables.n_switches), *range(j)]:
        raise BuildError("the terms of switches and joints are not in order")
    joints = [slope.joint for slope in tables.lines]
    if joints != sorted(set(joints)) or any(not 0 <= joint < j for joint in joints):
        raise BuildError(f"slopes of joints {joints}: they must rise, each below {j}")
    joints = [joint for grid in tables.grids for joint in grid.joints]
    if tables.lines and joints:
        raise BuildError("slopes and grids: tables have one of both")
    if len(set(joints)) < len(joints) or any(not 0 <= a < b < j for a, b in (grid.joints for grid in tables.grids)):
        raise BuildError(f"grids of joints {joints}: each is below {j}, and in one grid at most")
    if joints[::2] != sorted(joints[::2]):
        raise BuildError(f"grids of joints {joints}: their first joints must rise")
    for grid in tables.grids:
        if any(t.dtype != np.uint16 or np.any(t[1:] <= t[:-1]) for t in grid.thresholds):
            raise BuildError(f"the thresholds of the grid of joints {grid.joints} are not strictly increasing")
        one, other = (len(tables.thresholds[a]) + len(t) + 2 for a, t in zip(grid.joints, grid.thresholds, strict=True))
        if one * other > _MOST_CELLS:
            raise BuildError(f"joints {grid.joints} have {one} and {other} bins: too many for a grid")


def _check_grid(tables: IntegerTables) -> None:
    if tables.grid not in ((1, COARSE) if tables.lines else (1,)):
        raise BuildError(f"rows on a grid of {tables.grid} steps: it is 1, or {COARSE} in tables with slopes")
    rows = [tables.switch_rows, *(rows for rows in tables.joint_rows if len(rows) > 1)]
    if tables.grid == COARSE and not (tables.relative and all(not (each % COARSE).any() for each in rows)):
        raise BuildError(f"rows on a grid of {COARSE} steps must be multiples of it, and 0 for the last grasp type")


def _check_stored_scale(scale: float) -> None:
    # Coarser tables are sound, but no ensemble that a build may hold is as large as that.
    if not scale >= COARSEST_SCALE:
        raise BuildError(f"the scale is {scale!r}, in a file it must be at least 2^-64 steps per unit")


def least_bytes(n_classes: int, n_switches: int, n_joints: int) -> int:
    """Return the payload length of tables of this size whose joints have no thresholds."""
    return _COUNTS.size + 2 * (n_joints + n_classes * (1 + 2 * n_switches + 2 * n_joints))


def tables_to_bytes(tables: IntegerTables) -> bytes:
    """Return the content of `tables.bin`. Raises BuildError if it is larger than 16 MiB or its scale too coarse."""
    _check_stored_scale(tables.scale)
    more = len(tables.further)
    header = _COUNTS.pack(tables.n_classes, tables.n_switches, tables.n_joints, more, tables.scale)
    counts = np.array([len(t) for t in tables.thresholds], dtype="<u2").tobytes()
    rows = (tables.bias, tables.switch_rows, tables.switch_means, tables.joint_means)
    parts = [header, counts, *(r.astype("<i2").tobytes() for r in rows)]
    parts += [t.astype("<u2").tobytes() for t in tables.thresholds]
    parts += [r.astype("<i2").tobytes() for r in tables.joint_rows]
    parts += [_GRID.pack(tables.grid)] if tables.lines else []
    parts += [_SLOPE.pack(slope.joint, slope.low, slope.high, slope.gain) for slope in tables.lines]
    parts += [slope.row.astype("<i1").tobytes() for slope in tables.lines]
    parts += [_PAIR.pack(*grid.joints, *map(len, grid.thresholds)) for grid in tables.grids]
    parts += [each.astype("<u2").tobytes() for grid in tables.grids for each in grid.thresholds]
    parts += [grid.rows.astype("<i2").tobytes() for grid in tables.grids]
    data = seal(KIND, SLOPED if tables.lines else PAIRED if tables.grids else PLAIN, b"".join(parts))
    if len(data) > MAX_BYTES:
        raise BuildError(f"the tables need {len(data)} bytes, a build has at most {MAX_BYTES}: keep fewer inputs")
    return data


def tables_from_bytes(data: bytes, what: str = "tables.bin") -> IntegerTables:
    """Return the tables of a `tables.bin`, whose name in messages is `what`.

    Raises FormatError for a file that is foreign, truncated, altered or newer, BuildError for one with inconsistent
    content. Every count is checked against the length before anything is allocated.
    """
    if len(data) > MAX_BYTES:
        raise BuildError(f"{what} has {len(data)} bytes, a build has at most {MAX_BYTES}")
    version, payload = unseal(data, KIND, PAIRED, what)
    try:
        return _parse(payload, version)
    except BuildError as wrong:
        raise BuildError(f"{what} is damaged: {wrong}") from None


def _parse(payload: bytes, version: int) -> IntegerTables:
    at = 0

    def take(kind: str, *shape: int) -> NDArray[Any]:
        """Return the next numbers, of a type of numpy's, in this shape."""
        nonlocal at
        begin, at = at, at + prod(shape) * np.dtype(kind).itemsize
        if at > len(payload):
            raise BuildError(f"{len(payload)} bytes of content, its counts call for {at} or more")
        found = np.frombuffer(payload[begin:at], kind).reshape(shape)
        return found.astype(found.dtype.newbyteorder("="))

    K, s, j, n = take("<u2", 4).tolist()
    scale: float = take("<f8", 1).item()
    _check_counts(K, s, j)
    _check_stored_scale(scale)
    if (n > 0) != (version in (SLOPED, PAIRED)):
        raise BuildError(f"{n} slopes or grids in format {version}: the two bytes at offset 6 are wrong")
    counts = take("<u2", j).tolist()
    bias, switch_rows, switch_means, joint_means = (take("<i2", *shape) for shape in ((K,), (s, K), (s, K), (j, K)))
    thresholds = [take("<u2", count) for count in counts]
    joint_rows = [take("<i2", count + 1, K) for count in counts]
    grid, further = 1, list[Line | Grid]()
    if version == SLOPED:
        grid = take("<u2", 1).item()
        ends = [(*take("<u2", 3).tolist(), take("<i2", 1).item()) for _ in range(n)]
        rows = take("<i1", n, K)
        further += (Line(joint, low, high, row, gain) for (joint, low, high, gain), row in zip(ends, rows, strict=True))
    elif version == PAIRED:
        pairs = take("<u2", n, 4).tolist()
        steps = [(take("<u2", one), take("<u2", other)) for _, _, one, other in pairs]
        for (a, b, one, other), both in zip(pairs, steps, strict=True):
            further.append(Grid((a, b), both, take("<i2", one + 1, other + 1, K)))
    if at < len(payload):
        raise BuildError(f"{len(payload)} bytes of content, its counts call for {at}")
    return IntegerTables.of(bias, switch_rows, thresholds, joint_rows, switch_means, joint_means, scale, further, grid)
