"""Live taxels: convert raw counts to levels, as bits; the calibration of taxels.

A calibration gives a taxel's counts at rest and when pressed, and so the value of any count. A build codes values by
the two points by which its recordings were coded. Both are straight lines, so every level, closed at codes above a
threshold, is closed above (or below) one count of this glove. `count_limit` finds that count once; live, only integers
are compared, and a level is decided as in the recordings.
"""

from bisect import bisect_left
from collections.abc import Sequence
from typing import Annotated, Literal

from msgspec import Meta, Struct
from msgspec.structs import replace

from thenar.drivers.calibration import SensorCalibration, SensorLines
from thenar.drivers.errors import SettingError

from .calibration import load_lines
from .code_line import code_line
from .frames import Mask
from .manifest import Calibration, Switch, Threshold
from .scanning.scanmap import ScanMap, StreamLevel

COUNTS = 65536
Raw = Annotated[int, Meta(ge=0, lt=COUNTS)]
TaxelFault = Literal["", "silent", "open wire", "saturated"]
# A level: the limit of its counts (see `count_limit`), and the number of its switch in the build.
Level = tuple[int, int]

# Number of counts whose median is a press; a taxel that moves by fewer counts was not pressed.
_IN_A_ROW, _LEAST_TRAVEL = 5, 10

# A sound taxel's counts are this share of its span from rest to press below its rest at most, and this one above its
# press.
_BELOW_REST, _ABOVE_PRESS = 0.35, 0.1
# Converters miss their ends by a few counts: 1 of 1023, 7 of 4095.
_END_SHIFT = 9


class TaxelLine(SensorCalibration, frozen=True):
    """The straight line of one taxel, from its counts at rest, `raw_a`, to those of a press.

    Raises SettingError if the values of rest and press are not in this order, from 0 on.
    """

    raw_a: Raw
    raw_b: Raw

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.value_a < self.value_b <= 1e9:
            raise SettingError(f"{self.name!r}: the value of a press must be above that of rest, both from 0 to 1e9")


class TaxelCalibration(SensorLines, frozen=True, kw_only=True):
    """The lines of a glove's taxels. In the unit "press", 1 is the press of the calibration, whatever its force."""

    unit: str = "press"
    sensors: tuple[TaxelLine, ...]

    def line(self, name: str) -> TaxelLine | None:
        """Return the line of a taxel, or None if it was not calibrated."""
        return next((line for line in self.sensors if line.name == name), None)


class TaxelSettings(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True):
    """`[taxels]` of glove.toml.

    Parameters
    ----------
    calibration : str, optional
        Path of the file written by `thenar calibrate --taxels`, relative to the folder of glove.toml.
    """

    calibration: Annotated[str, Meta(min_length=1)] | None = None


def calibration_of(settings: TaxelSettings) -> TaxelCalibration | None:
    """Return the calibration that the settings name, or None. Raises as `load_lines`."""
    from pathlib import Path

    return None if settings.calibration is None else load_lines(Path(settings.calibration), TaxelCalibration)


def learnt_lines(
    names: Sequence[str], rested: Sequence[Sequence[int | None]], pressed: Sequence[Sequence[int | None]], value: float
) -> tuple[TaxelLine, ...]:
    """Return the lines of the taxels that moved, from counts at rest and counts while each was pressed once.

    The rest is the median; the press is the median of five consecutive counts that is furthest from it, so that no
    glitch counts. A taxel that moved less than three times its variation at rest was not pressed.
    """
    from statistics import median_low  # a run calibrates nothing

    lines = []
    for place, name in enumerate(names):
        counts = [code for codes in rested if (code := codes[place]) is not None]
        moved = [code for codes in pressed if (code := codes[place]) is not None]
        if not counts or len(moved) < _IN_A_ROW:
            continue
        rest = median_low(counts)
        held = (median_low(moved[at : at + _IN_A_ROW]) for at in range(len(moved) - _IN_A_ROW + 1))
        press = max(held, key=lambda count: abs(count - rest))
        if abs(press - rest) >= max(_LEAST_TRAVEL, 3 * (max(counts) - min(counts))):
            lines.append(TaxelLine(name, rest, 0.0, press, value))
    return tuple(lines)


