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

from thenar.runtime.published import LiveGrasp, Preshape
from thenar.runtime.ros import PACKAGE, state, trajectory

# As they stand in builtin_interfaces, std_msgs, sensor_msgs, trajectory_msgs and our package, without comments and
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
    "thenar_msgs/msg/Grasp": "\n".join(
        line for line in (PACKAGE / "msg" / "Grasp.msg").read_text("utf-8").splitlines() if not line.startswith("#")
    ),
}
PUBLISHED = (
    "std_msgs/msg/String",
    "sensor_msgs/msg/JointState",
    "trajectory_msgs/msg/JointTrajectory",
    "thenar_msgs/msg/Grasp",
    "std_msgs/msg/UInt8MultiArray",
    "std_msgs/msg/Float32MultiArray",
)
# type_description_interfaces/msg/FieldType: 48 more is an array, 144 more an unbounded sequence.
FIELD_TYPES = {"uint8": 3, "float32": 10, "int32": 6, "uint32": 7, "int64": 8, "float64": 11, "string": 17}
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
    assert ros.TYPE_HASHES[name.replace("/msg/", "/")] == rihs01(name).removeprefix("RIHS01_")


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
    ],
)
def test_hashes_computed_here_are_those_of_ross_packages(name: str, known: str) -> None:
    assert rihs01(name) == f"RIHS01_{known}"


def test_every_type_has_ross_name_and_fields(ros: ModuleType) -> None:
    for name, text in MSG.items():
        kind = ros.TYPES[name.replace("/msg/", "/")]
        assert kind.__idl_typename__ == dds_name(name)
        assert list(kind.__dataclass_fields__) == [line.split()[1] for line in text.splitlines()]


def test_a_preshape_is_a_trajectory_of_one_point_that_starts_at_once(ros: ModuleType, preshape: Preshape) -> None:
    kinds = ros.TYPES
    duration = kinds["builtin_interfaces/Duration"](1, 250_000_000)
    point = kinds["trajectory_msgs/JointTrajectoryPoint"]([0.0, 0.5], [], [], [], duration)
    header = kinds["std_msgs/Header"](kinds["builtin_interfaces/Time"](0, 0), "")
    names = ["finger_1/prox_joint", "finger_1/med_joint"]
    expected = kinds["trajectory_msgs/JointTrajectory"](header, names, [point])
    assert trajectory(kinds.__getitem__, preshape) == expected


def decoded(name: str, message: Any) -> SimpleNamespace:
    """Return what decoders of another hand, made from the .msg files, read: those of the MCAP tools for ROS 2."""
    dynamic = import_module("mcap_ros2._dynamic")
    inner = [f"{'=' * 80}\nMSG: {one.replace('/msg/', '/')}\n{MSG[one]}" for one in sorted(nested_in(name))]
    decoders: dict[str, Any] = dynamic.generate_dynamic(name, "\n".join([MSG[name], *inner]))
    found: SimpleNamespace = decoders[name](written(message))
    return found


def test_the_tools_of_ros_2_read_a_preshape(ros: ModuleType, preshape: Preshape) -> None:
    read = decoded("trajectory_msgs/msg/JointTrajectory", trajectory(ros.TYPES.__getitem__, preshape))
    assert tuple(read.joint_names) == preshape.joint_names
    assert tuple(read.points[0].positions) == preshape.positions
    assert (read.points[0].time_from_start.sec, read.points[0].time_from_start.nanosec) == (1, 250_000_000)


@pytest.mark.parametrize("segment_us", [None, 50_000])
def test_the_tools_of_ros_2_read_a_grasp(
    ros: ModuleType, make_grasp: Callable[..., LiveGrasp], segment_us: int | None
) -> None:
    of_frame = make_grasp(0, "PoS", ("s001", "index_mpj"))
    grasp = replace(of_frame, time_us=70_000, state="held", segment=3, segment_type="PMF", segment_us=segment_us)
    grasp = replace(grasp, segment_probability=0.25, margin=-(2**40))
    read = decoded("thenar_msgs/msg/Grasp", state(ros.TYPES.__getitem__, grasp))
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (1_700_000_000, 123_456_000)
    began = (read.segment_stamp.sec, read.segment_stamp.nanosec)
    assert began == ((0, 0) if segment_us is None else (1_700_000_000, 103_456_000))
    for name in ("grasp", "probability", "health", "state", "segment", "segment_type", "segment_probability"):
        assert getattr(read, name) == getattr(grasp, name)
    assert (read.candidate, read.margin, tuple(read.lost)) == (grasp.candidate, -(2**40), grasp.lost)
