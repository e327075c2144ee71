"""Topics of ROS 2, read by another process that knows their types from elsewhere (ros_listener.py), over loopback."""

import json
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from msgspec.structs import replace

from thenar.drivers.errors import SettingError
from thenar.runtime.published import HealthReport, LiveGrasp, Preshape
from thenar.runtime.sinks import JointAngles, Sink, SinkError, open_sink

MakeGrasp = Callable[..., LiveGrasp]
Message = dict[str, Any]

DOMAIN = 77
LISTENER = Path(__file__).with_name("ros_listener.py")
names = count()


@pytest.fixture(autouse=True)
def loopback(ros: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    # The other process keeps to loopback as well, by the same settings.
    monkeypatch.setenv("CYCLONEDDS_URI", ros._LOOPBACK)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN))


@pytest.fixture
def name() -> str:
    """Return a namespace that no other test has, in whatever process it runs."""
    return f"/hand{time.monotonic_ns()}n{next(names)}"


@pytest.fixture
def sink(name: str) -> Iterator[Sink]:
    made = open_sink(f"ros:{name}")
    yield made
    made.close()


class Listener:
    """The other process; what it says comes out of a queue."""

    def __init__(self, name: str, kind: str) -> None:
        command = [sys.executable, str(LISTENER), name, kind, str(DOMAIN)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE)
        self.said: queue.Queue[Message] = queue.Queue()
        self.thread = threading.Thread(target=self._read, daemon=True)
        self.thread.start()
        assert self.said.get(timeout=20) == {"ready": True}

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.said.put(json.loads(line))

    def hear(self, key: str, value: str, publish: Callable[[], None] = lambda: None) -> Message:
        """Return the first message whose `key` is `value`; `publish` is called until it comes."""
        deadline = time.monotonic() + 20
        while time.monotonic() < deadline:
            publish()
            try:
                said = self.said.get(timeout=0.01)
            except queue.Empty:
                continue
            if said.get(key) == value:
                return said
        raise AssertionError(f"never heard of {value}")

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self.thread.join(timeout=5)
        assert self.process.stdout is not None
        self.process.stdout.close()


@pytest.fixture
def listen(name: str) -> Iterator[Callable[..., Listener]]:
    listeners: list[Listener] = []

    def listen(kind: str = "reliable") -> Listener:
        listeners.append(Listener(name, kind))
        return listeners[-1]

    yield listen
    for listener in listeners:
        listener.close()


Listen = Callable[..., Listener]


@pytest.fixture
def again(make_grasp: MakeGrasp) -> Callable[..., LiveGrasp]:
    """Return what makes grasps that are more than a period apart."""
    numbers = count(step=6)
    return lambda *of: make_grasp(next(numbers), *of)


@pytest.mark.parametrize("reliability", ["reliable", "best effort"])
def test_every_topic_is_read_back_as_it_was_published(
    sink: Sink, listen: Listen, reliability: str, again: MakeGrasp, preshape: Preshape, angles: JointAngles
) -> None:
    listener = listen(reliability)

    def publish() -> None:
        now = replace(again(), unix_us=1_700_000_000_123_456)
        sink.publish(now, preshape, angles)

    stamped = {"stamp": {"sec": 1_700_000_000, "nanosec": 123_456_000}, "frame_id": ""}
    assert listener.hear("topic", "grasp", publish)["message"] == {"data": "PoS"}
    state = listener.hear("topic", "state", publish)["message"]
    assert state["header"] == stamped
    assert (state["grasp"], state["probability"], state["health"], state["lost"]) == ("PoS", 0.9375, "ok", [])
    assert listener.hear("topic", "angles", publish)["message"] == {
        "header": stamped,
        "name": list(angles.names),
        "position": list(angles.positions_rad),
        "velocity": [],
        "effort": [],
    }
    assert sink.report().lost == 0


def test_a_preshape_is_read_back_as_a_trajectory(
    sink: Sink, listen: Listen, again: MakeGrasp, preshape: Preshape
) -> None:
    # It is published once, perhaps before the listener is known.
    listener = listen("kept")
    heard = listener.hear("topic", "preshape", lambda: sink.publish(again(), preshape, None))
    assert heard["message"] == {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": ["finger_1/prox_joint", "finger_1/med_joint"],
        "points": [
            {
                "positions": [0.0, 0.5],
                "velocities": [],
                "accelerations": [],
                "effort": [],
                "time_from_start": {"sec": 1, "nanosec": 250_000_000},
            }
        ],
    }


