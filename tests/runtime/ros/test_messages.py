"""The messages are ROS 2's: names, fields and hashes are those of its packages, as rosbags has them, which also reads
their bytes.
"""

from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest
from msgspec.structs import replace

from thenar.runtime.published import LiveGrasp
from thenar.runtime.ros import state

from .ros_types import STORE

PUBLISHED = {
    *("std_msgs/String", "sensor_msgs/JointState", "trajectory_msgs/JointTrajectory", "thenar_msgs/Grasp"),
    *("std_msgs/UInt8MultiArray", "std_msgs/Float32MultiArray"),
}


def full(name: str) -> str:
    return name.replace("/", "/msg/")


def test_a_types_hash_is_that_of_its_description(ros: ModuleType) -> None:
    assert ros.TYPE_HASHES.keys() == PUBLISHED
    for name, type_hash in ros.TYPE_HASHES.items():
        assert STORE.hash_rihs01(full(name)) == f"RIHS01_{type_hash}"


def test_every_type_has_ross_name_and_fields(ros: ModuleType) -> None:
    assert ros.TYPES.keys() > PUBLISHED
    for name, kind in ros.TYPES.items():
        assert kind.__idl_typename__ == name.replace("/", "::msg::dds_::") + "_"
        assert list(kind.__dataclass_fields__) == [field for field, _ in STORE.fielddefs[full(name)][1]]


def decoded(name: str, message: Any) -> Any:
    """Return what another decoder reads of a message, as it is sent: in plain CDR."""
    return STORE.deserialize_cdr(message.serialize(use_version_2=False), full(name))


@pytest.mark.parametrize("segment_us", [None, 50_000])
def test_the_tools_of_ros_2_read_a_grasp(
    ros: ModuleType, make_grasp: Callable[..., LiveGrasp], segment_us: int | None
) -> None:
    of_frame = make_grasp(0, "PoS", ("s001", "index_mpj"))
    grasp = replace(of_frame, time_us=70_000, state="held", segment=3, segment_type="PMF", segment_us=segment_us)
    grasp = replace(grasp, segment_probability=0.25, margin=-(2**40))
    read = decoded("thenar_msgs/Grasp", state(ros.TYPES.__getitem__, grasp))
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (1_700_000_000, 123_456_000)
    began = (read.segment_stamp.sec, read.segment_stamp.nanosec)
    assert began == ((0, 0) if segment_us is None else (1_700_000_000, 103_456_000))
    for name in ("grasp", "probability", "health", "state", "segment", "segment_type", "segment_probability"):
        assert getattr(read, name) == getattr(grasp, name)
    assert (read.candidate, read.margin, tuple(read.lost)) == (grasp.candidate, -(2**40), grasp.lost)
