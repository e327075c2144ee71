"""What a CyberGlove's bytes mean on one hand: two points of each sensor's straight line, in a TOML file.

    subject = "anna"
    unit = "deg"
    sensor = [
        { name = "index_mpj", raw_a = 96, value_a = 0.0, raw_b = 161, value_b = 90.0 },
    ]

Two points say what an offset and a gain only say together with the order in which they are applied.
"""

from math import isfinite
from typing import Annotated, Literal

import msgspec

from .errors import SettingError
from .names import fault, shortened

Raw = Annotated[int, msgspec.Meta(ge=1, le=255)]
Name = Annotated[str, msgspec.Meta(min_length=1)]


class SensorCalibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The straight line of one sensor: raw byte (1 to 255) and value at each of two points.

    Raises SettingError if the two points are at one byte or a value is no number.
    """

    name: Name
    raw_a: Raw
    value_a: float
    raw_b: Raw
    value_b: float

    def __post_init__(self) -> None:
        if reason := fault(self.name):
            raise SettingError(f"sensor {shortened(repr(self.name))} {reason}")
        if self.raw_a == self.raw_b:
            raise SettingError(f"{self.name!r}: raw_a and raw_b are both {self.raw_a}, which makes no line")
        if not (isfinite(self.value_a) and isfinite(self.value_b)):
            raise SettingError(f"{self.name!r}: value_a and value_b must be finite numbers")

    def value(self, raw: float) -> float:
        """Return the value at a raw byte."""
        return self.value_a + (raw - self.raw_a) * ((self.value_b - self.value_a) / (self.raw_b - self.raw_a))


class GloveCalibration(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, rename={"sensors": "sensor"}
):
    """The lines of a glove's sensors, each named once, in any order. Raises SettingError if one is named twice."""

    subject: str = ""
    unit: Literal["deg"] = "deg"
    sensors: tuple[SensorCalibration, ...]

    def __post_init__(self) -> None:
        if self.subject and (reason := fault(self.subject)):
            raise SettingError(f"subject {shortened(repr(self.subject))} {reason}")
        seen: set[str] = set()
        for sensor in self.sensors:
            if sensor.name in seen:
                raise SettingError(f"sensor {sensor.name!r} is calibrated twice: keep one")
            seen.add(sensor.name)

    def to_toml(self) -> str:
        """Return the calibration as the text of its file; numbers keep every digit."""
        return msgspec.toml.encode(self).decode("utf-8")
