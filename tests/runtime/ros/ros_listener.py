"""A process that listens to ROS 2 topics, and knows their types from ROS's .msg files, not from thenar.

Run as `python ros_listener.py NAMESPACE KIND DOMAIN`: one JSON line a sample, and one a writer that is found. Of KIND
"kept" it asks for what was published before it came.
"""

import json
import sys
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import ReadCondition, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, int64, uint32
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

if TYPE_CHECKING:
    from collections.abc import Sequence as sequence  # noqa: N813
else:
    from cyclonedds.idl.types import sequence

KEPT = ("grasp", "state", "preshape")
ANY = 0xFFFFFFFF  # samples, views and instances of all states


@dataclass
class BuiltinInterfacesTime(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class BuiltinInterfacesDuration(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    sec: int32
    nanosec: uint32


@dataclass
class StdMsgsHeader(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: BuiltinInterfacesTime
    frame_id: str


@dataclass
class StdMsgsString(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str


@dataclass
class SensorMsgsJointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: StdMsgsHeader
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class TrajectoryMsgsJointTrajectoryPoint(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectoryPoint_"):
    positions: sequence[float64]
    velocities: sequence[float64]
    accelerations: sequence[float64]
    effort: sequence[float64]
    time_from_start: BuiltinInterfacesDuration


@dataclass
class TrajectoryMsgsJointTrajectory(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectory_"):
    header: StdMsgsHeader
    joint_names: sequence[str]
    points: sequence[TrajectoryMsgsJointTrajectoryPoint]


@dataclass
class ThenarMsgsGrasp(IdlStruct, typename="thenar_msgs::msg::dds_::Grasp_"):
    header: StdMsgsHeader
    grasp: str
    probability: float64
    health: str
    state: str
    segment: uint32
    segment_type: str
    segment_probability: float64
    segment_stamp: BuiltinInterfacesTime
    candidate: str
    margin: int64
    lost: sequence[str]


TYPES: dict[str, Any] = {
    "grasp": StdMsgsString,
    "state": ThenarMsgsGrasp,
    "preshape": TrajectoryMsgsJointTrajectory,
    "angles": SensorMsgsJointState,
    "health": StdMsgsString,
}


def say(**what: Any) -> None:
    print(json.dumps(what), flush=True)


def say_sample(name: str, sample: Any) -> None:
    say(topic=name, message=asdict(sample))


def say_writer(found: Any) -> None:
    user_data = found.qos[Policy.Userdata]
    durability = str(found.qos[Policy.Durability])
    say(
        found=found.topic_name,
        type=found.type_name,
        user_data=user_data.data.decode() if user_data else "",
        reliability=str(found.qos[Policy.Reliability]).partition("(")[0],
        durability=durability,
    )


def main(namespace: str, kind: str, domain: int) -> None:
    participant = DomainParticipant(domain)
    reliable = Policy.Reliability.Reliable(max_blocking_time=0)
    qos = Qos(
        Policy.Reliability.BestEffort if kind == "best effort" else reliable,
        Policy.Durability.Volatile,
        Policy.History.KeepLast(100),
        Policy.DataRepresentation(
            use_cdrv0_representation=True, use_xcdrv2_representation=False
        ),  # all that ROS 2 reads
    )
    writers: Any = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
    later = Qos(*(one for one in qos if one != Policy.Durability.Volatile), Policy.Durability.TransientLocal)
    asked = {name: later if kind == "kept" and name in KEPT else qos for name in TYPES}
    readers: dict[str, Any] = {
        name: DataReader(participant, Topic(participant, f"rt{namespace}/{name}", type_), qos=asked[name])
        for name, type_ in TYPES.items()
    }
    waiting = WaitSet(participant)
    for reader in (writers, *readers.values()):
        waiting.attach(ReadCondition(reader, ANY))
    say(ready=True)
    while True:
        waiting.wait(timeout=10_000_000_000)
        for found in writers.take(N=10):
            if found.topic_name.startswith("rt/"):
                say_writer(found)
        for name, reader in readers.items():
            for sample in reader.take(N=100):
                say_sample(name, sample)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
