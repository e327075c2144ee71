"""The calibration of a glove on one hand: two points of each sensor's straight line, in a TOML file.

    subject = "anna"
    unit = "deg"
    sensor = [
        { name = "index_mpj", raw_a = 96, value_a = 0.0, raw_b = 161, value_b = 90.0 },
    ]

Two points are unambiguous; an offset and a gain would also need the order in which they are applied.

The guided calibration finds the points from held poses. In the first pose, the flat hand, every joint counts as 0
degrees; each later pose bends or spreads some joints. The angles of those poses are typical ranges of motion from
orthopaedic textbooks, not measurements of this hand: if you have measured a pose, write its angle into the file.
"""

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Annotated, Literal

import msgspec

from .errors import SettingError
from .names import fault, shortened

Raw = Annotated[int, msgspec.Meta(ge=1, le=255)]
Name = Annotated[str, msgspec.Meta(min_length=1)]
# The most that a sensor drifts in a hand held still, in counts.
STEADY = 8
# Real gloves move 50 to 140 counts from flat hand to fist; a joint that moves less than this was not moved.
LEAST_TRAVEL = 10
_ENDS = (1, 255)
_FINGERS = ("index", "middle", "ring", "little")


class SensorCalibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The straight line of one sensor: what it reads (a CyberGlove's: a byte, 1 to 255) and the value at each of two
    points.

    Raises SettingError if the two points share a reading or a value is not a number.
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
        """Return the value of a reading."""
        return self.value_a + (raw - self.raw_a) * ((self.value_b - self.value_a) / (self.raw_b - self.raw_a))


class SensorLines(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, rename={"sensors": "sensor"}):
    """The lines of sensors, each named once, in any order. Raises SettingError if one is named twice."""

    subject: str = ""
    unit: str
    sensors: tuple[SensorCalibration, ...]

    def __post_init__(self) -> None:
        for what, name in (("subject", self.subject), ("unit", self.unit)):
            if (name or what == "unit") and (reason := fault(name)):
                raise SettingError(f"{what} {shortened(repr(name))} {reason}")
        seen: set[str] = set()
        for sensor in self.sensors:
            if sensor.name in seen:
                raise SettingError(f"sensor {sensor.name!r} is calibrated twice: keep one")
            seen.add(sensor.name)

    def to_toml(self) -> str:
        """Return the text of the calibration file; numbers keep every digit."""
        return msgspec.toml.encode(self).decode("utf-8")


class GloveCalibration(SensorLines, frozen=True, kw_only=True):
    """The lines of a CyberGlove's sensors."""

    unit: Literal["deg"] = "deg"


class CalibrationPose(msgspec.Struct, frozen=True):
    """A pose to hold: an instruction, and the angle in degrees at each sensor that the pose calibrates."""

    name: str
    instruction: str
    degrees: Mapping[str, float]


class Held(msgspec.Struct, frozen=True):
    """The samples of one held pose: the median byte of each sensor, and its drift in counts."""

    raw: bytes
    wander: tuple[int, ...]


FLAT = CalibrationPose("flat hand", "Lay the hand flat on a table, wrist straight, fingers and thumb together.", {})
POSES = (
    CalibrationPose(
        "fist",
        "Make a tight fist, the thumb outside.",
        {f"{finger}_{joint}": degrees for finger in _FINGERS for joint, degrees in (("mpj", 90.0), ("pij", 100.0))}
        | {f"{finger}_dij": 70.0 for finger in _FINGERS},
    ),
    CalibrationPose(
        "bent thumb",
        "Open the hand; bend both outer joints of the thumb as far as they go.",
        {"thumb_mpj": 50.0, "thumb_ij": 80.0},
    ),
    CalibrationPose(
        "spread hand",
        "Lay the hand flat again; spread thumb and fingers as far as they go.",
        {"thumb_abduction": 60.0}
        | dict.fromkeys(("middle_index_abduction", "ring_middle_abduction", "little_ring_abduction"), 20.0),
    ),
    CalibrationPose(
        "thumb across",
        "Touch the root of the little finger with the tip of the thumb.",
        {"thumb_rotation": 60.0, "palm_arch": 20.0},
    ),
    CalibrationPose("wrist down", "Straighten the fingers; bend the wrist towards the palm.", {"wrist_pitch": 60.0}),
    CalibrationPose("wrist aside", "Wrist straight again, then bent towards the little finger.", {"wrist_yaw": 30.0}),
)


def poses_of(names: Sequence[str]) -> tuple[CalibrationPose, ...]:
    """Return the poses that calibrate sensors of these names, the flat hand first.

    A sensor whose name implies no joint is bent as far as it goes, which counts as 90 degrees.
    """
    known = [pose for pose in POSES if set(pose.degrees) & set(names)]
    others = [name for name in names if not any(name in pose.degrees for pose in POSES)]
    if others:
        how = "Bend every joint that has a sensor as far as it goes."
        known.append(CalibrationPose("everything bent", how, dict.fromkeys(others, 90.0)))
    return (FLAT, *known)


def held(samples: Sequence[bytes]) -> Held:
    """Return the median and the drift of at least one sample of all sensors. A glitch does not move a median."""
    from statistics import median_low  # a run calibrates nothing

    columns = list(zip(*samples, strict=True))
    raw = bytes(median_low(column) for column in columns)
    return Held(raw, tuple(max(column) - min(column) for column in columns))


def problems(names: Sequence[str], flat: Held | None, pose: CalibrationPose, found: Held) -> list[str]:
    """Return reasons to reject a pose, in sentences; `flat` is None when the pose is the flat hand itself."""
    concerned = [place for place, name in enumerate(names) if flat is None or name in pose.degrees]
    out = []
    for place in concerned:
        name, raw = names[place], found.raw[place]
        if found.wander[place] > STEADY:
            out.append(f"{name} drifted by {found.wander[place]} counts: hold still")
        if raw in _ENDS:
            out.append(f"{name} is at the end of its range ({raw}): does the glove fit, is the sensor whole?")
        if flat is not None and abs(raw - flat.raw[place]) < LEAST_TRAVEL:
            out.append(f"{name} went from {flat.raw[place]} to {raw} only: was the joint moved?")
    return out


def calibration(
    names: Sequence[str], flat: Held, found: Sequence[tuple[CalibrationPose, Held]], subject: str
) -> GloveCalibration:
    """Return the lines through the flat hand and the poses, in wire order; a sensor that did not move is left out."""
    ends = {
        name: (pose_held.raw[names.index(name)], degrees)
        for pose, pose_held in found
        for name, degrees in pose.degrees.items()
        if name in names
    }
    lines = tuple(
        SensorCalibration(name, raw_a=raw_a, value_a=0.0, raw_b=ends[name][0], value_b=ends[name][1])
        for name, raw_a in zip(names, flat.raw, strict=True)
        if name in ends and ends[name][0] != raw_a
    )
    return GloveCalibration(subject=subject, sensors=lines)
