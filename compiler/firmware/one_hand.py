"""Conversion of a build with any joint codes to the same build for the bytes of one hand's CyberGlove.

Recordings of several hands share one scale of codes; the runtime converts a hand's bytes to codes by its calibration,
and then codes to bins. Firmware does both at once: the bin of a byte is the bin of its code, so every prediction stays
the same, and thresholds that separate no two bytes are dropped.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from thenar.drivers.calibration import GloveCalibration
from thenar.runtime.build import Build
from thenar.runtime.calibration import codes_of_bytes
from thenar.runtime.manifest import Calibration
from thenar.runtime.tables import IntegerTables, Pair

from . import FirmwareError

BYTES = 256


def on_bytes(tables: IntegerTables, codes: Sequence[Sequence[int]]) -> IntegerTables:
    """Return tables whose joint codes are bytes: byte b gives the result of `tables` for codes[joint][b].

    codes holds, for each joint, the code of each of the 256 bytes (runtime.calibration.codes_of_bytes); byte 0, which
    no glove sends, is code 0 to a pair, like a missing joint. Raises FirmwareError if their number differs.
    """
    if [len(joint) for joint in codes] != [BYTES] * tables.n_joints:
        raise FirmwareError(
            f"each of the {tables.n_joints} joints needs the codes of {BYTES} bytes: calibrate all of them"
        )
    # A slope is kept where bytes are codes; elsewhere each byte has the row of its code.
    kept = tuple(slope for slope in tables.slopes if np.array_equal(codes[slope.joint], np.arange(BYTES)))
    of_bytes = replace(tables, slopes=tuple(slope for slope in tables.slopes if slope not in kept), grid=1)
    pairs = [_joint(of_bytes, number, np.asarray(joint, np.uint16)) for number, joint in enumerate(codes)]
    return replace(
        tables,
        thresholds=tuple(thresholds for thresholds, _ in pairs),
        joint_rows=tuple(rows for _, rows in pairs),
        slopes=kept,
        pairs=tuple(_pair(pair, codes) for pair in tables.pairs),
        grid=tables.grid if kept == tables.slopes else 1,
    )


def _pair(pair: Pair, codes: Sequence[Sequence[int]]) -> Pair:
    asked = [np.append(0, codes[joint][1:]) for joint in pair.joints]
    bins = [np.searchsorted(steps, each) for steps, each in zip(pair.thresholds, asked, strict=True)]
    last = [np.flatnonzero(each[1:] != each[:-1]) for each in bins]
    one, other = (each[np.append(at, BYTES - 1)] for each, at in zip(bins, last, strict=True))
    return Pair(pair.joints, (last[0].astype(np.uint16), last[1].astype(np.uint16)), pair.rows[np.ix_(one, other)])


def _joint(
    tables: IntegerTables, joint: int, codes: NDArray[np.uint16]
) -> tuple[NDArray[np.uint16], NDArray[np.int16]]:
    """Return thresholds and rows of one joint: a threshold after each byte whose successor is in another bin."""
    thresholds, rows = tables.binned(joint)
    bins = np.searchsorted(thresholds, codes)
    last = np.flatnonzero(bins[1:] != bins[:-1])
    return last.astype(np.uint16), rows[bins[np.concatenate([last, [BYTES - 1]])]]


_FIRST, _LAST = 1, 255  # what a CyberGlove can send


def for_one_hand(build: Build, calibration: GloveCalibration) -> Build:
    """Return `build` for the raw bytes of the glove that `calibration` describes: each byte is treated as its code.

    Raises SettingError where the calibration lacks a joint of the build, or has another unit.
    """
    joints, rejection = build.manifest.joints, build.manifest.rejection
    codes = [codes_of_bytes(joint, calibration) for joint in joints]
    tables = on_bytes(build.tables, codes)
    if rejection is not None:
        ranges = tuple(tuple(map(byte_range, own, codes)) for own in rejection.ranges)
        rejection = structs.replace(rejection, ranges=ranges)
    raw = tuple(Calibration(joint.column, joint.name, "raw", _FIRST, 1.0, _LAST, 255.0) for joint in joints)
    return Build(structs.replace(build.manifest, joints=raw, rejection=rejection), tables)


def byte_range(limits: tuple[int, int], codes: Sequence[int]) -> tuple[int, int]:
    """Return the range of bytes whose codes are within the limits; codes are monotonic in the bytes."""
    within = [byte for byte in range(_FIRST, _LAST + 1) if limits[0] <= codes[byte] <= limits[1]]
    return (within[0], within[-1]) if within else (_LAST, 0)
