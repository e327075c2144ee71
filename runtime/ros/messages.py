"""The published ROS 2 messages as DDS types, with the names and the layout that ROS 2 uses.

std_msgs/String, sensor_msgs/JointState, trajectory_msgs/JointTrajectory and diagnostic_msgs/DiagnosticArray, field by
field as in their .msg files; a type pkg/msg/Name is pkg::msg::dds_::Name_ in DDS. They are final and keyless, and are
sent as plain CDR (XCDR1), as rmw_cyclonedds and rmw_fastrtps send theirs. Needs the extra `ros`.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import byte, float32, float64, int32, uint8, uint32

if TYPE_CHECKING:
    from collections.abc import Sequence as sequence  # noqa: N813 - Cyclone's says nothing to a type checker
else:
    from cyclonedds.idl.types import sequence

from ..preshape.selector import Preshape
from ..published import Health, JointAngles, LiveGrasp

# REP-2011: ROS 2 from Iron on expects it in the endpoint's user data, and warns if it is missing.
TYPE_HASHES = {
    "std_msgs::msg::dds_::String_": "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "sensor_msgs::msg::dds_::JointState_": "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "trajectory_msgs::msg::dds_::JointTrajectory_": (
        "RIHS01_179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e"
    ),
    "diagnostic_msgs::msg::dds_::DiagnosticArray_": (
        "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"
    ),
    "std_msgs::msg::dds_::UInt8MultiArray_": (
        "RIHS01_5687e861b8d307a5e48b7515467ae7a5fc2daf805bd0ce6d8e9e604bade9f385"
    ),
    "std_msgs::msg::dds_::Float32MultiArray_": (
        "RIHS01_0599f6f85b4bfca379873a0b4375a0aca022156bd2d7021275d116ed1fa8bfe0"
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
class MultiArrayDimension(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayDimension_"):
    """A dimension of an array."""

    label: str
    size: uint32
    stride: uint32


@dataclass
@final
class MultiArrayLayout(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayLayout_"):
    """How an array lies in its data."""

    dim: sequence[MultiArrayDimension]
    data_offset: uint32


@dataclass
@final
class UInt8MultiArray(IdlStruct, typename="std_msgs::msg::dds_::UInt8MultiArray_"):
    """Bytes."""

    layout: MultiArrayLayout
    data: sequence[uint8]


@dataclass
@final
class Float32MultiArray(IdlStruct, typename="std_msgs::msg::dds_::Float32MultiArray_"):
    """Numbers."""

    layout: MultiArrayLayout
    data: sequence[float32]


@dataclass
@final
class JointTrajectoryPoint(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectoryPoint_"):
    """Joint positions, and the time to reach them."""

    positions: sequence[float64]
    velocities: sequence[float64]
    accelerations: sequence[float64]
    effort: sequence[float64]
    time_from_start: Duration


@dataclass
@final
class JointTrajectory(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectory_"):
    """Points to pass; a stamp of zero in the header means: start now."""

    header: Header
    joint_names: sequence[str]
    points: sequence[JointTrajectoryPoint]


@dataclass
@final
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    """A value and its key."""

    key: str
    value: str


@dataclass
@final
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    """The state of a component: level 0 is fine, 1 a warning, 2 an error."""

    level: byte
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
@final
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    """The states of components."""

    header: Header
    status: sequence[DiagnosticStatus]


LEVELS: dict[Health, int] = {"ok": 0, "changing": 0, "degraded": 1, "unknown": 2}


def segment(name: str, grasp: LiveGrasp) -> DiagnosticArray:
    """Return the prediction as the status of component `name`, stamped with its moment."""
    began_us = None if grasp.segment_us is None else grasp.unix_us - grasp.time_us + grasp.segment_us
    values = {
        "grasp": grasp.grasp,
        "probability": f"{grasp.probability:.6f}",
        "health": grasp.health,
        "state": grasp.state,
        "segment": str(grasp.segment),
        "segment_type": grasp.segment_type,
        "segment_probability": f"{grasp.segment_probability:.6f}",
        "segment_stamp": "" if began_us is None else f"{began_us / 1e6:.6f}",
        "candidate": grasp.candidate,
        "margin": str(grasp.margin),
        "lost": ", ".join(grasp.lost),
    }
    return _diagnosed(grasp.unix_us, LEVELS[grasp.health], name, grasp.grasp, values)


def _diagnosed(unix_us: int, level: int, name: str, message: str, values: dict[str, str]) -> DiagnosticArray:
    pairs = [KeyValue(key, value) for key, value in values.items()]
    return DiagnosticArray(_header(unix_us), [DiagnosticStatus(level, name, message, "", pairs)])


def joint_state(unix_us: int, angles: JointAngles) -> JointState:
    """Return the glove's joints at a moment."""
    return JointState(_header(unix_us), list(angles.names), list(angles.positions_rad), [], [])


def _header(unix_us: int) -> Header:
    seconds, microseconds = divmod(unix_us, 1_000_000)
    return Header(Time(seconds, microseconds * 1000), "")


def trajectory(preshape: Preshape) -> JointTrajectory:
    """Return a preshape as a trajectory of one point, to be started on arrival (a stamp of zero)."""
    seconds, rest = divmod(round(preshape.time_from_start_s * 1_000_000_000), 1_000_000_000)
    point = JointTrajectoryPoint(list(preshape.positions), [], [], [], Duration(seconds, rest))
    return JointTrajectory(Header(Time(0, 0), ""), list(preshape.joint_names), [point])
