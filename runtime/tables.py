"""The integer score tables of a build, and `tables.bin`.

    score_k = bias_k + sum over switches s of bits_s * switch_rows[s, k] + sum over joints a of joint_rows[a][bin_a, k]

where bin_a is the number of thresholds of joint a below its code. Everything is int16, and no partial sum, in any
order, leaves int16: `IntegerTables` proves it when it is made, so a table that could overflow cannot be loaded.

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
            2 s K       switch_means, int16: what stands in for a missing switch
            2 j K       joint_means, int16: what stands in for a missing joint
            2 sum T     thresholds, uint16, joint after joint, strictly increasing within a joint
            2 sum(T+1)K joint_rows, int16, joint after joint, bin after bin, a row of K each
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import BuildError
from .sealed import seal, unseal

KIND = b"THNRTABL"
VERSION = 1
LIMIT = 32767
MAX_CLASSES, MAX_SWITCHES, MAX_JOINTS = 1024, 4096, 256
MAX_BYTES = 16 << 20
# Steps per unit of score. At the finest the least safe margin, 2 steps, is still more than what the ensemble takes for
# a tie (stumps.TIE): a row that is safe is never one that the ensemble decided by the number of the class.
COARSEST_SCALE, FINEST_SCALE = 2.0**-64, 2.0**30
_COUNTS = struct.Struct("<HHHHd")

Rows = NDArray[np.int16]


@dataclass(frozen=True, slots=True, eq=False)
class IntegerTables:
    """Score tables in int16. Raises BuildError if shapes disagree or a sum could leave -32767..32767.

    bias (K,), switch_rows (s, K), thresholds: j arrays uint16 (T_a,), joint_rows: j arrays (T_a + 1, K),
    switch_means (s, K), joint_means (j, K), scale in steps per unit of score.
    """

    bias: Rows
    switch_rows: Rows
    thresholds: tuple[NDArray[np.uint16], ...]
    joint_rows: tuple[Rows, ...]
    switch_means: Rows
    joint_means: Rows
    scale: float

    def __post_init__(self) -> None:
        _check_counts(self.n_classes, self.n_switches, self.n_joints)
        _check_shapes(self)
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
        """The largest absolute value that any partial sum, in any order, with any inputs or missing ones, can take."""
        return max(int(_furthest(self, +1).max()), int(_furthest(self, -1).max()))


def _furthest(tables: IntegerTables, sign: int) -> NDArray[np.int64]:
    """Return, per class, the most that the rows can add up to in the direction of `sign`; (K,)."""
    choices = [np.stack([tables.switch_rows, tables.switch_means])]
    pairs = zip(tables.joint_rows, tables.joint_means, strict=True)
    choices += [np.vstack([rows, mean])[:, np.newaxis] for rows, mean in pairs]
    reach = np.maximum(sign * tables.bias.astype(np.int64), 0)
    for rows in choices:
        reach += np.maximum(sign * rows.astype(np.int64), 0).max(axis=0).sum(axis=0)
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
    for name, (rows, shape) in expected.items():
        if rows.shape != shape or rows.dtype != np.int16:
            raise BuildError(f"{name} is {rows.dtype} {rows.shape}, it must be int16 {shape}")


def _check_stored_scale(scale: float) -> None:
    # Coarser tables are sound, but no ensemble that a build may hold is as large as that.
    if not scale >= COARSEST_SCALE:
        raise BuildError(f"the scale is {scale!r}, in a file it must be at least 2^-64 steps per unit")


def payload_bytes(n_classes: int, n_switches: int, thresholds: Sequence[int]) -> int:
    """Return the length of the payload of tables of so many classes and switches; `thresholds` of each joint."""
    rows = 1 + 2 * n_switches + sum(2 + count for count in thresholds)
    return _COUNTS.size + 2 * (len(thresholds) + sum(thresholds) + n_classes * rows)


def tables_to_bytes(tables: IntegerTables) -> bytes:
    """Return the content of `tables.bin`. Raises BuildError if it is larger than 16 MiB or its scale too coarse."""
    _check_stored_scale(tables.scale)
    header = _COUNTS.pack(tables.n_classes, tables.n_switches, tables.n_joints, 0, tables.scale)
    counts = np.array([len(t) for t in tables.thresholds], dtype="<u2").tobytes()
    rows = (tables.bias, tables.switch_rows, tables.switch_means, tables.joint_means)
    parts = [header, counts, *(r.astype("<i2").tobytes() for r in rows)]
    parts += [t.astype("<u2").tobytes() for t in tables.thresholds]
    parts += [r.astype("<i2").tobytes() for r in tables.joint_rows]
    data = seal(KIND, VERSION, b"".join(parts))
    if len(data) > MAX_BYTES:
        raise BuildError(f"the tables need {len(data)} bytes, a build has at most {MAX_BYTES}: keep fewer inputs")
    return data


def tables_from_bytes(data: bytes, what: str = "tables.bin") -> IntegerTables:
    """Return the tables of a `tables.bin`, which messages call `what`.

    Raises SealError for a file that is foreign, truncated, altered or newer, BuildError for one whose content does not
    add up. Every count is held against the length before anything is allocated.
    """
    if len(data) > MAX_BYTES:
        raise BuildError(f"{what} has {len(data)} bytes, a build has at most {MAX_BYTES}")
    _, payload = unseal(data, KIND, VERSION, what)
    try:
        return _parse(payload)
    except BuildError as wrong:
        raise BuildError(f"{what} is damaged: {wrong}") from None


def _parse(payload: bytes) -> IntegerTables:
    if len(payload) < _COUNTS.size:
        raise BuildError(f"{len(payload)} bytes of content, the counts alone have {_COUNTS.size}")
    K, s, j, zero, scale = _COUNTS.unpack_from(payload)
    _check_counts(K, s, j)
    _check_stored_scale(scale)
    if zero:
        raise BuildError("the two bytes at offset 6 are not zero")
    if len(payload) < _COUNTS.size + 2 * j:
        raise BuildError(f"{len(payload)} bytes of content are too few for {j} joints")
    counts = np.frombuffer(payload, "<u2", j, _COUNTS.size).tolist()
    sizes = [K, s * K, s * K, j * K, *counts, *((T + 1) * K for T in counts)]
    expected = payload_bytes(K, s, counts)
    if len(payload) != expected:
        raise BuildError(f"{len(payload)} bytes of content, its counts call for {expected}")
    words = np.frombuffer(payload, "<u2", offset=_COUNTS.size + 2 * j).astype(np.uint16)
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
    )
