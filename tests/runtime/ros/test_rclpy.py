"""Which way leads to ROS: rclpy where it is there. A stand-in for it, since ROS cannot be installed by pip."""

import os
import platform
import sys
from collections.abc import Callable, Iterator
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import pytest

from thenar.drivers.errors import SettingError
from thenar.runtime.published import JointAngles, LiveGrasp, Preshape
from thenar.runtime.ros import PACKAGE
from thenar.runtime.sinks import open_sink
from thenar.runtime.sources import ros as nodes
from thenar.runtime.sources.ros import RosReader

PACKAGES = ("std_msgs", "builtin_interfaces", "sensor_msgs", "trajectory_msgs")
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"


class Messages(ModuleType):
    def __getattr__(self, kind: str) -> Callable[..., Any]:
        if kind.startswith("__"):
            raise AttributeError(kind)
        return lambda **fields: SimpleNamespace(kind=f"{self.__name__}.{kind}", **fields)


@pytest.fixture
def rclpy(monkeypatch: pytest.MonkeyPatch) -> Iterator[MagicMock]:
    """Return a package rclpy that notes what is called; messages are namespaces of their keywords."""
    for name in ("rclpy", "rclpy.executors", "rclpy.qos", *PACKAGES):
        monkeypatch.setitem(sys.modules, name, MagicMock())
    for name in PACKAGES:
        monkeypatch.setitem(sys.modules, f"{name}.msg", Messages(f"{name}.msg"))
    monkeypatch.setattr(nodes, "find_spec", lambda name: name if name == "rclpy" else None)
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    with monkeypatch.context() as patch:
        patch.setenv(RANGE, "")
        patch.delenv(RANGE)
        yield sys.modules["rclpy"]  # type: ignore[misc]


@pytest.mark.parametrize("public", [False, True])
def test_where_rclpy_is_there_it_publishes_to_this_machine_unless_public(
    rclpy: MagicMock,
    monkeypatch: pytest.MonkeyPatch,
    make_grasp: Callable[..., LiveGrasp],
    preshape: Preshape,
    angles: JointAngles,
    public: bool,
) -> None:
    monkeypatch.setitem(sys.modules, "thenar_msgs", MagicMock())
    monkeypatch.setitem(sys.modules, "thenar_msgs.msg", Messages("thenar_msgs.msg"))
    ranges = list[str | None]()
    rclpy.init.side_effect = lambda **_: ranges.append(os.environ.get(RANGE))
    sink = open_sink("ros:/lab" + "?public" * public)
    node = rclpy.create_node.return_value
    assert (ranges, rclpy.init.call_args.kwargs["domain_id"]) == ([None if public else "LOCALHOST"], 7)
    topics = [call.args[1] for call in node.create_publisher.call_args_list]
    assert topics == [f"/lab/{topic}" for topic in ("grasp", "state", "preshape", "angles", "health")]
    sink.publish(make_grasp(1, "cup"), preshape, angles)
    sent = [call.args[0] for call in node.create_publisher.return_value.publish.call_args_list]
    assert [one.kind for one in sent[:2]] == ["std_msgs.msg.String", "thenar_msgs.msg.Grasp"]
    assert (sent[0].data, sent[1].grasp, sent[1].header.stamp.sec) == ("cup", "cup", 1_700_000_000)
    assert (sink.report().sent, sink.report().lost) == (1, 0)
    sink.close()
    rclpy.shutdown.assert_called_once_with(context=rclpy.Context.return_value)


def test_messages_are_rows(rclpy: MagicMock) -> None:
    reader, executor = RosReader("ros:/glove"), sys.modules["rclpy.executors"].SingleThreadedExecutor.return_value
    reader.open()
    take = rclpy.create_node.return_value.create_subscription.call_args.args[2]
    header = SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0))
    executor.spin_once.side_effect = lambda **_: take(SimpleNamespace(name=["ring"], position=[0.5], header=header))
    assert [(row.names, row.values) for row in (*reader.read(0.1), *reader.read(0.1))] == [(("ring",), (0.5,))] * 2
    reader.close()


def test_a_message_package_that_is_not_built_is_named(rclpy: MagicMock) -> None:
    with pytest.raises(SettingError, match=rf"no package thenar_msgs: .* comes as {PACKAGE}: copy that into"):
        open_sink("ros:/lab")


@pytest.mark.parametrize("machine", ["aarch64", "x86_64"])
def test_without_either_a_sentence_names_the_way(monkeypatch: pytest.MonkeyPatch, machine: str) -> None:
    monkeypatch.setattr(nodes, "find_spec", lambda _name: None)
    monkeypatch.setattr(platform, "machine", lambda: machine)
    for name in [name for name in sys.modules if name.partition(".")[0] == "cyclonedds"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(sys.modules, "thenar.runtime.ros_dds", raising=False)
    monkeypatch.setitem(sys.modules, "cyclonedds", None)
    said = "no wheel for aarch64: install ROS 2" if machine == "aarch64" else r'pip install "thenar\[ros\]"'
    with pytest.raises(SettingError, match=said):
        open_sink("ros:/lab")
