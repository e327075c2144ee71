"""A CyberGlove's calibration, which converts a record's bytes to the joint codes of a build and to angles in rad.

The two points of a calibration are bytes and values. A build codes a value v as

    code = code_a + (v - value_a) / step,   step = (value_b - value_a) / (code_b - code_a)

by the two points by which its recordings were coded. So the two bytes have codes, and a straight line gives the codes
of all other bytes (`code_line`). Importing recordings and the firmware's C calculate the same: a live byte gets the
code that a recorded one got.
"""

import math
from collections.abc import Mapping, Sequence
from operator import getitem
from typing import TYPE_CHECKING, TypeVar

from thenar.drivers.calibration import GloveCalibration, SensorCalibration, SensorLines
from thenar.drivers.errors import SettingError

from .code_line import code_line
from .errors import FrameError
from .frames import PERIODS, GloveFrame, Mask, Newest
from .manifest import Calibration
from .names import nearest
from .published import JointAngles

if TYPE_CHECKING:
    from pathlib import Path

L = TypeVar("L", bound=SensorLines)
_BYTES = 256
# The unit of recorded bytes that are not calibrated.
RAW = "raw"
# A CyberGlove never sends 0, which ends a record.
_RAW_CODES = range(1, _BYTES)


def load_lines(path: "Path", kind: type[L]) -> L:
    """Return the calibration written by `thenar calibrate`. Raises SettingError with file, line and key."""
    from .toml_source import read_source  # not every glove is calibrated
    from .toml_struct import convert

    source = read_source(path, SettingError)
    return convert(source, (), source.tables(), kind)


def load_calibration(path: "Path") -> GloveCalibration:
    """Return the calibration of a CyberGlove. Raises as `load_lines`."""
    return load_lines(path, GloveCalibration)


# The meaning of the bytes of joints: by a calibration, or, of an uncalibrated stream, by the lines of the numbers that
# it sends, in the unit of the recordings.
Meaning = GloveCalibration | tuple[SensorCalibration, ...] | None


def numbers_of(ranges: Mapping[str, tuple[float, float]]) -> tuple[SensorCalibration, ...]:
    """Return the meaning of the bytes of a stream whose joints have these ranges."""
    return tuple(SensorCalibration(name, 1, low, 255, high) for name, (low, high) in ranges.items())


class CodeTables:
    """The joints of a build as lookup tables for a record's bytes. The last record's codes are kept, because switches
    are read several times per record. `lost` are the joints whose bytes in it are 0: nothing was measured.
    """

    __slots__ = ("_last", "_last_codes", "_places", "_sensors", "_tables", "lost")

    def __init__(self, joints: Sequence[Calibration], sensor_names: Sequence[str], calibration: Meaning = None) -> None:
        """Take the joints in the order of the build's manifest, and the sensors' names in wire order.

        Raises SettingError if the glove lacks a joint, or if its bytes cannot be converted to the build's codes.
        """
        self._sensors = len(sensor_names)
        self._places = [place_of(joint.name, sensor_names) for joint in joints]
        self._tables = [codes_of_bytes(joint, calibration) for joint in joints]
        self._last: bytes | None = None
        self._last_codes: list[int] = []
        self.lost: Mask = 0

    def codes(self, sensors: bytes) -> list[int]:
        """Return the codes of the build's joints, in its order; do not modify them. Raises FrameError for a record of
        another length.
        """
        if sensors == self._last:
            return self._last_codes
        if len(sensors) != self._sensors:
            raise FrameError(f"a CyberGlove record has {len(sensors)} sensors, but {self._sensors} are named")
        picked = [sensors[place] for place in self._places]
        self._last, self._last_codes = sensors, list(map(getitem, self._tables, picked))
        self.lost = sum(1 << joint for joint, byte in enumerate(picked) if not byte) if 0 in picked else 0
        return self._last_codes


