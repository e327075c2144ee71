"""The integer score tables of a build, and `tables.bin`.

    score_k = bias_k + sum over switches s of bits_s * switch_rows[s, k] + sum over joints a of joint_rows[a][bin_a, k]
              + sum over slopes l of distance_l * row_l[k] + sum over pairs p of joints rows_p[bin_a, bin_b, k]

where bin_a is the number of thresholds of joint a below its code, and distance_l is the distance of its joint's code
from the middle of a range (`Slope`). Distances and their rows are int8, everything else is int16, and no partial sum,
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

Tables with n > 0 pairs of joints, and no slopes, are of format 3: offset 6 holds n, and these follow

            8 n         the joints a < b of each pair, and its numbers of thresholds T_a and T_b, uint16
            2 sum T     thresholds, uint16, pair after pair, a's before b's
            2 sum R K   rows, int16, pair after pair, R = (T_a + 1)(T_b + 1): a's bins one by one, in each b's; K a row
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import BuildError
from .sealed import seal, unseal

KIND = b"THNRTABL"
PLAIN, SLOPED, PAIRED = 1, 2, 3  # formats
LIMIT = 32767
MAX_CLASSES, MAX_SWITCHES, MAX_JOINTS = 1024, 4096, 256
MAX_BYTES = 16 << 20
# Steps per unit of score. At the finest scale the least safe margin, 2 steps, is still more than the ensemble's tie
# tolerance (stumps.TIE): a safe row is never one that the ensemble decided by the number of the class.
COARSEST_SCALE, FINEST_SCALE = 2.0**-64, 2.0**30
_COUNTS = struct.Struct("<HHHHd")
_GRID = struct.Struct("<H")
_SLOPE = struct.Struct("<HHHh")
_PAIR = struct.Struct("<HHHH")
HIGHEST_CODE = 65535
# Largest scaled range of codes: a distance from its middle, and its negative, must fit one byte.
WIDEST = 254
# The grid of rows of which an entry of 8 bits holds the upper half.
COARSE = 256
LOST = -1
# Largest number of bin combinations of a pair: no bound is calculated for more.
_MOST_CELLS = 1 << 20

Rows = NDArray[np.int16]


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """The joint contribution of two joints: a row for each bin of one and each of the other, of integers or floats.

    joints (a, b), a < b; thresholds (T_a,) and (T_b,) uint16, strictly increasing; rows (T_a + 1, T_b + 1, K). A joint
    that is missing counts as code 0 here.
    """

    joints: tuple[int, int]
    thresholds: tuple[NDArray[np.uint16], NDArray[np.uint16]]
    rows: NDArray[Any]

    def of(self, codes: NDArray[np.integer]) -> NDArray[Any]:
        """Return the contribution of the codes (n, j) of all joints, (n, K)."""
        one, other = (np.searchsorted(t, codes[:, a]) for a, t in zip(self.joints, self.thresholds, strict=True))
        rows: NDArray[Any] = self.rows[one, other]
        return rows


@dataclass(frozen=True, slots=True, eq=False)
class Slope:
    """A joint's contribution in proportion to its code: row (K,) int8 times the code's distance from the middle.

    A code is clipped to `low` to `high`. Its distance from low is multiplied by 2^gain, or divided and rounded down if
    `gain` is negative: 0 to `most`, at most 254. The distance is that minus `zero`. Raises BuildError.
    """

    joint: int
    low: int
    high: int
    gain: int
    row: NDArray[np.int8]

    def __post_init__(self) -> None:
        if not (0 <= self.low < self.high <= HIGHEST_CODE and -16 <= self.gain <= 7 and 0 < self.most <= WIDEST):
            raise BuildError(
                f"a slope from code {self.low} to {self.high} with gain {self.gain} does not fit a byte: compile again"
            )

    def _gained(self, above: int) -> int:
        return above << self.gain if self.gain > 0 else above >> -self.gain

    @property
    def most(self) -> int:
        """The scaled value of the highest code."""
        return self._gained(self.high - self.low)

    @property
    def zero(self) -> int:
        """The scaled value of the middle, where nothing is added."""
        return (self.most + 1) // 2

    def distances(self, codes: NDArray[np.integer]) -> NDArray[np.int64]:
        """Return the distances of codes (n,)."""
        above = np.clip(codes.astype(np.int64), self.low, self.high) - self.low
        gained: NDArray[np.int64] = above << self.gain if self.gain > 0 else above >> -self.gain
        return gained - self.zero

    def of(self, codes: NDArray[np.integer]) -> NDArray[np.int64]:
        """Return the contribution of the joint's codes (n,), (n, K)."""
        return self.distances(codes)[:, np.newaxis] * self.row.astype(np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class IntegerTables:
    """Score tables in int16. Raises BuildError if shapes disagree or a sum could leave -32767..32767.

    bias (K,), switch_rows (s, K), thresholds: j arrays uint16 (T_a,), joint_rows: j arrays (T_a + 1, K),
    switch_means (s, K), joint_means (j, K), scale in steps per unit of score; slopes of joints, at most one each, in
    the order of the joints; or pairs of joints, each joint in one at most, in the order of their first joints.

    grid is 1, or 256 for tables with slopes whose rows of switches and bins were rounded to multiples of 256 steps, and
    whose scores are relative to the last class.
    """

    bias: Rows
    switch_rows: Rows
    thresholds: tuple[NDArray[np.uint16], ...]
    joint_rows: tuple[Rows, ...]
    switch_means: Rows
    joint_means: Rows
    scale: float
    slopes: tuple[Slope, ...] = ()
    pairs: tuple[Pair, ...] = ()
    grid: int = 1

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
    def n_classes(self) -> int:
        """K."""
        return len(self.bias)

    @property
    def n_switches(self) -> int:
        """Number of kept switches."""
        return len(self.switch_rows)

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.thresholds)

    @property
    def bound(self) -> int:
        """The largest absolute value of any partial sum, in any order, with any inputs or missing ones."""
        return max(int(_furthest(self, +1).max()), int(_furthest(self, -1).max()))

    @property
    def units(self) -> tuple[tuple[int, ...], ...]:
        """The joints, with those of a pair together: the contributions of different units are independent."""
        paired = {joint: pair.joints for pair in self.pairs for joint in pair.joints}
        return tuple(sorted({paired.get(joint, (joint,)) for joint in range(self.n_joints)}))

    @property
    def relative(self) -> bool:
        """Whether scores are relative to the last class, to which no input adds anything."""
        held: list[NDArray[np.integer]] = [self.bias, self.switch_rows, self.switch_means, self.joint_means]
        held += [*self.joint_rows, *(slope.row for slope in self.slopes), *(pair.rows for pair in self.pairs)]
        return not any(rows[..., -1].any() for rows in held)

    def slope_of(self, joint: int) -> Slope | None:
        """Return the slope of a joint, if it has one."""
        return next((slope for slope in self.slopes if slope.joint == joint), None)

    def choices(self, joint: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return codes (c,) at which a joint's contribution is greatest and least in each bin, and its terms (t, c, K).

        The terms are one, the row of the bin, or two, that and the slope's contribution.
        """
        thresholds, rows = self.thresholds[joint].astype(np.int64), self.joint_rows[joint].astype(np.int64)
        slope = self.slope_of(joint)
        if slope is None:
            return np.append(0, thresholds + 1), rows[np.newaxis]
        codes = np.unique(np.concatenate([[0, HIGHEST_CODE], thresholds, thresholds + 1]))
        codes = codes[codes <= HIGHEST_CODE]
        return codes, np.stack([rows[np.searchsorted(thresholds, codes)], slope.of(codes)])

    def all_choices(self, unit: tuple[int, ...]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return all states of a unit's joints, codes or LOST (c, joints), and the terms of each (t, c, K).

        The last is that all of them are lost.
        """
        pair = next((pair for pair in self.pairs if pair.joints == unit), None)
        if pair is None:
            codes, terms = self.choices(unit[0])
            lost = np.zeros_like(terms[:, :1])
            lost[0] = self.joint_means[unit[0]]
            return np.append(codes, LOST)[:, np.newaxis], np.concatenate([terms, lost], axis=1)
        parts = []
        for joint, steps in zip(unit, pair.thresholds, strict=True):
            own = self.thresholds[joint]
            codes = np.append(np.unique(np.concatenate([[0], own.astype(np.int64) + 1, steps.astype(np.int64) + 1])), 0)
            rows = self.joint_rows[joint][np.searchsorted(own, codes)]
            rows[-1], there = self.joint_means[joint], np.arange(len(codes)) < len(codes) - 1
            parts.append((np.where(there, codes, LOST), rows, np.searchsorted(steps, codes)))
        (one, rows, at), (other, more_rows, more_at) = parts
        first, second = (each.ravel() for each in np.indices((len(one), len(other))))
        terms = np.stack([rows[first], more_rows[second], pair.rows[at[first], more_at[second]]])
        return np.column_stack([one[first], other[second]]), terms.astype(np.int64)

    def steps_of(self, joint: int) -> NDArray[np.int64]:
        """Return the codes after which a joint's contribution changes, in order: its thresholds, and its pair's."""
        paired = (t for pair in self.pairs for a, t in zip(pair.joints, pair.thresholds, strict=True) if a == joint)
        return np.unique(np.concatenate([self.thresholds[joint], *paired])).astype(np.int64)

    def binned(self, joint: int) -> tuple[NDArray[np.uint16], Rows]:
        """Return the thresholds of a joint and its rows, as if each distance of its slope were a bin."""
        thresholds, rows, slope = self.thresholds[joint], self.joint_rows[joint], self.slope_of(joint)
        if slope is None:
            return thresholds, rows
        cell = 1 << max(-slope.gain, 0)
        steps = np.union1d(thresholds, np.arange(slope.low + cell - 1, slope.high, cell)).astype(np.uint16)
        codes = np.append(0, steps.astype(np.int64) + 1)
        whole = rows[np.searchsorted(thresholds, codes)] + slope.of(codes)
        return steps, whole.astype(np.int16)

    def joint_sums(self, codes: NDArray[np.uint16]) -> NDArray[np.int32]:
        """Return the bias plus the contribution of the joints' codes (n, j), (n, K)."""
        # No partial sum leaves int16, so nothing overflows here.
        sums = np.repeat(self.bias[np.newaxis].astype(np.int32), len(codes), axis=0)
        for column, thresholds, rows in zip(codes.T, self.thresholds, self.joint_rows, strict=True):
            sums += rows[np.searchsorted(thresholds, column, side="left")]
        for slope in self.slopes:
            sums += slope.of(codes[:, slope.joint]).astype(np.int32)
        for pair in self.pairs:
            sums += pair.of(codes)
        return sums


def _furthest(tables: IntegerTables, sign: int) -> NDArray[np.int64]:
    """Return, per class, the largest possible sum of the rows in the direction of `sign`; (K,)."""
    reach = np.maximum(sign * tables.bias.astype(np.int64), 0)
    switches = np.stack([tables.switch_rows, tables.switch_means]).astype(np.int64)
    reach += np.maximum(sign * switches, 0).max(axis=0).sum(axis=0)
    for unit in tables.units:
        reach += np.maximum(sign * tables.all_choices(unit)[1], 0).sum(axis=0).max(axis=0)
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
    expected: dict[str, tuple[Rows, tuple[int, ...]]] = {
        "bias": (tables.bias, (K,)),
        "switch_rows": (tables.switch_rows, (s, K)),
        "switch_means": (tables.switch_means, (s, K)),
        "joint_means": (tables.joint_means, (j, K)),
    }
    if len(tables.joint_rows) != j:
        raise BuildError(f"rows for {len(tables.joint_rows)} joints and thresholds for {j}")
    for a, (thresholds, rows) in enumerate(zip(tables.thresholds, tables.joint_rows, strict=True)):
        expected[f"joint_rows[{a}]"] = (rows, (len(thresholds) + 1, K))
    joints = [slope.joint for slope in tables.slopes]
    if joints != sorted(set(joints)) or any(not 0 <= joint < j for joint in joints):
        raise BuildError(f"slopes of joints {joints}: they must rise, each below {j}")
    for slope in tables.slopes:
        if slope.row.shape != (K,) or slope.row.dtype != np.int8:
            raise BuildError(f"the row of a slope is {slope.row.dtype} {slope.row.shape}, it must be int8 ({K},)")
    _check_pairs(tables)
    for a, pair in enumerate(tables.pairs):
        one, other = pair.thresholds
        expected[f"pairs[{a}].rows"] = (pair.rows, (len(one) + 1, len(other) + 1, K))
    for name, (rows, shape) in expected.items():
        if rows.shape != shape or rows.dtype != np.int16:
            raise BuildError(f"{name} is {rows.dtype} {rows.shape}, it must be int16 {shape}")


def _check_pairs(tables: IntegerTables) -> None:
    joints = [joint for pair in tables.pairs for joint in pair.joints]
    if tables.slopes and joints:
        raise BuildError("slopes and pairs: tables have one of both")
    if len(set(joints)) < len(joints) or any(
        not 0 <= a < b < tables.n_joints for a, b in (p.joints for p in tables.pairs)
    ):
        raise BuildError(f"pairs of joints {joints}: each is below {tables.n_joints}, and in one pair at most")
    if joints[::2] != sorted(joints[::2]):
        raise BuildError(f"pairs of joints {joints}: their first joints must rise")
    for pair in tables.pairs:
        if any(t.dtype != np.uint16 or np.any(t[1:] <= t[:-1]) for t in pair.thresholds):
            raise BuildError(f"the thresholds of the pair of joints {pair.joints} are not strictly increasing")
        one, other = (len(tables.thresholds[a]) + len(t) + 2 for a, t in zip(pair.joints, pair.thresholds, strict=True))
        if one * other > _MOST_CELLS:
            raise BuildError(f"joints {pair.joints} have {one} and {other} bins: too many for a pair")


def _check_grid(tables: IntegerTables) -> None:
    if tables.grid not in ((1, COARSE) if tables.slopes else (1,)):
        raise BuildError(f"rows on a grid of {tables.grid} steps: it is 1, or {COARSE} in tables with slopes")
    rows = [tables.switch_rows, *(rows for rows in tables.joint_rows if len(rows) > 1)]
    if tables.grid == COARSE and not (tables.relative and all(not (each % COARSE).any() for each in rows)):
        raise BuildError(f"rows on a grid of {COARSE} steps must be multiples of it, and 0 for the last grasp type")


def _check_stored_scale(scale: float) -> None:
    # Coarser tables are sound, but no ensemble that a build may hold is as large as that.
    if not scale >= COARSEST_SCALE:
        raise BuildError(f"the scale is {scale!r}, in a file it must be at least 2^-64 steps per unit")


def payload_bytes(
    n_classes: int,
    n_switches: int,
    thresholds: Sequence[int],
    n_slopes: int = 0,
    pairs: Sequence[tuple[int, int]] = (),
) -> int:
    """Return the payload length of tables with `n_classes` and `n_switches`; `thresholds` of each joint, and of both
    joints of `pairs`.
    """
    rows = 1 + 2 * n_switches + sum(2 + count for count in thresholds) + sum((a + 1) * (b + 1) for a, b in pairs)
    words = len(thresholds) + sum(thresholds) + sum(a + b for a, b in pairs) + n_classes * rows
    slopes = _GRID.size + n_slopes * (_SLOPE.size + n_classes) if n_slopes else 0
    return _COUNTS.size + 2 * words + slopes + len(pairs) * _PAIR.size


def tables_to_bytes(tables: IntegerTables) -> bytes:
    """Return the content of `tables.bin`. Raises BuildError if it is larger than 16 MiB or its scale too coarse."""
    _check_stored_scale(tables.scale)
    more = len(tables.slopes) + len(tables.pairs)
    header = _COUNTS.pack(tables.n_classes, tables.n_switches, tables.n_joints, more, tables.scale)
    counts = np.array([len(t) for t in tables.thresholds], dtype="<u2").tobytes()
    rows = (tables.bias, tables.switch_rows, tables.switch_means, tables.joint_means)
    parts = [header, counts, *(r.astype("<i2").tobytes() for r in rows)]
    parts += [t.astype("<u2").tobytes() for t in tables.thresholds]
    parts += [r.astype("<i2").tobytes() for r in tables.joint_rows]
    parts += [_GRID.pack(tables.grid)] if tables.slopes else []
    parts += [_SLOPE.pack(slope.joint, slope.low, slope.high, slope.gain) for slope in tables.slopes]
    parts += [slope.row.astype("<i1").tobytes() for slope in tables.slopes]
    parts += [_PAIR.pack(*pair.joints, *map(len, pair.thresholds)) for pair in tables.pairs]
    parts += [each.astype("<u2").tobytes() for pair in tables.pairs for each in pair.thresholds]
    parts += [pair.rows.astype("<i2").tobytes() for pair in tables.pairs]
    data = seal(KIND, SLOPED if tables.slopes else PAIRED if tables.pairs else PLAIN, b"".join(parts))
    if len(data) > MAX_BYTES:
        raise BuildError(f"the tables need {len(data)} bytes, a build has at most {MAX_BYTES}: keep fewer inputs")
    return data


def tables_from_bytes(data: bytes, what: str = "tables.bin") -> IntegerTables:
    """Return the tables of a `tables.bin`, whose name in messages is `what`.

    Raises SealError for a file that is foreign, truncated, altered or newer, BuildError for one with inconsistent
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
    if len(payload) < _COUNTS.size:
        raise BuildError(f"{len(payload)} bytes of content, the counts alone have {_COUNTS.size}")
    K, s, j, n, scale = _COUNTS.unpack_from(payload)
    _check_counts(K, s, j)
    _check_stored_scale(scale)
    if (n > 0) != (version in (SLOPED, PAIRED)):
        raise BuildError(f"{n} slopes or pairs in format {version}: the two bytes at offset 6 are wrong")
    if len(payload) < _COUNTS.size + 2 * j:
        raise BuildError(f"{len(payload)} bytes of content are too few for {j} joints")
    counts = np.frombuffer(payload, "<u2", j, _COUNTS.size).tolist()
    sizes = [K, s * K, s * K, j * K, *counts, *((T + 1) * K for T in counts)]
    own = payload_bytes(K, s, counts)
    pairs = (
        list(_PAIR.iter_unpack(payload[own : own + n * _PAIR.size]))
        if version == PAIRED and len(payload) >= own + n * _PAIR.size
        else []
    )
    expected = payload_bytes(K, s, counts, n if version == SLOPED else 0, [(one, other) for _, _, one, other in pairs])
    if len(payload) != expected or len(pairs) != (n if version == PAIRED else 0):
        raise BuildError(f"{len(payload)} bytes of content, its counts call for {expected}")
    words = np.frombuffer(payload, "<u2", sum(sizes), _COUNTS.size + 2 * j).astype(np.uint16)
    bias, switches, means, joint_means, *joints = np.split(words, np.cumsum(sizes)[:-1])
    rows = [block.view(np.int16).reshape(-1, K) for block in (switches, means, joint_means, *joints[j:])]
    return IntegerTables(
        bias=bias.view(np.int16),
        switch_rows=rows[0],
        thresholds=tuple(joints[:j]),
        joint_rows=tuple(rows[3:]),
        switch_means=rows[1],
        joint_means=rows[2],
        scale=scale,
        slopes=_parse_slopes(payload[own + _GRID.size :], n, K) if version == SLOPED else (),
        grid=_GRID.unpack_from(payload, own)[0] if version == SLOPED else 1,
        pairs=_parse_pairs(payload[own + n * _PAIR.size :], pairs, K) if pairs else (),
    )


def _parse_pairs(data: bytes, pairs: Sequence[tuple[int, ...]], K: int) -> tuple[Pair, ...]:
    words = np.frombuffer(data, "<u2").astype(np.uint16)
    sizes = [count for pair in pairs for count in pair[2:]] + [
        (one + 1) * (other + 1) * K for _, _, one, other in pairs
    ]
    parts = np.split(words, np.cumsum(sizes)[:-1])
    steps, rows = parts[: 2 * len(pairs)], parts[2 * len(pairs) :]
    return tuple(
        Pair((a, b), (steps[2 * at], steps[2 * at + 1]), rows[at].view(np.int16).reshape(one + 1, other + 1, K))
        for at, (a, b, one, other) in enumerate(pairs)
    )


def _parse_slopes(data: bytes, n: int, K: int) -> tuple[Slope, ...]:
    rows = np.frombuffer(data, "<i1", offset=n * _SLOPE.size).astype(np.int8).reshape(n, K)
    ends = _SLOPE.iter_unpack(data[: n * _SLOPE.size])
    return tuple(Slope(joint, low, high, gain, row) for (joint, low, high, gain), row in zip(ends, rows, strict=True))
