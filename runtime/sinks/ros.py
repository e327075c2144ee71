"""Topics of ROS 2, by rclpy where ROS is installed, by Eclipse Cyclone DDS otherwise (extra `ros`).

    NAMESPACE/grasp     std_msgs/String                  the grasp type, "unknown" and "none" included
    NAMESPACE/state     thenar_msgs/Grasp                the same with its stamp, probability, state, segment and health
    NAMESPACE/preshape  trajectory_msgs/JointTrajectory  when it changes
    NAMESPACE/angles    sensor_msgs/JointState           the glove's calibrated joints, in rad
    NAMESPACE/health    std_msgs/String                  once a second, if requested: the glove's health, as JSON

Grasp, state and angles are published on change and 20 times a second, unless the sink's options set another pace.
Reliable, with the last 10 kept, which serves reliable and best-effort readers alike. Grasp, state and preshape
are transient local: late readers get the newest at once. Nodes of this machine can read, others if `?public` or the
settings of ROS or Cyclone DDS (CYCLONEDDS_URI) allow them; ROS_DOMAIN_ID sets the domain, as for any node.
"""

from typing import Any

from msgspec import json

from thenar.drivers.errors import DeviceError

from .. import ros
from ..published import HealthReport, JointAngles, LiveGrasp, Preshape
from ..sources.ros import open_node
from .base import Sink, SinkError, SinkKind

_RATE_HZ = 20
_TOPICS = {
    "grasp": "std_msgs/String",
    "state": "thenar_msgs/Grasp",
    "preshape": "trajectory_msgs/JointTrajectory",
    "angles": "sensor_msgs/JointState",
    "health": "std_msgs/String",
}
_KEPT = ("grasp", "state", "preshape")


class RosTopics(Sink):
    """Publishes under a namespace of ROS. Messages that ROS refuses are counted as lost in the report."""

    def __init__(self, name: str = "/thenar", *, public: bool = False) -> None:
        """Publish under `name` to this machine, or also to others if `public`.

        Raise SettingError for an invalid name or domain, SinkError if ROS does not start.
        """
        self.where = f"ros:{ros.namespace(name)}" + "?public" * public
        try:
            self._node = node = open_node(self.where, public=public)
            self._writers = {
                topic: node.writer(f"{name}/{topic}", kind, kept=topic in _KEPT) for topic, kind in _TOPICS.items()
            }
        except DeviceError as reason:
            raise SinkError(f"{self.where} cannot be opened {reason}") from None
        self._told: Preshape | None = None

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Publish everything, but the preshape only if it changed."""
        kind = self._node.kind
        messages = {"grasp": kind("std_msgs/String")(data=grasp.grasp), "state": ros.state(kind, grasp)}
        if angles is not None:
            messages["angles"] = ros.joint_state(kind, grasp.unix_us, angles)
        if preshape is not None and preshape != self._told:
            messages["preshape"] = ros.trajectory(kind, preshape)
            self._told = preshape
        self.attempt(lambda: self._write(messages))

    def health(self, report: HealthReport) -> None:
        """Publish the glove's health."""
        message = self._node.kind("std_msgs/String")(data=json.encode(report).decode())
        self.attempt(lambda: self._write({"health": message}))

    def _write(self, messages: dict[str, Any]) -> None:
        if not self._writers:
            raise DeviceError("the node has ended")
        for topic, message in messages.items():
            self._writers[topic](message)

    def close(self) -> None:
        """Leave the domain."""
        # What a topic is written by ends with its last name, before its node.
        self._writers.clear()
        self._node.close()


MEMBER = SinkKind(
    "ros",
    "/NAMESPACE",
    "topics of ROS 2 on this machine; with public also for others",
    lambda where: RosTopics(where.place, public="public" in where.options),
    ("public",),
    _RATE_HZ,
    rank=4,
)
