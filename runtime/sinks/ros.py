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

from collections.abc import Callable
from typing import Any

from msgspec import json

from thenar.drivers.errors import DeviceError

from .. import ros
from ..published import HealthReport, JointAngles, LiveGrasp, Preshape
from .base import Sink, SinkError, SinkKind

_RATE_HZ = 20
_STRING, _GRASP = "std_msgs/String", "thenar_msgs/Grasp"
_TRAJECTORY, _JOINTS = "trajectory_msgs/JointTrajectory", "sensor_msgs/JointState"


class RosTopics(Sink):
    """Publishes under a namespace of ROS. Messages that ROS refuses are counted as lost in the report."""

    def __init__(self, name: str = "/thenar", *, public: bool = False) -> None:
        """Publish under `name` to this machine, or also to others if `public`.

        Raise SettingError for an invalid name or domain, SinkError if ROS does not start.
        """
        self.where = f"ros:{ros.namespace(name)}" + "?public" * public
        try:
            self._node = ros.open_node(self.where, public=public)
        except DeviceError as reason:
            raise SinkError(f"{self.where} cannot be opened {reason}") from None
        self._kind = self._node.kind
        self._grasp = self._node.writer(f"{name}/grasp", _STRING, kept=True)
        self._state = self._node.writer(f"{name}/state", _GRASP, kept=True)
        self._preshape = self._node.writer(f"{name}/preshape", _TRAJECTORY, kept=True)
        self._angles = self._node.writer(f"{name}/angles", _JOINTS)
        self._health = self._node.writer(f"{name}/health", _STRING)
        self._closed = False
        self._told: Preshape | None = None

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Publish everything, but the preshape only if it changed."""
        self._write(lambda: self._publish(grasp, preshape, angles))

    def health(self, report: HealthReport) -> None:
        """Publish the glove's health."""
        self._write(lambda: self._health(self._text(json.encode(report).decode())))

    def _write(self, write: Callable[[], object]) -> None:
        if self._closed:
            self.lost += 1
        else:
            self.attempt(write)

    def _publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        self._grasp(self._text(grasp.grasp))
        self._state(ros.state(self._kind, grasp))
        if angles is not None:
            self._angles(ros.joint_state(self._kind, grasp.unix_us, angles))
        if preshape is not None and preshape != self._told:
            self._preshape(ros.trajectory(self._kind, preshape))
            self._told = preshape

    def _text(self, text: str) -> Any:
        return self._kind(_STRING)(data=text)

    def readers(self) -> int:
        """Return the number of readers of the grasp type."""
        return 0 if self._closed else self._node.readers()

    def close(self) -> None:
        """Leave the domain."""
        if not self._closed:
            self._closed = True
            # What a topic is written by ends with its last name, before its node.
            del self._grasp, self._state, self._preshape, self._angles, self._health
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
