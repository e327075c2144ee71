"""A process that publishes ROS 2 messages, and knows their types from ROS, not from thenar.

Run as `python ros_talker.py TOPIC KIND DOMAIN`: a message whenever a line comes in, and what is in it says the line.
"""

import json
import sys
from importlib import import_module
from typing import Any

from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.topic import Topic

kind_of = import_module("ros_types").kind_of


def main(topic: str, kind: str, domain: int) -> None:
    participant = DomainParticipant(domain)
    qos = Qos(
        Policy.Reliability.Reliable(max_blocking_time=0),
        Policy.History.KeepLast(10),
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
    )
    message = kind_of(f"sensor_msgs/{kind}" if kind == "JointState" else f"std_msgs/{kind}")
    writer: Any = DataWriter(participant, Topic(participant, f"rt{topic}", message), qos=qos)
    print("ready", flush=True)
    for line in sys.stdin:
        values = json.loads(line)
        if kind == "JointState":
            header = kind_of("std_msgs/Header")(kind_of("builtin_interfaces/Time")(*values["stamp"]), "")
            writer.write(message(header, values["name"], values["position"], [], []))
        else:
            writer.write(message(kind_of("std_msgs/MultiArrayLayout")([], 0), values))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