def count_limit(threshold: Threshold, calibration: TaxelCalibration | None) -> int:
    """Return the limit at which this glove's counts close a level.

    A limit of 0 or more closes the level at counts above it. A negative one closes it at counts whose complement
    `~count` is above it, that is, at counts below `~limit`: recordings and glove are wired with opposite polarity.

    Raises SettingError if the taxel's counts cannot be converted to the build's codes.
    """
    coded = threshold.taxel
    line = None if calibration is None else calibration.line(coded.name)
    if line is None or calibration is None:
        _check_counts(coded, calibration is not None)
        return threshold.code
    if calibration.unit != coded.unit:
        raise SettingError(
            f"taxels are calibrated in {calibration.unit!r}, but {coded.name!r} of the build is in {coded.unit!r}: "
            "compile recordings in the calibration's unit"
        )
    codes = code_line(coded, line)
    (one, low), (other, high) = codes.a, codes.b
    rising = (other > one) == (high > low)
    first = bisect_left(range(COUNTS), True, key=lambda raw: (codes.code(raw) > threshold.code) == rising)
    if not rising:
        return ~first
    return first - 1 if first else ~COUNTS  # closed at every count


def in_counts(scan: ScanMap, switches: Sequence[Switch], calibration: TaxelCalibration | None) -> ScanMap:
    """Return a build's scan map with the limits of this glove's counts in place of the codes of levels: what sources
    are given. Raises SettingError as `count_limit` does.
    """

    def limit(number: int, code: int) -> int:
        threshold = switches[number].threshold
        return code if threshold is None else count_limit(threshold, calibration)

    ports = tuple(
        replace(port, levels=tuple((limit(number, code), number) for code, number in port.levels))
        if port.levels
        else port
        for port in scan.ports
    )

    def limits(levels: Sequence[StreamLevel]) -> tuple[StreamLevel, ...]:
        return tuple((at, limit(number, code), number) for at, code, number in levels)

    streams = tuple(replace(stream, levels=limits(stream.levels)) for stream in scan.streams)
    return replace(scan, ports=ports, streams=streams)


def _check_counts(coded: Calibration, others: bool) -> None:
    """Raise SettingError unless the codes of a taxel are counts."""
    if (coded.code_a, coded.code_b) == (coded.value_a, coded.value_b):
        return
    has = "the calibration lacks it" if others else "the glove's taxels are not calibrated"
    raise SettingError(
        f"taxel {coded.name!r} of the build is coded in {coded.unit!r}, not in counts, and {has}: calibrate it "
        "(`thenar calibrate --taxels`) and name the file: `calibration` of [taxels] in glove.toml"
    )


class LiveTaxel:
    """A taxel of a device: converts its counts to levels of a build. For one thread.

    levels       limits of its counts (see `count_limit`), with the numbers of the build's switches
    calibration  has its rest and press, in counts. Without it, no end of the converter is a fault, since the rest may
                 be at either end
    highest      the converter's highest count; None: its ends are not checked

    owned  the switches of all levels
    fault  of its last reading. An end of the converter is a fault if neither the rest nor the press of the calibration
           is near it: an open wire on the side of the rest, saturation on the side of the press
    """

    def __init__(
        self,
        name: str,
        levels: Sequence[Level],
        calibration: TaxelCalibration | None = None,
        highest: int | None = None,
    ) -> None:
        self.name, self.highest = name, highest
        self._levels = [(limit, 1 << switch) for limit, switch in levels]
        self.owned: Mask = sum(bit for _, bit in self._levels)
        self._ends = _ends(None if calibration is None else calibration.line(name), highest)
        self.fault: TaxelFault = ""

    def read(self, count: int | None) -> tuple[Mask, Mask]:
        """Take the count (None: unreadable); return the closed levels and the lost ones."""
        low, high, at_low, at_high = self._ends
        if count is None:
            self.fault = "silent"
            return 0, self.owned
        self.fault = "" if low < count < high else at_low if count <= low else at_high
        if self.fault:
            return 0, self.owned
        return sum(bit for limit, bit in self._levels if (count if limit >= 0 else ~count) > limit), 0


def _ends(line: SensorCalibration | None, highest: int | None) -> tuple[int, int, TaxelFault, TaxelFault]:
    """Return the count at and below which, and the one at and above which, a taxel has a fault, and the faults."""
    if line is None or highest is None:
        return -1, COUNTS, "", ""
    (rest, press), margin = (line.raw_a, line.raw_b), highest >> _END_SHIFT
    span, rising = abs(press - rest), press > rest
    below_rest, above_press = round(span * _BELOW_REST), round(span * _ABOVE_PRESS)
    least, most = (rest - below_rest, press + above_press) if rising else (press - above_press, rest + below_rest)
    low, high = margin if least > margin else -1, highest - margin if most < highest - margin else COUNTS
    return (low, high, "open wire", "saturated") if rising else (low, high, "saturated", "open wire")