@pytest.mark.parametrize(
    ("topic", "kind", "durability"),
    [
        ("grasp", "std_msgs::msg::dds_::String_", "TransientLocal"),
        ("state", "thenar_msgs::msg::dds_::Grasp_", "TransientLocal"),
        ("preshape", "trajectory_msgs::msg::dds_::JointTrajectory_", "TransientLocal"),
        ("angles", "sensor_msgs::msg::dds_::JointState_", "Volatile"),
        ("health", "std_msgs::msg::dds_::String_", "Volatile"),
    ],
)
def test_writers_are_found_under_ros_2s_names_with_its_qos(
    sink: Sink, listen: Listen, name: str, ros: ModuleType, topic: str, kind: str, durability: str
) -> None:
    found = listen().hear("found", f"rt{name}/{topic}")
    assert found["type"] == kind
    assert found["user_data"] == f"typehash=RIHS01_{ros.TYPE_HASHES[kind.replace('::msg::dds_::', '/').rstrip('_')]};"
    assert found["reliability"] == "Policy.Reliability.Reliable"
    assert found["durability"] == f"Policy.Durability.{durability}"


def test_a_preshape_is_sent_when_it_changes_and_kept_for_late_readers(
    sink: Sink, listen: Listen, again: MakeGrasp, preshape: Preshape
) -> None:
    def publish() -> None:
        sink.publish(again(), preshape, None)

    def told_by(grasp: str) -> list[Message]:
        sink.publish(again(grasp), preshape, None)
        between = [first.said.get(timeout=20)]
        while between[-1].get("message") != {"data": grasp}:
            between.append(first.said.get(timeout=20))
        return [said for said in between if said.get("topic") == "preshape"]

    def publish_another() -> None:
        sink.publish(again(), Preshape("another", preshape.joint_names, (next(numbers), 1.0), 0.5), None)

    def hear_positions(positions: tuple[float, ...]) -> None:
        while first.hear("topic", "preshape")["message"]["points"][0]["positions"] != [*positions]:
            pass

    first, numbers = listen(), count(2.0)
    # What is sent before the two know each other is not heard.
    first.hear("topic", "preshape", publish_another)
    publish()
    hear_positions(preshape.positions)
    # Many frames later the hand has not been told again, and one that asks for what is kept is told without it.
    for _ in range(50):
        publish()
    assert not told_by("many")
    listen("kept").hear("topic", "preshape")
    assert not told_by("kept")
    sink.publish(again(), Preshape("other", preshape.joint_names, (1.0, 1.0), 0.5), None)
    hear_positions((1.0, 1.0))


def test_a_node_that_comes_late_has_the_newest_at_once(
    sink: Sink, listen: Listen, make_grasp: MakeGrasp, preshape: Preshape
) -> None:
    for number in (1, 2):
        sink.publish(replace(make_grasp(number), segment=number), preshape, None)
    late = listen("kept")
    heard: dict[str, list[Message]] = {"grasp": [], "state": [], "preshape": []}
    while not all(heard.values()):
        said = late.said.get(timeout=20)
        heard.get(said.get("topic", ""), []).append(said)
    (state,) = heard["state"]
    assert state["message"]["segment"] == 2
    assert len(heard["preshape"]) == 1


def test_every_change_is_heard(sink: Sink, listen: Listen, again: MakeGrasp) -> None:
    listener = listen()
    listener.hear("topic", "state", lambda: sink.publish(again(), None, None))
    now = again()
    for number in range(1, 9):
        sink.publish(replace(now, segment=number), None, None)
    heard = [0]
    while heard[-1] < 8:
        heard.append(listener.hear("topic", "state")["message"]["segment"])
    assert heard[heard.index(1) :] == list(range(1, 9))


def test_how_the_glove_fares_is_published_as_json(sink: Sink, listen: Listen, health: HealthReport) -> None:
    heard = listen().hear("topic", "health", lambda: sink.health(health))
    assert json.loads(heard["message"]["data"])["quarantined"][0]["name"] == "s001"


def resident_kb() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4


