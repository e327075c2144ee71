"""Integer tables for codes, as integer tables for the bytes that a sensor sends.

Recordings of several hands share one scale of codes; the runtime turns a hand's bytes into codes by its calibration,
and then codes into bins. Firmware does both at once: the bin of a byte is the bin of its code, so every answer stays
what it was, and thresholds that no byte parts fall away.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import IntegerTables

from .errors import FirmwareError

BYTES = 256


def on_bytes(tables: IntegerTables, codes: Sequence[Sequence[int]]) -> IntegerTables:
    """Return tables whose joint codes are bytes: those of byte b are what `tables` gives for codes[joint][b].

    codes holds, for each joint, the code of each of the 256 bytes (runtime.calibration.codes_of_bytes). Raises
    FirmwareError where they are not that many.
    """
    if [len(joint) for joint in codes] != [BYTES] * tables.n_joints:
        raise FirmwareError(f"codes of {BYTES} bytes are needed for each of {tables.n_joints} joints")
    pairs = [
        _joint(thresholds, rows, np.asarray(joint, np.uint16))
        for thresholds, rows, joint in zip(tables.thresholds, tables.joint_rows, codes, strict=True)
    ]
    return replace(
        tables,
        thresholds=tuple(thresholds for thresholds, _ in pairs),
        joint_rows=tuple(rows for _, rows in pairs),
    )


def _joint(
    thresholds: NDArray[np.uint16], rows: NDArray[np.int16], codes: NDArray[np.uint16]
) -> tuple[NDArray[np.uint16], NDArray[np.int16]]:
    """Return thresholds and rows of one joint: a threshold after each byte whose successor falls into another bin."""
    bins = np.searchsorted(thresholds, codes)
    last = np.flatnonzero(bins[1:] != bins[:-1])
    return last.astype(np.uint16), rows[bins[np.concatenate([last, [BYTES - 1]])]]
