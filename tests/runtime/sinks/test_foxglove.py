"""What Foxglove reads, by its own WebSocket protocol, foxglove.sdk.v1, spoken by a client that is not Foxglove's.

https://github.com/foxglove/ws-protocol, docs/spec.md: the server advertises channels as JSON, a client subscribes with
ids of its own, and messages are binary: 0x01, the subscription as uint32, nanoseconds as uint64, the payload.
"""

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from struct import unpack_from
from typing import Any

import pytest
from msgspec.json import decode, encode
from msgspec.structs import replace
from websockets import Subprotocol
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from thenar.drivers.errors import SettingError
from thenar.runtime import Build
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.live.recogniser import LiveRecognizer, Moment
from thenar.runtime.policy import Policy
from thenar.runtime.published import HealthReport, JointAngles, LiveGrasp, Preshape
from thenar.runtime.sinks import SinkError, open_sink

from ...conftest import tool
from ..conftest import eventually

MakeGrasp = Callable[..., LiveGrasp]
LAYOUT = Path(__file__).resolve().parents[3] / "examples" / "foxglove-layout.json"
LONG_S = 60.0
STARTED_NS = 1_700_000_000_123_456_000


class Client:
    """Subscribes to topics, and knows what the server has advertised."""

    def __init__(self, socket: ClientConnection, topics: list[str] | None) -> None:
        self.socket = socket
        self.server = json.loads(self.socket.recv(LONG_S))
        self.channels = {each["topic"]: each for each in json.loads(self.socket.recv(LONG_S))["channels"]}
        self.topics = list(self.channels) if topics is None else topics
        asked = [{"id": 100 + n, "channelId": self.channels[one]["id"]} for n, one in enumerate(self.topics)]
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))

    def next(self) -> tuple[str, int, dict[str, Any]]:
        """Return topic, nanoseconds and content of the next message."""
        data = self.socket.recv(LONG_S)
        assert isinstance(data, bytes)
        kind, subscription, time_ns = unpack_from("<BIQ", data)
        assert kind == 1
        return self.topics[subscription - 100], time_ns, json.loads(data[13:])


@pytest.fixture(autouse=True)
def _sdk() -> None:
    if find_spec("foxglove") is None:
        tool("foxglove-sdk of PyPI")


@pytest.fixture
def sink() -> Iterator[Any]:
    sink = open_sink("foxglove:127.0.0.1:0")
    yield sink
    sink.close()


@pytest.fixture
def listen(sink: Any) -> Iterator[Callable[..., Client]]:
    """Return what connects a client and waits until the server knows of its subscriptions."""
    with ExitStack() as stack:

        def made(topics: list[str] | None = None) -> Client:
            protocol = Subprotocol("foxglove.sdk.v1")
            connection = connect(f"ws://127.0.0.1:{sink.port}", subprotocols=[protocol], close_timeout=0.1)
            client = Client(stack.enter_context(connection), topics)
            # The server answers in order.
            assert connection.ping().wait(LONG_S)
            eventually(lambda: all(sink._channels[topic].has_sinks() for topic in client.topics))
            return client

        yield made


@pytest.fixture
def build(make_build: Callable[..., Build]) -> Build:
    return make_build()


