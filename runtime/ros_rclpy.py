"""ROS 2 by rclpy, which comes with a ROS installation."""

import os
from collections.abc import Callable, Hashable
from importlib import import_module
from typing import Any

from thenar.drivers.errors import DeviceError, SettingError

from .ros import DEPTH, PACKAGE, READ_DEPTH, Read


class RclpyNode:
    """The node "thenar" of a separate context, in ROS's domain `number`. It does not know who sent a message."""

    def __init__(self, number: int, *, public: bool) -> None:
        # With ROS comes a package that no extra installs.
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        if not public:
            # Read by ROS when a context begins; Humble has another name for it.
            humble = os.environ.get("ROS_DISTRO") == "humble"
            name, here = ("ROS_LOCALHOST_ONLY", "1") if humble else ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
            os.environ.setdefault(name, here)
        self._rclpy, self._context = rclpy, rclpy.Context()
        try:
            rclpy.init(args=[], context=self._context, domain_id=number)
            self._node = rclpy.create_node("thenar", context=self._context)
        except Exception as reason:  # of many kinds
            raise DeviceError(f"in domain {number}: {reason}") from None
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

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
        """Return a function that publishes messages of this type."""
        from rclpy.qos import DurabilityPolicy, QoSProfile

        durability = DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE
        profile = QoSProfile(depth=DEPTH, durability=durability)
        return self._node.create_publisher(self.kind(kind), topic, profile).publish  # type: ignore[no-any-return]

    def reader(self, topic: str, kind: str) -> Read:
        """Return a function that reads messages of this type."""
        from rclpy.qos import QoSProfile, ReliabilityPolicy

        came, profile = list[Any](), QoSProfile(depth=READ_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._node.create_subscription(self.kind(kind), topic, came.append, profile)

        def read(timeout_s: float) -> list[tuple[Any, Hashable]]:
            came.clear()
            self._executor.spin_once(timeout_sec=timeout_s)
            return [(message, None) for message in came]

        return read

    def close(self) -> None:
        """End the node and its context."""
        if self._context.ok():
            self._executor.shutdown()
            self._node.destroy_node()
            self._rclpy.shutdown(context=self._context)
