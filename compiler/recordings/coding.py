"""Convert values to codes on a calibration or a grid, measure the loss, and find a grid without loss."""

import math
from collections.abc import Iterable

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from thenar.runtime.names import list_names

from .columns import JointColumns, TaxelColumns
from .errors import TableError, list_rows
from .graspset import CODES, LARGEST_VALUE, Joint
from .summary import Oddity

# The second point of a grid's straight line: so far out that its step equals the grid within a bit or two.
_FAR = 1000


class CodingCost(msgspec.Struct, frozen=True):
    """The loss from coding one joint: errors in `unit`, distinct values before and after."""

    joint: str
    unit: str
    step: float
    largest_error: float
    rms_error: float
    distinct_before: int
    distinct_after: int

    @property
    def rounds(self) -> bool:
        """Whether coding changes values by more than the arithmetic does, or makes some equal."""
        return self.largest_error > 1e-6 * self.step or self.distinct_after < self.distinct_before


def code_joint(
    name: str, entry: JointColumns, values: NDArray[np.float64], rows: NDArray[np.int64]
) -> tuple[NDArray[np.uint16], Joint, CodingCost]:
    """Return the codes (n,) of one column of finite `values` (n,), their calibration, and their cost.

    Raises TableError naming the first of `rows` whose code lies outside 0..65535; RecordingError if the calibration is
    not a straight line.
    """
    if isinstance(entry, TaxelColumns) and not entry.is_coded:
        whole = bool((values == np.rint(values)).all()) and values.min() >= 0 and values.max() < CODES
        entry = replace(entry, codes=True) if whole else replace(entry, grid=sound_grid(values))
    joint = _joint(name, entry, float(values.min()))
    if isinstance(entry, TaxelColumns) and entry.bits is not None:
        # Calibrated at the ends of the converter's range.
        least, most = joint.value([0, top := 2**entry.bits - 1]).tolist()
        joint = Joint(joint.name, joint.unit, 0, least, top, most)
        if (beyond := values > joint.code_b).any():
            raise TableError(f"taxel {name!r}: {list_rows(rows[beyond])} exceed {entry.bits} bits: say how many it has")
    codes = values if entry.is_counts else joint.code(values)
    outside = (codes < 0) | (codes >= CODES)
    if outside.any():
        cause = "check origin and calibration" if (codes < 0).any() else "take a coarser grid"
        raise TableError(f"joint {name!r}: {list_rows(rows[outside])} would get codes outside 0..{CODES - 1}: {cause}")
    errors = np.zeros(1) if entry.is_counts else np.abs(joint.value(codes) - values)
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
    if entry.is_counts:
        return Joint(name, entry.unit, 0, 0.0, 1, 1.0)
    steps = least / entry.step
    # If the grid is too fine to count, a Joint cannot have it either.
    floor = math.floor(steps) * entry.step if math.isfinite(steps) else least
    origin = floor if entry.origin is None else entry.origin
    return Joint(name, entry.unit, 0, origin, _FAR, origin + _FAR * entry.step)


# The most codes for values that share a decimal place; the fewest between the 1st and 99th percentiles of others.
_OWN_STEPS, _STEPS = 20_000, 1000
# Joints with more values than the first number and fewer codes than the second have lost information.
_MANY, _FEW = 20, 10


def sound_grid(values: NDArray[np.float64]) -> float:
    """Return a grid for finite `values`.

    It is the last decimal place of the values, if that takes at most 20,000 codes; otherwise 1, 2 or 5 times a power of
    ten: the widest with a thousand steps between the 1st and 99th percentiles, unless the other values would then have
    no codes.
    """
    least, largest = float(values.min()), float(values.max())
    span, far = largest - least, max(abs(least), abs(largest))
    if not 0 < span <= LARGEST_VALUE:
        return 1.0
    finest = _round_up(max(span / (CODES - 2), far * 1e-8, 1 / LARGEST_VALUE))
    for exponent in range(
        min(0, math.floor(math.log10(span))), math.ceil(math.log10(max(span / _OWN_STEPS, finest)) - 1e-9) - 1, -1
    ):
        steps = values / float(f"1e{exponent}")
        if np.allclose(steps, np.rint(steps), 0, 1e-6):
            return float(f"1e{exponent}")
    low, high = np.percentile(values, [1, 99]).tolist()
    return max(_round_down(max((high - low) / _STEPS, finest)), finest)


def _round_down(number: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above `number`."""
    exponent = math.floor(math.log10(number) + 1e-9)
    return next(step for factor in (5, 2, 1, 0.5) if (step := float(f"{factor}e{exponent}")) <= number * (1 + 1e-9))


def _round_up(number: float) -> float:
    """Return the smallest of 1, 2 and 5 times a power of ten that is not below `number`."""
    exponent = math.floor(math.log10(number) + 1e-9)
    return next(step for factor in (1, 2, 5, 10) if (step := float(f"{factor}e{exponent}")) >= number * (1 - 1e-9))


def coarse(coded: Iterable[tuple[CodingCost, NDArray[np.float64]]]) -> list[Oddity]:
    """Return a finding about the joints that lost most of their distinct values, given costs and values."""
    lost = [
        (cost, sound_grid(values))
        for cost, values in coded
        if cost.distinct_before >= _MANY and cost.distinct_after < _FEW
    ]
    if not lost:
        return []
    shown = [
        f"{cost.joint} {cost.distinct_after} of {cost.distinct_before} (grid = {grid:g} keeps them)"
        for cost, grid in lost
    ]
    message = f"{len(lost)} joints keep few of their values on their grid: {list_names(shown)}"
    return [Oddity("coarse grids", len(lost), message, columns=tuple(cost.joint for cost, _ in lost))]