def moments(build: Build, count: int) -> Iterator[Moment]:
    """Yield moments 20 ms apart of frames that change, as a run makes them."""
    live = LiveRecognizer(
        build,
        sensor_names=("j0", "j1", "j2"),
        switch_period_us=20_000,
        glove_period_us=20_000,
        policy=Policy(lead=0.0, dwell_us=0),
    )
    for number in range(count):
        now = 1_000_000 + 20_000 * number
        switches = SwitchFrame(now, 0b10110 ^ number % 64, lost=0b100 * (number % 5 == 4))
        glove = GloveFrame(now, bytes((10 + number, 100, 200 - number)))
        moment = live.step(now, STARTED_NS // 1000 + now, switches, glove)
        moment.angles = JointAngles(("j0", "j1"), (0.5, -0.25 * number))
        yield moment


def fields(content: Any) -> dict[str, Any]:
    return {name: value for name, value in decode(encode(content)).items() if value is not None}


def known_to_foxglove(schema: dict[str, Any]) -> None:
    """Check what @mcap/support's parseJsonSchema throws at: all but objects, arrays, and plain types by themselves."""
    assert not {"$ref", "anyOf", "oneOf", "allOf", "enum", "const"} & schema.keys()
    if schema["type"] == "object":
        for field in schema["properties"].values():
            known_to_foxglove(field)
    elif schema["type"] == "array":
        assert schema["items"]["type"] != "array"
        known_to_foxglove(schema["items"])
    else:
        assert schema["type"] in {"boolean", "string", "number", "integer"}


def fits(content: Any, schema: dict[str, Any]) -> bool:
    """Return whether a value is of a schema, all fields of which are known."""
    if schema["type"] == "object":
        return content.keys() <= schema["properties"].keys() and all(
            fits(value, schema["properties"][name]) for name, value in content.items()
        )
    if schema["type"] == "array":
        return all(fits(each, schema["items"]) for each in content)
    kinds: dict[str, tuple[type, ...]] = {"boolean": (bool,), "string": (str,), "integer": (int,)}
    return isinstance(content, kinds.get(schema["type"], (int, float)))


def test_every_topic_is_advertised_with_a_schema_that_foxglove_knows(listen: Callable[..., Client]) -> None:
    client = listen()
    assert client.server["op"] == "serverInfo"
    assert client.server["capabilities"] == []  # nobody can send anything
    assert client.socket.subprotocol == "foxglove.sdk.v1"
    topics = "grasp", "joints", "preshape", "health"
    assert set(client.channels) == {f"/thenar/{topic}" for topic in topics}
    for channel in client.channels.values():
        assert (channel["encoding"], channel["schemaEncoding"]) == ("json", "jsonschema")
        schema = json.loads(channel["schema"])
        assert schema["type"] == "object"
        known_to_foxglove(schema)


def test_moments_come_as_they_were_published_with_their_times(
    sink: Any, listen: Callable[..., Client], build: Build
) -> None:
    client = listen(["/thenar/grasp", "/thenar/joints"])
    schemas = {topic: json.loads(channel["schema"]) for topic, channel in client.channels.items()}
    for moment in moments(build, 20):
        sink.publish(moment.grasp, None, moment.angles)
        came = {}
        for _ in range(2):
            topic, time_ns, content = client.next()
            assert time_ns == 1000 * moment.grasp.unix_us
            assert fits(content, schemas[topic]), content
            came[topic] = content
        assert came["/thenar/grasp"] == fields(moment.grasp)
        assert came["/thenar/joints"] == fields(moment.angles)
    assert (sink.report().sent, sink.report().lost) == (40, 0)


def test_a_preshape_comes_with_the_grasp_and_health_behind_its_frame(
    sink: Any, listen: Callable[..., Client], make_grasp: MakeGrasp, preshape: Preshape, health: HealthReport
) -> None:
    first = listen(["/thenar/preshape", "/thenar/health"])
    sink.publish(make_grasp(0), preshape, None)
    sink.publish(make_grasp(1), None, None)
    report = replace(health, time_us=make_grasp(1).time_us + 5)
    sink.health(report)
    kept = "/thenar/preshape", fields(preshape)
    came = [first.next() for _ in range(2)]
    assert [(topic, content) for topic, _, content in came] == [kept, ("/thenar/health", fields(report))]
    stamps = make_grasp(0).unix_us, make_grasp(1).unix_us + 5
    assert [time_ns for _, time_ns, _ in came] == [1000 * unix_us for unix_us in stamps]


def test_a_reader_that_reads_nothing_holds_nobody_up_and_no_memory(
    sink: Any, listen: Callable[..., Client], build: Build
) -> None:
    listen()  # and never reads
    reads = listen(["/thenar/grasp"])
    (moment,) = moments(build, 1)
    before = resident_at_first()
    for number in range(60_000):
        time_us = 20_000 * number
        moment.grasp = replace(moment.grasp, number=number, time_us=time_us, unix_us=time_us)
        sink.publish(moment.grasp, None, moment.angles)
    assert resident_bytes() - before < 12 << 20  # 120,000 messages are 20 MB and more
    assert sink.report().lost == 0
    while reads.next()[2]["number"] < 59_999:
        pass


@cache
def resident_at_first() -> int:
    """Return it as it was before this test, which may be run again."""
    return resident_bytes()


def resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def test_the_end_closes_connections_and_frees_the_port(sink: Any, listen: Callable[..., Client]) -> None:
    client = listen()
    sink.close()
    sink.close()
    with pytest.raises(ConnectionClosed):
        client.next()
    again = open_sink(f"foxglove:127.0.0.1:{sink.port}")
    again.close()


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ("foxglove:0.0.0.0:8765", r"other machines could read it there.* foxglove:0\.0\.0\.0:8765\?public"),
        ("foxglove:here", r"write it as foxglove:127\.0\.0\.1:8765"),
    ],
)
def test_an_address_that_cannot_be_is_refused(where: str, said: str) -> None:
    with pytest.raises(SettingError, match=said):
        open_sink(where)


def test_a_port_that_is_taken_is_named(sink: Any) -> None:
    with pytest.raises(SinkError, match=rf"foxglove:{sink.port} cannot be opened: .*in use: another process serves"):
        open_sink(f"foxglove:{sink.port}")


def test_the_layout_that_ships_shows_fields_that_are_published(listen: Callable[..., Client]) -> None:
    schemas = {topic: json.loads(channel["schema"]) for topic, channel in listen().channels.items()}
    layout = json.loads(LAYOUT.read_text())
    panels = layout["configById"]
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", ())]
    paths += [panel["topicPath"] for panel in panels.values() if "topicPath" in panel]
    assert {path.partition(".")[0] for path in paths} == set(schemas)
    for path in paths:
        topic, *names = path.split(".")
        found = schemas[topic]
        for name in names:
            found = found["properties"][name]
    assert sorted(leaves(layout["layout"])) == sorted(panels)


def leaves(node: Any) -> list[str]:
    return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])
