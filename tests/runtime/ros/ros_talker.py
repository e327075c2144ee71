"""A process that publishes ROS 2 messages, and knows their types from ROS's .msg files, not from thenar.

Run as `python ros_talker.py TOPIC KIND DOMAIN`: a message whenever a line comes in, and what is in it says the line.
"""

import json
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float32, float64, int32, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.topic import Topic

if TYPE_CHECKING:
    from collections.abc import Sequence as sequence  # noqa: N813
else:
    from cyclonedds.idl.types import sequence


@dataclass
class BuiltinInterfacesTime(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class StdMsgsHeader(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: BuiltinInterfacesTime
    frame_id: str


@dataclass
class SensorMsgsJointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: StdMsgsHeader
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class StdMsgsMultiArrayDimension(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayDimension_"):
    label: str
    size: uint32
    stride: uint32


@dataclass
class StdMsgsMultiArrayLayout(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayLayout_"):
    dim: sequence[StdMsgsMultiArrayDimension]
    data_offset: uint32


@dataclass
class StdMsgsUInt8MultiArray(IdlStruct, typename="std_msgs::msg::dds_::UInt8MultiArray_"):
    layout: StdMsgsMultiArrayLayout
    data: sequence[uint8]


@dataclass
class StdMsgsFloat32MultiArray(IdlStruct, typename="std_msgs::msg::dds_::Float32MultiArray_"):
    layout: StdMsgsMultiArrayLayout
    data: sequence[float32]


KINDS: dict[str, Any] = {
    "JointState": SensorMsgsJointState,
    "UInt8MultiArray": StdMsgsUInt8MultiArray,
    "Float32MultiArray": StdMsgsFloat32MultiArray,
}


def main(topic: str, kind: str, domain: int) -> None:
    participant = DomainParticipant(domain)
    qos = Qos(
        Policy.Reliability.Reliable(max_blocking_time=0),
        Policy.History.KeepLast(10),
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
    )
    writer: Any = DataWriter(participant, Topic(participant, f"rt{topic}", KINDS[kind]), qos=qos)
    print("ready", flush=True)
    for line in sys.stdin:
        values = json.loads(line)
        if kind == "JointState":
            header = StdMsgsHeader(BuiltinInterfacesTime(*values["stamp"]), "")
            writer.write(SensorMsgsJointState(header, values["name"], values["position"], [], []))
        else:
            writer.write(KINDS[kind](StdMsgsMultiArrayLayout([], 0), values))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
