"""Open Sound Control, over real UDP sockets on loopback; what goes out is compared with bytes made here."""

import json
import socket
import struct
from collections.abc import Callable, Iterator
from itertools import count

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder

from thenar.drivers.errors import DeviceError, SettingError
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.live.stream_probe import propose_glove
from thenar.runtime.published import HealthReport, JointAngles, LiveGrasp, Preshape
from thenar.runtime.sinks import open_sink
from thenar.runtime.sources.osc import OscParser, OscReader
from thenar.runtime.sources.rows import RowSource

from ..sending import datagrams, free_port
from .conftest import eventually, row_source

GLOVE = """
[debounce]
enabled = false
[[stream]]
port = "{port}"
columns = ["thumb", "ring"]
switches = ["thumb"]
joints = {{ ring = [0, 2] }}
"""
numbers = st.floats(width=32, allow_nan=False, allow_infinity=False)


def padded(text: str) -> bytes:
    data = text.encode() + b"\0"
    return data + bytes(-len(data) % 4)


def message(address: str, *values: str | float | int) -> bytes:
    """Return a message as the specification of OSC 1.0 has it."""
    kinds = {str: "s", float: "f", int: "i"}
    tags = [kinds[type(value)] for value in values]
    packed = (padded(v) if isinstance(v, str) else struct.pack(f">{t}", v) for t, v in zip(tags, values, strict=True))
    return padded(address) + padded("," + "".join(tags)) + b"".join(packed)


def bundle(*messages: bytes) -> bytes:
    return padded("#bundle") + struct.pack(">Q", 1) + b"".join(struct.pack(">i", len(m)) + m for m in messages)


@pytest.fixture
def receiver() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        made.settimeout(20.0)
        yield made


def test_a_grasp_is_one_bundle_with_a_preshape_when_it_changes(
    receiver: socket.socket, make_grasp: Callable[..., LiveGrasp], preshape: Preshape, health: HealthReport
) -> None:
    sink = open_sink(f"osc:127.0.0.1:{receiver.getsockname()[1]}/left/hand?every")
    angles = JointAngles(("index_mpj", "ring [mpj] é"), (0.25, -1.5))
    parts = (
        message("/left/hand/grasp", "PoS", 0.9375, "ok", "none", 0),
        message("/left/hand/angle/index_mpj", 0.25),
        message("/left/hand/angle/ring__mpj___", -1.5),
    )
    for number in range(2):
        sink.publish(make_grasp(number), preshape, angles)
    sink.health(health)
    assert receiver.recv(65536) == bundle(*parts, message("/left/hand/preshape", "cylindrical", 0.0, 0.5))
    assert receiver.recv(65536) == bundle(*parts)
    said = receiver.recv(65536).partition(b"{")[2].rstrip(b"\0")
    assert json.loads(b"{" + said)["quarantined"][0]["name"] == "s001"
    assert (sink.report().sent, sink.report().lost) == (3, 0)
    sink.close()


def test_nobody_has_to_receive_and_what_is_too_long_is_lost(
    receiver: socket.socket, make_grasp: Callable[..., LiveGrasp]
) -> None:
    sink = open_sink(f"osc:127.0.0.1:{receiver.getsockname()[1]}")
    receiver.close()
    for grasp in ("cup", "cup", "x" * 70_000):
        sink.publish(make_grasp(0, grasp), None, None)
    sink.close()
    assert (sink.report().sent, sink.report().lost, sink.report().error) == (2, 1, "Message too long")


@pytest.fixture
def source() -> Iterator[RowSource]:
    made = row_source(GLOVE.format(port=f"osc:127.0.0.1:{free_port()}/glove"))
    made.open()
    yield made
    made.close()


def sender(source: RowSource) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    host, port = source.wiring.port.removeprefix("osc:").partition("/")[0].split(":")
    made.connect((host, int(port)))
    return made


