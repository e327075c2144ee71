"""The glove's joint angles, as a robot's messages have them."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec

from thenar.drivers.errors import SettingError

if TYPE_CHECKING:
    from thenar.drivers.calibration import GloveCalibration

_BYTES = range(256)


class JointAngles(msgspec.Struct, frozen=True):
    """The names of the joints that are calibrated, and where each stands, in rad."""

    names: tuple[str, ...]
    positions_rad: tuple[float, ...]


class AngleReader:
    """Turns a record's sensor bytes into angles: a table of 256 angles a sensor, made once.

    `sensor_names` are the record's, in wire order; sensors that the calibration does not know are left out.
    """

    __slots__ = ("_names", "_tables")

    def __init__(self, sensor_names: Sequence[str], calibration: "GloveCalibration") -> None:
        """Raise SettingError if the calibration, which is in degrees, knows none of the sensors."""
        known = {sensor.name: sensor for sensor in calibration.sensors}
        found = [(number, known[name]) for number, name in enumerate(sensor_names) if name in known]
        if not found:
            raise SettingError("the calibration knows none of the glove's sensors: it is of another glove")
        self._names = tuple(sensor.name for _, sensor in found)
        self._tables = tuple(
            (number, tuple(math.radians(sensor.value(raw)) for raw in _BYTES)) for number, sensor in found
        )

    def angles(self, sensors: bytes) -> JointAngles:
        """Return the angles of one record, whose sensors' bytes stand in wire order."""
        return JointAngles(self._names, tuple([table[sensors[number]] for number, table in self._tables]))
