"""The messages are ROS 2's: hashes of types, worked out anew from the .msg files, and bytes that its tools read.

The hashes are REP-2011's: SHA-256 of the type's description.
"""

import hashlib
import json
from collections.abc import Callable
from importlib import import_module
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from msgspec.structs import replace

from thenar.runtime.published import Health, LiveGrasp, Preshape

# As they stand in builtin_interfaces, std_msgs, sensor_msgs, trajectory_msgs and diagnostic_msgs, without comments and
# constants, which are no part of a type's description.
MSG = {
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/msg/Duration": "int32 sec\nuint32 nanosec",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/msg/String": "string data",
    "sensor_msgs/msg/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort"
    ),
    "trajectory_msgs/msg/JointTrajectoryPoint": (
        "float64[] positions\nfloat64[] velocities\nfloat64[] accelerations\nfloat64[] effort\n"
        "builtin_interfaces/Duration time_from_start"
    ),
    "trajectory_msgs/msg/JointTrajectory": (
        "std_msgs/Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint[] points"
    ),
    "std_msgs/msg/MultiArrayDimension": "string label\nuint32 size\nuint32 stride",
    "std_msgs/msg/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset",
    "std_msgs/msg/UInt8MultiArray": "std_msgs/MultiArrayLayout layout\nuint8[] data",
    "std_msgs/msg/Float32MultiArray": "std_msgs/MultiArrayLayout layout\nfloat32[] data",
    "diagnostic_msgs/msg/KeyValue": "string key\nstring value",
    "diagnostic_msgs/msg/DiagnosticStatus": (
        "byte level\nstring name\nstring message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values"
    ),
    "diagnostic_msgs/msg/DiagnosticArray": "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status",
}
PUBLISHED = (
    "std_msgs/msg/String",
    "sensor_msgs/msg/JointState",
    "trajectory_msgs/msg/JointTrajectory",
    "diagnostic_msgs/msg/DiagnosticArray",
    "std_msgs/msg/UInt8MultiArray",
    "std_msgs/msg/Float32MultiArray",
)
# type_description_interfaces/msg/FieldType: 48 more is an array, 144 more an unbounded sequence.
FIELD_TYPES = {"uint8": 3, "float32": 10, "int32": 6, "uint32": 7, "float64": 11, "byte": 16, "string": 17}
NESTED, SEQUENCE = 1, 144


def written(message: Any) -> bytes:
    data: bytes = message.serialize(use_version_2=False)
    return data


def described(name: str) -> dict[str, Any]:
    return {"type_name": name, "fields": [field(line) for line in MSG[name].splitlines()]}


def field(line: str) -> dict[str, Any]:
    kind, name = line.split()
    plain = kind.removesuffix("[]")
    nested = "/msg/".join(plain.split("/")) if "/" in plain else ""
    number = (NESTED if nested else FIELD_TYPES[plain]) + (SEQUENCE if kind != plain else 0)
    kinds = {"type_id": number, "capacity": 0, "string_capacity": 0, "nested_type_name": nested}
    return {"name": name, "type": kinds}


def nested_in(name: str) -> set[str]:
    inner = {one["type"]["nested_type_name"] for one in described(name)["fields"]} - {""}
    return inner.union(*(nested_in(one) for one in inner))


def rihs01(name: str) -> str:
    whole = {
        "type_description": described(name),
        "referenced_type_descriptions": [described(one) for one in sorted(nested_in(name))],
    }
    return "RIHS01_" + hashlib.sha256(json.dumps(whole).encode()).hexdigest()


