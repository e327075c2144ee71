"""A process that listens to ROS 2 topics, and knows their types from ROS, not from thenar.

Run as `python ros_listener.py NAMESPACE KIND DOMAIN`: one JSON line a sample, and one a writer that is found. Of KIND
"kept" it asks for what was published before it came.
"""

import json
import sys
from dataclasses import asdict
from importlib import import_module
from typing import Any

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import ReadCondition, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

kind_of = import_module("ros_types").kind_of
KEPT = ("grasp", "state", "preshape")
ANY = 0xFFFFFFFF  # samples, views and instances of all states
TYPES: dict[str, Any] = {
    "grasp": kind_of("std_msgs/String"),
    "state": kind_of("thenar_msgs/Grasp"),
    "preshape": kind_of("trajectory_msgs/JointTrajectory"),
    "angles": kind_of("sensor_msgs/JointState"),
    "health": kind_of("std_msgs/String"),
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