@pytest.mark.slow
def test_a_reader_that_hangs_holds_up_nobody(
    sink: Sink, listen: Listen, again: MakeGrasp, preshape: Preshape, angles: JointAngles
) -> None:
    hangs = listen()
    hangs.hear("topic", "grasp", lambda: sink.publish(again(), preshape, angles))
    hangs.process.send_signal(signal.SIGSTOP)
    before = resident_kb()
    for _ in range(20_000):
        sink.publish(again(), preshape, angles)
    assert sink.report().lost == 0
    assert resident_kb() - before < 4_000
    listen().hear("topic", "grasp", lambda: sink.publish(again(), None, None))
    sink.close()


def test_what_cannot_be_sent_is_counted_and_raises_nothing(
    sink: Sink, make_grasp: MakeGrasp, angles: JointAngles
) -> None:
    far: Any = "far"
    sink.publish(make_grasp(0), None, JointAngles(("a",), (far,)))
    sink.publish(make_grasp(6), None, angles)
    report = sink.report()
    assert (report.sent, report.lost) == (1, 1)
    assert report.error
    sink.close()
    sink.close()
    sink.publish(make_grasp(2), None, angles)
    assert sink.report().lost == 2


def test_two_in_one_process_share_the_domain(sink: Sink, make_grasp: MakeGrasp, name: str) -> None:
    other = open_sink(f"ros:{name}/left")
    other.publish(make_grasp(0), None, None)
    other.close()
    sink.publish(make_grasp(0), None, None)
    assert (other.report().sent, sink.report().sent) == (1, 1)


def test_settings_that_dds_cannot_use_are_told(monkeypatch: pytest.MonkeyPatch, name: str, ros: ModuleType) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", ros._LOOPBACK.replace('address="127.0.0.1"', 'name="no_such_interface"'))
    monkeypatch.setenv("ROS_DOMAIN_ID", "78")
    with pytest.raises(SinkError, match=r"in domain 78.*CYCLONEDDS_URI"):
        open_sink(f"ros:{name}")


def sockets() -> Iterator[socket.socket]:
    """Yield the datagram sockets of this process, one after the other."""
    for link in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            if str(link.readlink()).startswith("socket:"):
                with socket.socket(fileno=os.dup(int(link.name))) as one:
                    if one.type == socket.SOCK_DGRAM and one.family in (socket.AF_INET, socket.AF_INET6):
                        yield one


def test_broken_datagrams_write_nothing_to_stderr(
    sink: Sink, listen: Listen, again: MakeGrasp, capfd: pytest.CaptureFixture[str]
) -> None:
    """Where nobody reads stderr, they would stop DDS."""
    broken = b"RTPS\x02\x01\x01\x10" + bytes(12) + b"\x15\x01\xff\x00" + bytes(60)
    ports = {one.getsockname()[1] for one in sockets()} - {0}
    assert ports
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for port in ports:
            stranger.sendto(broken, ("127.0.0.1", port))
    # A reader is found through the same sockets: by then they have been read.
    heard = listen().hear("topic", "grasp", lambda: sink.publish(again(), None, None))
    assert heard["message"] == {"data": "PoS"}
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("number", ["233", "-1", "lab"])
def test_a_domain_that_ros_cannot_have_is_refused(monkeypatch: pytest.MonkeyPatch, name: str, number: str) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", number)
    with pytest.raises(SettingError, match="from 0 to 232"):
        open_sink(f"ros:{name}")


def devices() -> set[bytes]:
    """Return to which network devices the datagram sockets of this process are bound; empty: to all."""
    return {one.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16).rstrip(b"\0") for one in sockets()}


def test_unless_it_is_asked_for_no_other_machine_can_read(
    monkeypatch: pytest.MonkeyPatch, name: str, listen: Listen, again: MakeGrasp
) -> None:
    listener = listen()
    monkeypatch.delenv("CYCLONEDDS_URI")
    sink = open_sink(f"ros:{name}")
    assert devices() == {b"lo"}
    memberships = Path("/proc/net/igmp").read_text()
    assert "0100FFEF" not in memberships  # 239.255.0.1, where participants call for each other
    heard = listener.hear("topic", "grasp", lambda: sink.publish(again(), None, None))
    assert heard["message"] == {"data": "PoS"}
    sink.close()
    sink = open_sink(f"ros:{name}?public")
    assert sink.report().where == f"ros:{name}?public"
    assert b"" in devices()
    sink.close()
