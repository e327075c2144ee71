"""The meaning of the readings of joints and taxels on a board: the lines that convert them to codes, and their C.

A build defines its codes, and which codes two poses of a joint have. A sensor's readings in these poses depend on the
glove: its `glove.toml` and its calibrations give them, or the program that runs on the board.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from thenar.drivers.calibration import poses_of
from thenar.drivers.errors import SettingError
from thenar.firmware_templates.rendering import render
from thenar.runtime.calibration import RAW, Meaning, codes_of_bytes, load_calibration, numbers_of, place_of
from thenar.runtime.code_line import FARTHEST, FRACTION, code_point
from thenar.runtime.harness.wiring import Harness, Range, StreamWiring
from thenar.runtime.manifest import Calibration, Manifest, Threshold
from thenar.runtime.sources.rows import JOINT_CODES, steps_of
from thenar.runtime.taxels import TaxelCalibration, calibration_of, count_limit

from . import FirmwareError
from .words import comment, identifiers


class CodeGrid(NamedTuple):
    """The even grid on which the numbers of a stream are coded first: `low` as `first`, `high` `steps` later."""

    low: int
    high: int
    first: int
    steps: int


@dataclass(frozen=True, slots=True)
class Sensor:
    """A joint, or a taxel.

    codes     of the two points that a calibration measures, in 2^-24 of a code
    says      descriptions of the two points: "0 deg" and "90 deg"
    readings  at the two points, as `grid` codes them; None where unknown
    grid      codes the numbers of a stream first; None where readings are used directly
    """

    name: str
    codes: tuple[int, int]
    says: tuple[str, str]
    readings: tuple[int, int] | None = None
    grid: CodeGrid | None = None


@dataclass(frozen=True, slots=True)
class Sensors:
    """The sensors of a build: joints, then taxels.

    levels  of the taxels: the number of a switch, that of the taxel's sensor, and the code above which it is closed
    """

    joints: tuple[Sensor, ...]
    taxels: tuple[Sensor, ...]
    levels: tuple[tuple[int, int, int], ...]

    @property
    def every(self) -> tuple[Sensor, ...]:
        """All sensors, in the order of their numbers."""
        return (*self.joints, *self.taxels)

    @property
    def sorts(self) -> str:
        """The kinds of sensors, in words: "joints, then taxels"."""
        return ", then ".join(["joints"] * bool(self.joints) + ["taxels"] * bool(self.taxels))

    @property
    def known(self) -> bool:
        """Whether the readings of all sensors are known."""
        return all(sensor.readings is not None for sensor in self.every)

    @property
    def on_pins(self) -> bool:
        """Whether all sensors are known in the units that a board sends: those of its pins."""
        return self.known and all(sensor.grid is not None for sensor in self.every)


def sensors_of(names: Manifest, harness: Harness | None = None) -> Sensors:
    """Return the sensors of a build, with the readings known from a glove's `harness` and the calibrations it names.

    Raises SettingError where these do not match the build, FirmwareError where a stream's ranges are not whole numbers.
    """
    device = None if harness is None else harness.joint_device
    ranges = device.joints if isinstance(device, StreamWiring) else {}
    meaning: Meaning = numbers_of(ranges) if ranges else None
    if harness is not None and harness.calibration is not None:
        meaning = load_calibration(Path(harness.calibration))
    if device is not None:
        for joint in names.joints:
            place_of(joint.name, device.sensor_names)
    joints = tuple(_joint(joint, meaning, ranges.get(joint.name), known=device is not None) for joint in names.joints)
    thresholds = [(n, switch.threshold) for n, switch in enumerate(names.switches) if switch.threshold is not None]
    coded = {threshold.taxel.name: threshold for _, threshold in thresholds}
    places = {name: place for place, name in enumerate(coded, len(joints))}
    levels = tuple((n, places[threshold.taxel.name], threshold.code) for n, threshold in thresholds)
    return Sensors(joints, _taxels(list(coded.values()), harness), levels)


def _joint(joint: Calibration, meaning: Meaning, limits: Range | None, *, known: bool) -> Sensor:
    points, unit = _points(joint), joint.unit
    if not known:
        return _sensor(joint, points)
    codes_of_bytes(joint, meaning)  # whether they fit
    grid = None if limits is None else _grid(joint.name, limits, *JOINT_CODES)
    if meaning is None or unit == RAW:  # bytes are codes
        return _sensor(joint, points, (joint.code_a, joint.code_b), grid)
    lines = meaning if isinstance(meaning, tuple) else meaning.sensors
    own = next(line for line in lines if line.name == joint.name)
    return _sensor(joint, (own.value_a, own.value_b), (own.raw_a, own.raw_b), grid)


def _points(coded: Calibration) -> tuple[float, float]:
    """Return the values of the two points at which a sensor is to be read: two poses of a joint, rest and press."""
    own = coded.value_a, coded.value_b
    if coded.unit != "deg":
        return own
    bent = next(pose.degrees[coded.name] for pose in poses_of([coded.name])[1:] if coded.name in pose.degrees)
    try:
        return (0.0, bent) if code_point(coded, 0.0) != code_point(coded, bent) else own
    except SettingError:  # codes so fine that no pose has one
        return own


def _sensor(
    coded: Calibration,
    values: tuple[float, float],
    readings: tuple[int, int] | None = None,
    grid: CodeGrid | None = None,
) -> Sensor:
    first, second = (code_point(coded, value) for value in values)
    if first == second:
        raise FirmwareError(f"{coded.name!r} has one code at both points of its calibration: calibrate the glove again")
    unit = "code" if coded.unit == RAW else coded.unit
    says = [f"code {value:g}" if unit == "code" else f"{value:g} {unit}" for value in values]
    return Sensor(coded.name, (first, second), (says[0], says[1]), readings, grid)


def _taxels(thresholds: Sequence[Threshold], harness: Harness | None) -> tuple[Sensor, ...]:
    lines = None if harness is None else calibration_of(harness.taxel_settings)
    ranges = {} if harness is None else {name: own for each in harness.streams for name, own in each.taxels.items()}
    wired = () if harness is None else harness.taxel_names
    return tuple(
        _taxel(each, lines, ranges.get(each.taxel.name), known=each.taxel.name in wired) for each in thresholds
    )


def _taxel(threshold: Threshold, lines: TaxelCalibration | None, limits: Range | None, *, known: bool) -> Sensor:
    coded = threshold.taxel
    if not known:
        return _sensor(coded, (coded.value_a, coded.value_b))
    count_limit(threshold, lines)  # whether they fit
    grid = None if limits is None else _grid(coded.name, limits, 0, steps_of(limits))
    own = None if lines is None else lines.line(coded.name)
    if own is None:  # counts are codes
        return _sensor(coded, (coded.value_a, coded.value_b), (coded.code_a, coded.code_b), grid)
    return _sensor(coded, (own.value_a, own.value_b), (own.raw_a, own.raw_b), grid)


def _grid(name: str, limits: Range, first: int, last: int) -> CodeGrid:
    low, high = limits
    whole = float(low).is_integer() and float(high).is_integer()
    if not whole or max(abs(low), abs(high), abs(high - low)) > FARTHEST:
        raise FirmwareError(
            f"the range of {name!r} in glove.toml, {low:g} to {high:g}, must be whole numbers within {FARTHEST}: "
            "a board converts its converter's counts; give their range"
        )
    return CodeGrid(int(low), int(high), first, last - first)


def codes_files(name: str, sensors: Sensors) -> dict[str, str]:
    """Return the texts of thenar_`name`_codes.h and .c, which extend the classifier; empty for a build of switches."""
    if not sensors.every:
        return {}
    values = {
        "name": name,
        "sensors": sensors,
        "words": identifiers([sensor.name for sensor in sensors.every]),
        "comments": [comment(f"{sensor.name}: {' and '.join(sensor.says)}") for sensor in sensors.every],
        "fraction": FRACTION,
        "farthest": FARTHEST,
    }
    return {f"thenar_{name}_codes{end}": render(f"codes/thenar_NAME_codes{end}.j2", **values) for end in (".h", ".c")}
