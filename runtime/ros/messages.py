"""The ROS 2 messages that are published, as DDS types, under the names and with the layout that ROS 2 gives them.

std_msgs/String, sensor_msgs/JointState and trajectory_msgs/JointTrajectory, field by field as their .msg files have
them; a type pkg/msg/Name is pkg::msg::dds_::Name_ in DDS. They are final and keyless, and go out as plain CDR (XCDR1),
as rmw_cyclonedds and rmw_fastrtps write theirs. Needs the extra `ros`.

Cyclone's serialisation in Python takes most of the time that a frame has: of the messages that are sent again and again
the bytes come from it once, and afterwards only the numbers in them are replaced. They are CDR: four bytes of header,
then the fields, each aligned to its size counted from behind the header.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import float64, int32, uint32

if TYPE_CHECKING:
    from collections.abc import Sequence as sequence  # noqa: N813 - Cyclone's says nothing to a type checker
else:
    from cyclonedds.idl.types import sequence
import struct
from typing import Any

from ..preshape.selector import Preshape
from ..published import JointAngles

# REP-2011: ROS 2 from Iron on looks for it in the endpoint's user data, and warns where it is missing.
TYPE_HASHES = {
    "std_msgs::msg::dds_::String_": "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "sensor_msgs::msg::dds_::JointState_": "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "trajectory_msgs::msg::dds_::JointTrajectory_": (
        "RIHS01_179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e"
    ),
}


@dataclass
@final
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """Seconds and nanoseconds since 1970."""

    sec: int32
    nanosec: uint32


@dataclass
@final
class Duration(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    """Seconds and nanoseconds."""

    sec: int32
    nanosec: uint32


@dataclass
@final
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """When, and in which frame."""

    stamp: Time
    frame_id: str


@dataclass
@final
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    """A text."""

    data: str


@dataclass
@final
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    """Where joints stand: rad or m, and what is unknown left empty."""

    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
@final
class JointTrajectoryPoint(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectoryPoint_"):
    """Where joints shall stand, and when."""

    positions: sequence[float64]
    velocities: sequence[float64]
    accelerations: sequence[float64]
    effort: sequence[float64]
    time_from_start: Duration


@dataclass
@final
class JointTrajectory(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectory_"):
    """Points to pass; a header's stamp of zero means: start now."""

    header: Header
    joint_names: sequence[str]
    points: sequence[JointTrajectoryPoint]


_STAMP_AT = 4
_COUNTS = 8  # behind the positions: how many velocities and efforts, none each


class PackedString(String):
    """A text that is published again and again."""

    def __init__(self, data: str) -> None:
        super().__init__(data)
        self._bytes = super().serialize(use_version_2=False)

    def serialize(self, *_: Any, **__: Any) -> bytes:
        """Return the bytes."""
        return self._bytes


class PackedAngles(JointState):
    """The state of joints whose names stay the same."""

    def __init__(self, names: tuple[str, ...]) -> None:
        super().__init__(Header(Time(0, 0), ""), list(names), [0.0] * len(names), [], [])
        self.names = names
        self._bytes = bytearray(super().serialize(use_version_2=False))
        self._stamp = struct.Struct("=iI")
        self._positions = struct.Struct(f"={len(names)}d")
        self._positions_at = len(self._bytes) - _COUNTS - self._positions.size

    def set(self, unix_us: int, angles: JointAngles) -> None:
        """Take over the angles of a moment, those of the same names."""
        seconds, microseconds = divmod(unix_us, 1_000_000)
        self._stamp.pack_into(self._bytes, _STAMP_AT, seconds, microseconds * 1000)
        self._positions.pack_into(self._bytes, self._positions_at, *angles.positions_rad)

    def serialize(self, *_: Any, **__: Any) -> bytes:
        """Return the bytes."""
        return bytes(self._bytes)


def trajectory(preshape: Preshape) -> JointTrajectory:
    """Return a preshape as a trajectory of one point, to be started on arrival (a stamp of zero)."""
    seconds, rest = divmod(round(preshape.time_from_start_s * 1_000_000_000), 1_000_000_000)
    point = JointTrajectoryPoint(list(preshape.positions), [], [], [], Duration(seconds, rest))
    return JointTrajectory(Header(Time(0, 0), ""), list(preshape.joint_names), [point])