def row(source: RowSource) -> tuple[int, bytes]:
    frames = list[SwitchFrame | GloveFrame]()

    def complete() -> bool:
        frames.extend(filter(None, [source.read(0.1)]))
        return len(frames) == 2

    eventually(complete)
    switches, glove = frames
    assert isinstance(switches, SwitchFrame)
    assert isinstance(glove, GloveFrame)
    return switches.closed, glove.sensors


def test_arguments_in_order_and_bundles_by_name_are_rows(source: RowSource) -> None:
    with sender(source) as glove:
        glove.send(message("/glove", 1, 1.0))
        assert row(source) == (1, bytes([128]))
        glove.send(bundle(message("/other", 5), message("/glove/ring", 2.0), message("/glove/thumb", 0.0)))
        assert row(source) == (0, bytes([255]))
        glove.send(message("/elsewhere", 1, 1.0))
        glove.send(b"not OSC")
        assert source.read(0.5) is None
        assert source.read(0.5) is None
    assert source.reader.counts().misfits == 2
    assert source.reader.odd == "a datagram that is not OSC"


def test_a_value_of_an_unusual_type_writes_no_line(source: RowSource, caplog: pytest.LogCaptureFixture) -> None:
    with sender(source) as glove:
        glove.send(bundle(b"?", padded("/glove") + padded(",TIT")))
        assert row(source) == (1, bytes([128]))
    assert not caplog.records


def test_a_second_sender_is_left_out_and_said(source: RowSource) -> None:
    with sender(source) as first, sender(source) as second:
        for number in count():
            first.send(message("/glove", 1, 1.0))
            second.send(message("/glove", 0, 0.0))
            assert row(source) == (1, bytes([128]))
            if source.reader.counts().foreign:
                break
            assert number < 100
        assert "sends, too" in source.fault_message()


def test_no_frame_is_proposed_for_messages_at_another_address() -> None:
    port = free_port()
    with (
        datagrams(port, lambda number: message("/glove", number % 100, number % 7), 0.005),
        pytest.raises(DeviceError, match="the data holds no rows: a message at /glove"),
    ):
        propose_glove(f"osc:127.0.0.1:{port}/glow", 115_200, 0.5)


@given(st.lists(st.one_of(numbers, st.booleans(), st.integers(-(2**31), 2**31 - 1)), min_size=1, max_size=8))
def test_every_number_of_a_message_arrives(values: list[float]) -> None:
    builder, parser = OscMessageBuilder("/a/b"), OscParser("/a/b")
    for value in values:
        builder.add_arg(value)
    whole = OscBundleBuilder(IMMEDIATELY)
    whole.add_content(builder.build())
    for datagram in (builder.build().dgram, whole.build().dgram):
        assert [found.values for found in parser.feed(datagram + b"\n")] == [tuple(map(float, values))]
    assert parser.counts.misfits == 0


HEADS = (b"", b"#bundle\0", b"/a\0\0", b"/a\0\0,[f]", bundle(message("/a", 1.0)))


@given(st.binary(max_size=80), st.sampled_from(HEADS))
def test_no_datagram_raises_or_passes_uncounted(tail: bytes, head: bytes) -> None:
    parser = OscParser("/a")
    rows = parser.feed(head + tail + b"\n")
    assert bool(rows) != bool(parser.counts.misfits)
    assert all(value is None or abs(value) < 1e39 for found in rows for value in found.values)


@pytest.mark.parametrize(
    "port", ["osc:", "osc:9000", "osc:127.0.0.1/a", "osc:127.0.0.1:9000", "osc:h:1/", "osc:h:1/a,"]
)
def test_what_names_no_address_is_refused(port: str) -> None:
    with pytest.raises(SettingError, match="names no address: write osc:HOST:PORT/ADDRESS"):
        OscReader(port).open()


@pytest.mark.parametrize("place", ["9000/a b", "9000/", "9000//a", "127.0.0.1", "127.0.0.1:x/a"])
def test_a_sink_at_no_address_is_refused(place: str) -> None:
    with pytest.raises(SettingError, match="write it as"):
        open_sink(f"osc:{place}")
