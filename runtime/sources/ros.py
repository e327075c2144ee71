"""Topics of ROS 2 as rows, by rclpy where ROS is installed, by Eclipse Cyclone DDS otherwise (extra `ros`).

    ros:/TOPIC                         sensor_msgs/JointState: columns are the names of the joints, by their positions
    ros:/TOPIC?type=UInt8MultiArray    std_msgs: columns in the order of `columns`
    ros:/TOPIC?type=Float32MultiArray  the same

A JointState's stamp is the sender's clock, unless it is zero. Nodes of this machine are received, others if
CYCLONEDDS_URI or `&public` allows them; ROS_DOMAIN_ID sets the domain. By Cyclone DDS, messages of a second publisher
are left out; rclpy does not say who sent one.
"""

import platform
import re
from collections.abc import Hashable, Iterator, Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from thenar.drivers.errors import DeviceError, SettingError
from thenar.drivers.extras import optional
from thenar.drivers.lines import LineCounts, Row, RowReader, finite
from thenar.drivers.names import shortened
from thenar.drivers.senders import FirstSender

from .. import ros
from ..frames import now_us
from .rows import row_kind

if TYPE_CHECKING:
    from ..ros_dds import DdsNode
    from ..ros_rclpy import RclpyNode

    Node = DdsNode | RclpyNode

_JOINTS = "JointState"
_ARRAYS = ("UInt8MultiArray", "Float32MultiArray")
_TYPES = {_JOINTS: f"sensor_msgs/{_JOINTS}"} | {name: f"std_msgs/{name}" for name in _ARRAYS}
_PORT = re.compile(rf"ros:(/[^?]*)(?:\?(?:type=({'|'.join(_TYPES)})&?)?(public)?)?")
_NO_WHEEL = (
    "cyclonedds has no wheel for aarch64: install ROS 2 (on Ubuntu 24.04: apt install ros-jazzy-ros-base), source its "
    "setup.bash, and make the venv with --system-site-packages; or send grasps by mqtt: to a computer with ROS"
)


def open_node(where: str, *, public: bool) -> "Node":
    """Return a node in the domain of ROS_DOMAIN_ID. Raises SettingError if neither rclpy nor Cyclone DDS is installed,
    DeviceError if it cannot start.
    """
    number = ros.domain()
    if find_spec("rclpy") is not None:
        from ..ros_rclpy import RclpyNode

        return RclpyNode(number, public=public)
    if find_spec("cyclonedds") is None and platform.machine() == "aarch64":
        raise SettingError(f"{where}: {_NO_WHEEL}")
    with optional(SettingError, where):
        from ..ros_dds import DdsNode
    return DdsNode(number, public=public)


class RosReader(RowReader):
    """Rows of the messages of a topic. Its constructor opens nothing."""

    def __init__(self, port: str) -> None:
        self._port, self._counts = port, LineCounts()
        found = _PORT.fullmatch(port)
        self.kind = "joint" if found and (found[2] or _JOINTS) == _JOINTS else ""
        self._node: Node | None = None
        self._read: ros.Read = lambda _timeout_s: []
        self._senders = FirstSender()

    def open(self) -> None:
        """Subscribe to the topic, which may not have a publisher yet."""
        found = _PORT.fullmatch(self._port)
        if found is None:
            ways = f"ros:/TOPIC, optionally followed by ?type= one of {', '.join(_TYPES)}, or ?public"
            raise SettingError(f"{shortened(repr(self._port))} names no topic: write {ways}")
        self._senders, name = FirstSender(), ros.namespace(found[1])
        try:
            self._node = open_node(self._port, public=bool(found[3]))
            self._read = self._node.reader(name, _TYPES[found[2] or _JOINTS])
        except DeviceError as reason:
            raise DeviceError(f"{self._port} cannot be opened {reason}") from None

    def read(self, timeout_s: float) -> Sequence[Row]:
        """Return the rows of the messages that arrived."""
        try:
            return list(self._rows(self._read(timeout_s)))
        except DeviceError as reason:
            raise DeviceError(f"{self._port}: {reason}") from None

    def _rows(self, messages: Sequence[tuple[Any, Hashable]]) -> Iterator[Row]:
        time_us = now_us()
        # It was not silent, wherever its messages are among those that waited.
        if any(sender == self._senders.current for _, sender in messages):
            self._senders.admits(self._senders.current, time_us)
        for sample, sender in messages:
            if not self._senders.admits(sender, time_us):
                self._counts.foreign += 1
                continue
            if hasattr(sample, "position"):
                names, stamp = tuple(sample.name), sample.header.stamp
                if not names or len(names) != len(sample.position) or len(set(names)) < len(names):
                    self._counts.misfits += 1
                    self.odd = f"a JointState of {len(names)} names and {len(sample.position)} positions"
                    continue
                time_s = stamp.sec + stamp.nanosec / 1e9 if stamp.sec or stamp.nanosec else None
                yield Row(names, tuple(map(finite, sample.position)), time_s)
            else:
                yield Row(None, tuple(finite(float(value)) for value in sample.data))

    def counts(self) -> LineCounts:
        """Return the number of messages that were not rows."""
        return self._counts

    def other_sender(self) -> str:
        """Return a sentence on another publisher."""
        if self._senders.other(now_us()) is None:
            return ""
        return "another publisher sends on this topic, too, and its messages are left out: stop it, or rename its topic"

    def close(self) -> None:
        """Leave the domain."""
        if self._node is not None:
            self._node.close()
            self._node = None


MEMBER = row_kind("ros", lambda wiring: RosReader(wiring.port), 5)