def dds_name(name: str) -> str:
    package, _, kind = name.split("/")
    return f"{package}::msg::dds_::{kind}_"


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_types_hash_is_that_of_its_description(ros: ModuleType, name: str) -> None:
    assert ros.TYPE_HASHES[dds_name(name)] == rihs01(name)


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("builtin_interfaces/msg/Time", "b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197"),
        ("builtin_interfaces/msg/Duration", "e8d009f659816f758b75334ee1a9ca5b5c0b859843261f14c7f937349599d93b"),
        ("std_msgs/msg/Header", "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01"),
        (
            "trajectory_msgs/msg/JointTrajectoryPoint",
            "de8907036d8bd45aac6f30cc9044a3d4a329c42cbf719aff7d95a584cfa532d7",
        ),
        ("diagnostic_msgs/msg/KeyValue", "d68081eaa540288c5440753baecef0c4e16e81a5f78ad68902ded5100413bb42"),
        ("diagnostic_msgs/msg/DiagnosticStatus", "b0e3e692ea2d54a8af2f4ef1930e81556a2db55216b771f8a7d2724ed47bf0e4"),
        ("diagnostic_msgs/msg/DiagnosticArray", "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"),
    ],
)
def test_hashes_computed_here_are_those_of_ross_packages(name: str, known: str) -> None:
    assert rihs01(name) == f"RIHS01_{known}"


def test_every_type_has_ross_name_and_fields(ros: ModuleType) -> None:
    for name, text in MSG.items():
        kind = getattr(ros, name.rpartition("/")[2])
        assert kind.__idl_typename__ == dds_name(name)
        assert list(kind.__dataclass_fields__) == [line.split()[1] for line in text.splitlines()]


def test_a_preshape_is_a_trajectory_of_one_point_that_starts_at_once(ros: ModuleType, preshape: Preshape) -> None:
    from thenar.runtime.ros import trajectory

    point = ros.JointTrajectoryPoint([0.0, 0.5], [], [], [], ros.Duration(1, 250_000_000))
    names = ["finger_1/prox_joint", "finger_1/med_joint"]
    assert trajectory(preshape) == ros.JointTrajectory(ros.Header(ros.Time(0, 0), ""), names, [point])


def decoded(name: str, message: Any) -> SimpleNamespace:
    """Return what decoders of another hand, made from the .msg files, read: those of the MCAP tools for ROS 2."""
    dynamic = import_module("mcap_ros2._dynamic")
    inner = [f"{'=' * 80}\nMSG: {one.replace('/msg/', '/')}\n{MSG[one]}" for one in sorted(nested_in(name))]
    decoders: dict[str, Any] = dynamic.generate_dynamic(name, "\n".join([MSG[name], *inner]))
    found: SimpleNamespace = decoders[name](written(message))
    return found


def test_the_tools_of_ros_2_read_a_preshape(ros: ModuleType, preshape: Preshape) -> None:
    read = decoded("trajectory_msgs/msg/JointTrajectory", ros.trajectory(preshape))
    assert tuple(read.joint_names) == preshape.joint_names
    assert tuple(read.points[0].positions) == preshape.positions
    assert (read.points[0].time_from_start.sec, read.points[0].time_from_start.nanosec) == (1, 250_000_000)


@pytest.mark.parametrize(("health", "level"), [("ok", 0), ("changing", 0), ("degraded", 1), ("unknown", 2)])
def test_the_tools_of_ros_2_read_a_segment(
    ros: ModuleType, make_grasp: Callable[..., LiveGrasp], health: Health, level: int
) -> None:
    of_frame = make_grasp(0, "PoS", ("s001", "index_mpj"))
    grasp = replace(
        of_frame, time_us=70_000, health=health, state="held", segment=3, segment_type="PMF", segment_us=50_000
    )
    grasp = replace(grasp, segment_probability=0.25)
    read = decoded("diagnostic_msgs/msg/DiagnosticArray", ros.segment("/thenar", grasp))
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (1_700_000_000, 123_456_000)
    (status,) = read.status
    assert (status.level, status.name, status.message) == (level, "/thenar", "PoS")
    assert {pair.key: pair.value for pair in status.values} == {
        "grasp": "PoS",
        "probability": "0.937500",
        "health": health,
        "state": "held",
        "segment": "3",
        "segment_type": "PMF",
        "segment_probability": "0.250000",
        "segment_stamp": "1700000000.103456",
        "candidate": "PoS",
        "margin": "120",
        "lost": "s001, index_mpj",
    }


def test_before_the_first_segment_there_is_no_time_at_which_it_began(
    ros: ModuleType, make_grasp: Callable[..., LiveGrasp]
) -> None:
    (status,) = ros.segment("/thenar", make_grasp(0)).status
    assert {pair.key: pair.value for pair in status.values}["segment_stamp"] == ""
