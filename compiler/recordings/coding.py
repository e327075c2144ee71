"""Joint columns into integer codes, and what that cost."""

import math

import msgspec
import numpy as np
from numpy.typing import NDArray

from .columns import JointColumns
from .errors import TableError
from .graspset import CODES, Joint
from .names import list_rows

# Where the second point of a grid's straight line lies: so far out that its step is the grid to a bit or two.
_FAR = 1000


class CodingCost(msgspec.Struct, frozen=True):
    """What coding one joint lost: errors in `unit`, distinct values before and after."""

    joint: str
    unit: str
    step: float
    largest_error: float
    rms_error: float
    distinct_before: int
    distinct_after: int


def code_joint(
    name: str, entry: JointColumns, values: NDArray[np.float64], rows: NDArray[np.int64]
) -> tuple[NDArray[np.uint16], Joint, CodingCost]:
    """Return the codes (n,) of one column of finite `values` (n,), their calibration, and their cost.

    Raises TableError naming the first of `rows` whose code lies outside 0..65535; RecordingError if the calibration is
    no straight line.
    """
    joint = _joint(name, entry, float(values.min()))
    codes = values if entry.codes else joint.code(values)
    outside = (codes < 0) | (codes >= CODES)
    if outside.any():
        cause = "check origin and calibration" if (codes < 0).any() else "take a coarser grid"
        raise TableError(f"joint {name!r}: {list_rows(rows[outside])} would get codes outside 0..{CODES - 1}: {cause}")
    errors = np.zeros(1) if entry.codes else np.abs(joint.value(codes) - values)
    step = abs(joint.step)
    cost = CodingCost(
        joint=name,
        unit=joint.unit,
        step=step,
        largest_error=float(errors.max()),
        # In steps, whose squares are neither too large nor too small for a double.
        rms_error=math.sqrt(float(np.mean((errors / step) ** 2))) * step,
        distinct_before=len(np.unique(values)),
        distinct_after=len(np.unique(codes)),
    )
    return codes.astype(np.uint16), joint, cost


def _joint(name: str, entry: JointColumns, least: float) -> Joint:
    if entry.calibration is not None:
        points = entry.calibration
        return Joint(name, entry.unit, points.code_a, points.value_a, points.code_b, points.value_b)
    if entry.codes:
        return Joint(name, entry.unit, 0, 0.0, 1, 1.0)
    steps = least / entry.step
    # Where the grid cannot be counted, no Joint will have it either.
    floor = math.floor(steps) * entry.step if math.isfinite(steps) else least
    origin = floor if entry.origin is None else entry.origin
    return Joint(name, entry.unit, 0, origin, _FAR, origin + _FAR * entry.step)