class Joints:
    """The newest record of a CyberGlove as the codes of a build's joints, for one thread.

    A record is current for two of its periods. After that it is late, but is used until it is `grace_us` old. A record
    of a glove that is not plugged into its box holds no measurement.
    """

    __slots__ = ("_codes", "_grace_us", "_longest_us", "_wanted", "newest")

    def __init__(
        self,
        joints: Sequence[Calibration],
        sensor_names: Sequence[str],
        calibration: Meaning,
        period_us: int | None,
        grace_us: int = 0,
    ) -> None:
        """Take the arguments of `CodeTables`, and the period of records; None: there is no CyberGlove.

        Raises SettingError if the CyberGlove cannot serve the build.
        """
        self.newest = Newest[GloveFrame]()
        self._wanted, self._longest_us, self._grace_us = bool(joints), PERIODS * (period_us or 0), grace_us
        self._codes = None if period_us is None else CodeTables(joints, sensor_names, calibration)

    def codes(self, now_us: int, frame: GloveFrame | None) -> list[int] | None:
        """Take the newest record; return the joints' codes, None while they are lost. Raises FrameError."""
        if not self._wanted:
            return []
        if self._codes is None:
            return None
        newest = self.newest
        if frame is not None and frame is not newest.frame:
            newest.take(frame, now_us, self._longest_us)
        found = newest.frame
        if found is None or not found.plugged or now_us > max(newest.expires_us, newest.time_us + self._grace_us):
            return None
        return self._codes.codes(found.sensors)

    @property
    def lost(self) -> Mask:
        """The joints that the record of the last codes does not measure."""
        return 0 if self._codes is None else self._codes.lost

    def late(self, now_us: int) -> bool:
        """Return whether the codes are from a late record."""
        return self._wanted and now_us > self.newest.expires_us


class AngleReader:
    """Converts a record's sensor bytes to angles, by a table of 256 angles per sensor, made once.

    `sensor_names` are the record's, in wire order; sensors missing from the calibration are left out.
    """

    __slots__ = ("_names", "_tables")

    def __init__(
        self, sensor_names: Sequence[str], calibration: GloveCalibration, read: Sequence[str] | None = None
    ) -> None:
        """Raise SettingError if the calibration, which is in degrees, has none of the sensors; only `read` are
        measured, None: all.
        """
        known = {sensor.name: sensor for sensor in calibration.sensors if read is None or sensor.name in read}
        found = [(number, known[name]) for number, name in enumerate(sensor_names) if name in known]
        if not found:
            raise SettingError("the calibration has none of the glove's sensors: it is for another glove")
        self._names = tuple(sensor.name for _, sensor in found)
        self._tables = [
            (number, tuple(math.radians(sensor.value(raw)) for raw in range(_BYTES))) for number, sensor in found
        ]

    def angles(self, sensors: bytes) -> JointAngles:
        """Return the angles of one record, whose sensors' bytes are in wire order."""
        return JointAngles(self._names, tuple([table[sensors[number]] for number, table in self._tables]))


def place_of(joint: str, sensor_names: Sequence[str]) -> int:
    """Return the sensor index of a joint of a build. Raises SettingError if the glove has no such sensor."""
    if joint in sensor_names:
        return list(sensor_names).index(joint)
    raise SettingError(
        f"the build needs joint {joint!r}, and the glove has no sensor of that name{nearest(joint, sensor_names)}; "
        "name its sensors as the build does in glove.toml: `joints` of [cyberglove], or of a [[stream]]"
    )


def codes_of_bytes(joint: Calibration, calibration: Meaning) -> tuple[int, ...]:
    """Return the code of each byte, 0 to 255, of the sensor of `joint`. Raises SettingError if there is none."""
    if calibration is None or (isinstance(calibration, tuple) and joint.unit == RAW):
        if joint.code_a in _RAW_CODES and joint.code_b in _RAW_CODES and joint.code_a != joint.code_b:
            return tuple(range(_BYTES))
        raise SettingError(
            f"joint {joint.name!r} of the build is coded in {joint.unit!r}, not in the glove's bytes: calibrate it "
            "(`thenar calibrate`) and name the file in glove.toml: `calibration` of [cyberglove], or of the [[stream]]"
        )
    if isinstance(calibration, GloveCalibration) and calibration.unit != joint.unit:
        raise SettingError(
            f"the glove is calibrated in {calibration.unit!r}, joint {joint.name!r} of the build in {joint.unit!r}: "
            "compile recordings in the calibration's unit"
        )
    sensors = calibration if isinstance(calibration, tuple) else calibration.sensors
    lines = {line.name: line for line in sensors}
    if joint.name not in lines:
        raise SettingError(f"the calibration has no sensor {joint.name!r}: calibrate the glove again")
    line = code_line(joint, lines[joint.name])
    return tuple(map(line.code, range(_BYTES)))
