"""MQTT, out of and into a real broker (mosquitto) on loopback, which another client reads and writes."""

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Queue

import pytest
from msgspec.json import decode
from msgspec.structs import replace

from thenar.drivers.closing import Closing
from thenar.drivers.errors import DeviceError, SettingError
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.published import HealthReport, JointAngles, LiveGrasp, Preshape
from thenar.runtime.sinks import GraspLine, HeaderLine, Line, SinkError, open_sink
from thenar.runtime.sinks.jsonl import encode, encode_header, encode_health
from thenar.runtime.sources.base import SOURCES
from thenar.runtime.sources.mqtt import MqttReader
from thenar.runtime.sources.rows import RowKind, kind_of

from ..conftest import tool
from .conftest import eventually, row_source

MakeGrasp = Callable[..., LiveGrasp]
WAIT_S = 20.0
GLOVE = """
[debounce]
enabled = false
[[stream]]
port = "{port}"
columns = ["thumb", "pad"]
switches = ["thumb"]
taxels = {{ pad = [0, 255] }}
"""


class Broker:
    """mosquitto, which may be ended and started again at the same port."""

    def __init__(self, folder: Path) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port: int = free.getsockname()[1]
        self.place, self.login = f"mqtt:127.0.0.1:{self.port}", folder / "login"
        self._settings = folder / "mosquitto.conf"
        self.start()

    def start(self) -> None:
        access = f"password_file {self.login}" if self.login.exists() else "allow_anonymous true"
        self._settings.write_text(f"user root\nlistener {self.port} 127.0.0.1\n{access}\n")
        command = [tool("mosquitto"), "-c", str(self._settings)]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        assert self.process.stderr is not None
        for line in self.process.stderr:
            if "running" in line:
                return
        raise AssertionError("mosquitto has ended")

    def end(self) -> None:
        self.process.kill()
        self.process.wait()
        assert self.process.stderr is not None
        self.process.stderr.close()


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    made = Broker(tmp_path)
    yield made
    made.end()


class Other(Closing):
    """Another client of the broker: what it gets of a topic comes out of a queue."""

    def __init__(self, broker: Broker, topic: str) -> None:
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion

        self.got: Queue[tuple[str, bytes]] = Queue()
        self.client, ready = Client(CallbackAPIVersion.VERSION2), Queue[bool]()
        self.client.on_message = lambda _client, _data, message: self.got.put((message.topic, bytes(message.payload)))
        self.client.on_subscribe = lambda *_: ready.put(True)
        self.client.connect("127.0.0.1", broker.port)
        self.client.loop_start()
        self.client.subscribe(topic)
        ready.get(timeout=WAIT_S)

    def close(self) -> None:
        self.client.disconnect()
        self.client.loop_stop()


def test_lines_are_those_of_json_lines_and_joints_are_kept_for_late_readers(
    broker: Broker, make_grasp: MakeGrasp, preshape: Preshape, angles: JointAngles, health: HealthReport
) -> None:
    sink = open_sink(f"{broker.place}/lab/left")
    with Other(broker, "lab/left/#") as reader:
        sink.publish(make_grasp(1), preshape, angles)
        sink.health(health)
        got = [reader.got.get(timeout=WAIT_S) for _ in range(3)]
    assert got == [
        ("lab/left/joints", encode_header(angles)[:-1]),
        ("lab/left/grasp", encode(make_grasp(1), preshape, angles)[:-1]),
        ("lab/left/health", encode_health(health)[:-1]),
    ]
    assert decode(got[1][1], type=Line) == replace(decode(got[1][1], type=GraspLine), grasp="PoS")
    with Other(broker, "lab/left/#") as late:
        topic, payload = late.got.get(timeout=WAIT_S)
        assert (topic, decode(payload, type=Line)) == ("lab/left/joints", HeaderLine(angles.names))
        sink.publish(make_grasp(2), None, angles)
        assert late.got.get(timeout=WAIT_S)[0] == "lab/left/grasp"
    sink.close()
    assert (sink.report().sent, sink.report().lost, sink.report().error) == (4, 0, "")


def test_what_comes_while_the_broker_is_away_is_lost_and_what_comes_later_is_not(
    broker: Broker, make_grasp: MakeGrasp
) -> None:
    sink = open_sink(f"{broker.place}/hand")
    broker.end()

    def loses() -> bool:
        sink.publish(make_grasp(1), None, None)
        return "not currently connected" in sink.report().error

    eventually(loses)
    broker.start()
    with Other(broker, "hand/grasp") as reader:

        def arrives() -> bool:
            sink.publish(make_grasp(2), None, None)
            return not reader.got.empty()

        eventually(arrives)
        assert json.loads(reader.got.get()[1])["number"] == 2
    sink.close()


