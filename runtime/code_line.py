"""From a raw reading to a code, with integers only: the same number in Python and in the firmware's C.

A calibration gives the codes of two readings. A straight line runs between them and beyond. A value midway between two
codes gets the even one. The codes of the two points are rounded once, to 2^-24 of a code.
"""

from msgspec import Struct

from thenar.drivers.calibration import SensorCalibration
from thenar.drivers.errors import SettingError

from .manifest import Calibration

# Here too, as the table terms load numpy, which is not wanted for help texts.
HIGHEST_CODE = 65535
# Readings are integers from -65535 to 65535; readings beyond count as the nearest.
FARTHEST = 65535
# Fraction bits of a point's code, and the most integer bits: so all fits into 64 bits.
FRACTION, _WHOLE = 24, 20


class CodeLine(Struct, frozen=True):
    """The line through two points, each a reading and its code in 2^-24 of a code; codes are clipped to 0 to
    `HIGHEST_CODE`.

    Raises ValueError if the two have the same reading, or are further apart than the C can hold.
    """

    a: tuple[int, int]
    b: tuple[int, int]

    def __post_init__(self) -> None:
        (one, low), (other, high) = self.a, self.b
        if one == other or max(abs(one), abs(other), abs(other - one)) > FARTHEST:
            raise ValueError(f"readings {one} and {other} make no line")
        if max(abs(low), abs(high)) >= 1 << FRACTION + _WHOLE:
            raise ValueError(f"codes beyond 2^{_WHOLE} make no line")

    def code(self, reading: int) -> int:
        """Return the code of a reading."""
        (first, low), (last, high) = sorted((self.a, self.b))
        span, above = last - first, min(max(reading, -FARTHEST), FARTHEST) - first
        whole, rest = divmod(low * span + (high - low) * above + (span << FRACTION - 1), span << FRACTION)
        nearest = whole - (whole & 1) if rest == 0 else whole
        return min(max(nearest, 0), HIGHEST_CODE)


def code_point(coded: Calibration, value: float) -> int:
    """Return the code that a build gives to a value of a joint or a taxel, in 2^-24 of a code.

    Raises SettingError if there is none, or if it is far beyond all codes.
    """
    try:
        step = (coded.value_b - coded.value_a) / (coded.code_b - coded.code_a)
        code = coded.code_a + (value - coded.value_a) / step
    except ZeroDivisionError:
        raise SettingError(f"the two points of {coded.name!r} in the build make no line: compile it again") from None
    if not abs(code) < 1 << _WHOLE:
        raise SettingError(
            f"the calibration of {coded.name!r} has {value:g} {coded.unit} at one of its points, which is far beyond "
            f"the {HIGHEST_CODE + 1} codes of the build: calibrate the glove again"
        )
    return round(code * (1 << FRACTION))


def code_line(coded: Calibration, line: SensorCalibration) -> CodeLine:
    """Return the line from a sensor's readings to the codes of a build. Raises SettingError if none exists."""
    a, b = (code_point(coded, value) for value in (line.value_a, line.value_b))
    return CodeLine((line.raw_a, a), (line.raw_b, b))
