"""Bytes of a CyberGlove to the joint codes of a build: one look-up per joint.

A raw byte r of a sensor that is calibrated means value(r); the build codes that value as

    code = rint(code_a + (value(r) - value_a) / step),   step = (value_b - value_a) / (code_b - code_a)

held to 0..65535, by the two points that its recordings were coded by. Importing recordings works out the same, so a
live byte gets the code that a recorded one got.
"""

import math
from collections.abc import Sequence
from operator import getitem, itemgetter

from thenar.drivers.calibration import GloveCalibration
from thenar.drivers.errors import SettingError

from ..errors import FrameError
from ..manifest import Calibration
from ..names import nearest

_BYTES = 256
_HIGHEST_CODE = 65535
# A CyberGlove never sends 0: it ends a record.
_RAW_CODES = range(1, _BYTES)


class CodeTables:
    """The joints of a build as look-ups into a record's bytes. The last record's codes are kept: switches come several
    times as often as records do.
    """

    __slots__ = ("_last", "_last_codes", "_pick", "_sensors", "_tables")

    def __init__(
        self, joints: Sequence[Calibration], sensor_names: Sequence[str], calibration: GloveCalibration | None = None
    ) -> None:
        """Take the joints as the build's manifest has them, and the sensors' names in wire order.

        Raises SettingError if the glove lacks a joint, or if its bytes cannot be turned into the build's codes.
        """
        self._sensors = len(sensor_names)
        places = [_place(joint.name, sensor_names) for joint in joints]
        self._pick = itemgetter(*places, *places[:1]) if places else _nothing
        self._tables = [codes_of_bytes(joint, calibration) for joint in joints]
        self._last: bytes | None = None
        self._last_codes: list[int] = []

    def codes(self, sensors: bytes) -> list[int]:
        """Return the codes of the build's joints, in its order, not to be changed. Raises FrameError for a record of
        another length.
        """
        if sensors == self._last:
            return self._last_codes
        if len(sensors) != self._sensors:
            raise FrameError(f"a CyberGlove record of {len(sensors)} sensors, {self._sensors} are named")
        self._last, self._last_codes = sensors, list(map(getitem, self._tables, self._pick(sensors)))
        return self._last_codes


def _nothing(_sensors: bytes) -> tuple[int, ...]:
    return ()


def _place(joint: str, sensor_names: Sequence[str]) -> int:
    if joint in sensor_names:
        return list(sensor_names).index(joint)
    raise SettingError(
        f"the build needs joint {joint!r}, and the CyberGlove has no sensor of that name"
        f"{nearest(joint, sensor_names)}; name its sensors as the build does: `joints` of [cyberglove] in glove.toml"
    )


def codes_of_bytes(joint: Calibration, calibration: GloveCalibration | None) -> tuple[int, ...]:
    """Return the code of each byte, 0 to 255, of the sensor of `joint`. Raises SettingError where there is none."""
    if calibration is None:
        return _raw(joint)
    if calibration.unit != joint.unit:
        raise SettingError(
            f"the glove is calibrated in {calibration.unit!r}, joint {joint.name!r} of the build is in {joint.unit!r}: "
            "compile recordings in that unit"
        )
    lines = {line.name: line for line in calibration.sensors}
    if joint.name not in lines:
        raise SettingError(f"the calibration has no sensor {joint.name!r}: calibrate the glove again")
    return tuple(_code(joint, lines[joint.name].value(raw)) for raw in range(_BYTES))


def _raw(joint: Calibration) -> tuple[int, ...]:
    if joint.code_a in _RAW_CODES and joint.code_b in _RAW_CODES and joint.code_a != joint.code_b:
        return tuple(range(_BYTES))
    raise SettingError(
        f"joint {joint.name!r} of the build is coded in {joint.unit!r}, not in a CyberGlove's bytes: calibrate the "
        "glove (`thenar calibrate`) and name the file: `calibration` of [cyberglove] in glove.toml"
    )


def _code(joint: Calibration, value: float) -> int:
    try:
        code = joint.code_a + (value - joint.value_a) / (
            (joint.value_b - joint.value_a) / (joint.code_b - joint.code_a)
        )
    except ZeroDivisionError:
        raise SettingError(
            f"the two points of joint {joint.name!r} in the build are no line: compile it again"
        ) from None
    if math.isnan(code):
        raise SettingError(f"the calibration of joint {joint.name!r} is no number: calibrate the glove again")
    return round(min(max(code, 0), _HIGHEST_CODE))
