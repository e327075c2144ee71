"""ROS 2 by rclpy, which comes with a ROS installation."""

import os
from collections import deque
from collections.abc import Callable, Hashable
from importlib import import_module
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from thenar.drivers.errors import SettingError

from .ros import DEPTH, PACKAGE, READ_DEPTH, Node


class RclpyNode(Node):
    """The node "thenar" of a separate context, in ROS's domain `number`. It does not know who sent a message."""

    def __init__(self, number: int, *, public: bool) -> None:
        if not public:
            # Read by ROS when a context begins; Humble has another name for it.
            humble = os.environ.get("ROS_DISTRO") == "humble"
            name, here = ("ROS_LOCALHOST_ONLY", "1") if humble else ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
            os.environ.setdefault(name, here)
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, domain_id=number)
        self._node = rclpy.create_node("thenar", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._topics: list[str] = []
        self._came = deque[Any](maxlen=READ_DEPTH)

    def kind(self, name: str) -> Any:
        """Return the type. Raises SettingError if its package is not built."""
        package, _, kind = name.partition("/")
        try:
            return getattr(import_module(f"{package}.msg"), kind)
        except ModuleNotFoundError:
            raise SettingError(
                f"ROS has no package {package}: install it; thenar_msgs comes as {PACKAGE}: copy that into the src "
                "folder of a ROS workspace, run colcon build, and source install/setup.bash"
            ) from None

    def writer(self, topic: str, kind: str, *, kept: bool = False) -> Callable[[Any], object]:
        """Return what publishes messages of this type."""
        durability = DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE
        made = self._node.create_publisher(self.kind(kind), topic, QoSProfile(depth=DEPTH, durability=durability))
        self._topics.append(topic)
        return made.publish  # type: ignore[no-any-return]

    def readers(self) -> int:
        """Return the number of readers of the first topic that is written."""
        return self._node.count_subscribers(self._topics[0]) if self._topics else 0

    def subscribe(self, topic: str, kind: str) -> None:
        """Let `read` return the messages of a topic."""
        profile = QoSProfile(depth=READ_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._node.create_subscription(self.kind(kind), topic, self._came.append, profile)

    def read(self, timeout_s: float) -> list[tuple[Any, Hashable]]:
        """Return the messages that came."""
        self._executor.spin_once(timeout_sec=timeout_s)
        came: list[tuple[Any, Hashable]] = [(message, None) for message in self._came]
        self._came.clear()
        return came

    def close(self) -> None:
        """End the node and its context."""
        if self._context.ok():
            self._topics.clear()
            self._executor.shutdown()
            self._node.destroy_node()
            rclpy.shutdown(context=self._context)
