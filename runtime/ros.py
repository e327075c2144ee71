"""ROS 2: names, messages of grasps, and what its two kinds of node do: of rclpy, and of Cyclone DDS.

A node writes and reads on this machine only, unless it is public. Both kinds have the same topics and types, and the
same methods, which raise DeviceError for what fails:

    kind    the type of messages such as std_msgs/String; its fields are keywords of its constructor
    writer  a function that writes a message to a topic: reliably, with the last 10 kept, and volatile unless the newest
            is `kept` for late readers (transient local)
    reader  a function that waits at most some seconds for messages of a topic, from reliable and best-effort writers,
            and returns them with who sent each, as far as that is known
    close   ends the node; may be called twice

`thenar_msgs` is a package of ROS next to this file: who uses rclpy, or listens with ROS's tools, has to build it.
"""

import os
import re
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any

from thenar.drivers.errors import SettingError

from .published import JointAngles, LiveGrasp, Preshape

# Histories: of a topic that is written, and of one that is read, for the time that a thread may be late.
DEPTH, READ_DEPTH = 10, 256
PACKAGE = Path(__file__).with_name("thenar_msgs")
_MAX_DOMAIN = 232  # above it the ports of DDS would pass 65535
_MAX_LENGTH = 200
Kind = Callable[[str], Any]
Read = Callable[[float], list[tuple[Any, Hashable]]]


def namespace(name: str) -> str:
    """Return `name` if it is a valid namespace for topics, as "/thenar" or "/lab/left_hand". Raises SettingError."""
    fits = re.fullmatch(r"(?:/[A-Za-z][A-Za-z0-9_]*)+", name) and "__" not in name and len(name) <= _MAX_LENGTH
    if not fits:
        raise SettingError(f"ros:{name} is not a ROS name: write it as ros:/thenar, with letters, digits and single _")
    return name


def domain() -> int:
    """Return the domain that the environment variable ROS_DOMAIN_ID names, or 0. Raises SettingError."""
    text = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not text.isdecimal() or int(text) > _MAX_DOMAIN:
        raise SettingError(f"ROS_DOMAIN_ID is {text!r}: set it to a whole number from 0 to {_MAX_DOMAIN}, or unset it")
    return int(text)


def state(kind: Kind, grasp: LiveGrasp) -> Any:
    """Return a prediction as thenar_msgs/Grasp, stamped with its moment."""
    began_us = 0 if grasp.segment_us is None else grasp.unix_us - grasp.time_us + grasp.segment_us
    same = ("grasp", "probability", "health", "state", "segment", "segment_type", "segment_probability")
    values = {name: getattr(grasp, name) for name in (*same, "candidate", "margin")}
    header, began = _header(kind, grasp.unix_us), _time(kind, began_us)
    return kind("thenar_msgs/Grasp")(header=header, segment_stamp=began, lost=list(grasp.lost), **values)


def joint_state(kind: Kind, unix_us: int, angles: JointAngles) -> Any:
    """Return the glove's joints at a moment, as sensor_msgs/JointState."""
    positions = list(angles.positions_rad)
    return kind("sensor_msgs/JointState")(
        header=_header(kind, unix_us), name=list(angles.names), position=positions, velocity=[], effort=[]
    )


def trajectory(kind: Kind, preshape: Preshape) -> Any:
    """Return a preshape as a trajectory of one point, to be started on arrival (a stamp of zero)."""
    seconds, rest = divmod(round(preshape.time_from_start_s * 1_000_000_000), 1_000_000_000)
    point = kind("trajectory_msgs/JointTrajectoryPoint")(
        positions=list(preshape.positions),
        velocities=[],
        accelerations=[],
        effort=[],
        time_from_start=kind("builtin_interfaces/Duration")(sec=seconds, nanosec=rest),
    )
    return kind("trajectory_msgs/JointTrajectory")(
        header=_header(kind, 0), joint_names=list(preshape.joint_names), points=[point]
    )


def _header(kind: Kind, unix_us: int) -> Any:
    return kind("std_msgs/Header")(stamp=_time(kind, unix_us), frame_id="")


def _time(kind: Kind, unix_us: int) -> Any:
    seconds, microseconds = divmod(unix_us, 1_000_000)
    return kind("builtin_interfaces/Time")(sec=seconds, nanosec=microseconds * 1000)