def test_joints_are_sent_again_to_a_broker_that_has_forgotten_them(
    broker: Broker, make_grasp: MakeGrasp, angles: JointAngles
) -> None:
    sink = open_sink(f"{broker.place}/hand")
    broker.end()

    def loses() -> bool:
        sink.publish(make_grasp(1), None, angles)
        return "not currently connected" in sink.report().error

    for _ in range(2):  # never sent; sent, and forgotten by the broker
        eventually(loses)
        broker.start()
        with Other(broker, "hand/joints") as reader:

            def arrives(reader: Other = reader) -> bool:
                sink.publish(make_grasp(2), None, angles)
                return not reader.got.empty()

            eventually(arrives)
            assert reader.got.get()[1] == encode_header(angles)[:-1]
        broker.end()
        sink.error = ""
    sink.close()
    broker.start()


def test_a_broker_that_takes_nothing_loses_lines_and_does_not_block(broker: Broker, make_grasp: MakeGrasp) -> None:
    sink = open_sink(f"{broker.place}/hand")
    broker.process.send_signal(signal.SIGSTOP)
    wide = make_grasp(1, lost=("x" * 1_000_000,))

    def loses() -> bool:
        sink.publish(wide, None, None)
        return sink.report().lost > 0

    eventually(loses)
    assert sink.report().error == "the broker takes nothing"
    broker.end()
    sink.close()


def test_a_broker_that_is_not_there_or_wants_a_login_is_said(
    broker: Broker, monkeypatch: pytest.MonkeyPatch, make_grasp: MakeGrasp
) -> None:
    broker.end()
    with pytest.raises(SinkError, match=r"cannot be opened: Connection refused: does the broker run there\?"):
        open_sink(f"{broker.place}/hand")
    with pytest.raises(DeviceError, match="Connection refused"):
        MqttReader(f"{broker.place}/hand").open()
    subprocess.run([tool("mosquitto_passwd"), "-b", "-c", str(broker.login), "ada", "lace"], check=True)
    broker.login.chmod(0o644)
    broker.start()
    with pytest.raises(SinkError, match="Not authorized: set MQTT_USERNAME and MQTT_PASSWORD"):
        open_sink(f"{broker.place}/hand")
    monkeypatch.setenv("MQTT_USERNAME", "ada")
    monkeypatch.setenv("MQTT_PASSWORD", "lace")
    sink = open_sink(f"{broker.place}/hand")
    sink.publish(make_grasp(1), None, None)
    assert sink.report().sent == 1
    sink.close()


def test_messages_are_rows_and_a_broker_that_went_away_is_found_again(broker: Broker) -> None:
    source = row_source(GLOVE.format(port=f"{broker.place}/glove"))
    with Other(broker, "nothing") as writer:
        writer.client.publish("glove", "1,1", retain=True).wait_for_publish(WAIT_S)
    for _ in range(2):
        source.open()
        with Other(broker, "nothing") as writer:
            for line in ("1,200", '{"pad": 100, "thumb": 0}', "pad:7\tthumb:1", "no row at all"):
                writer.client.publish("glove", line)
            frames = list[SwitchFrame]()
            while len(frames) < 3:
                frame = source.read(WAIT_S)
                assert isinstance(frame, SwitchFrame)
                frames.append(frame)
            assert [(frame.closed, frame.taxels) for frame in frames] == [(1, (200,)), (0, (100,)), (1, (7,))]
            eventually(lambda: source.read(0.0) is None and source.reader.odd == "'no row at all'")
        broker.end()
        with pytest.raises(DeviceError, match="the broker has ended the connection"):
            eventually(lambda: source.read(0.0) is not None)
        source.close()
        broker.start()
    assert source.reader.counts().misfits == 2


@pytest.mark.parametrize("place", ["here", "here/", "/a", "here:0/a", "here:99999/a", "here/a+", "here/#", "a b:c/d"])
def test_what_names_no_topic_is_refused(place: str) -> None:
    for opens in (lambda: open_sink(f"mqtt:{place}"), MqttReader(f"mqtt:{place}").open):
        with pytest.raises(SettingError, match="names no topic: write mqtt:HOST/TOPIC or mqtt:HOST:PORT/TOPIC"):
            opens()


@pytest.mark.parametrize(("place", "module"), [("mqtt:h/t", "paho"), ("osc:h:1/t", "pythonosc")])
def test_a_missing_package_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch, place: str, module: str) -> None:
    said = rf'{module} is not installed: pip install "thenar\[{place[: place.index(":")]}\]"'
    for loaded in [name for name in sys.modules if name.partition(".")[0] == module]:
        monkeypatch.delitem(sys.modules, loaded)
    monkeypatch.setitem(sys.modules, module, None)
    stream = parse_harness(GLOVE.format(port=place), "glove.toml").streams[0]
    kind = SOURCES[kind_of(place)]
    assert isinstance(kind, RowKind)
    for opens in (lambda: open_sink(place), kind.reader(stream).open):
        with pytest.raises((SettingError, SinkError), match=said):
            opens()
