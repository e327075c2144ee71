"""A line of JSON holds everything that was published, and nothing but itself."""

import io
import json
import socket
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import json as typed_json
from msgspec.structs import asdict, replace

from thenar.runtime.published import HealthReport, LiveGrasp, Preshape
from thenar.runtime.sinks import GraspLine, HeaderLine, HealthLine, JointAngles, JsonLines
from thenar.runtime.sinks.jsonl import encode, encode_health
from thenar.runtime.sinks.sockets import SocketLines, open_tcp

numbers = st.floats(allow_nan=False, allow_infinity=False)
names = st.text(st.characters(codec="utf-8"))
preshapes = st.builds(Preshape, names, st.tuples(names, names), st.tuples(numbers, numbers), numbers)
angles = st.builds(JointAngles, st.tuples(names), st.tuples(numbers))
grasps = st.builds(LiveGrasp, grasp=names, candidate=names, probability=numbers, lost=st.tuples(names, names))


@given(grasps, st.none() | preshapes, st.none() | angles)
def test_a_line_comes_back_as_it_was_published(
    grasp: LiveGrasp, preshape: Preshape | None, angle: JointAngles | None
) -> None:
    line = encode(grasp, preshape, angle)
    assert line.endswith(b"\n")
    assert line.count(b"\n") == 1
    rounded = replace(
        grasp, probability=round(grasp.probability, 4), segment_probability=round(grasp.segment_probability, 4)
    )
    positions = None if angle is None else tuple(round(position, 4) for position in angle.positions_rad)
    assert typed_json.decode(line, type=GraspLine) == GraspLine(**asdict(rounded), preshape=preshape, angles=positions)


@pytest.mark.parametrize("kind", ["jsonl", "tcp"])
def test_a_header_names_the_joints_before_their_angles(make_grasp: Callable[..., LiveGrasp], kind: str) -> None:
    file = io.BytesIO()
    sink = JsonLines(file) if kind == "jsonl" else open_tcp("127.0.0.1:0")
    reader, late = socket.socket(), socket.socket()
    if isinstance(sink, SocketLines):
        reader.connect(sink.address)
    one, other = JointAngles(("a", "b"), (0.12345, -1.0)), JointAngles(("c",), (2.0,))
    for number, angle in enumerate([None, one, one, other]):
        if number == 2 and isinstance(sink, SocketLines):
            late.connect(sink.address)
        sink.publish(make_grasp(number), None, angle)
    sink.close()
    written = file.getvalue() or read_all(reader)
    lines = [typed_json.decode(line, type=GraspLine | HeaderLine) for line in written.splitlines()]
    kinds = [line.joints if isinstance(line, HeaderLine) else line.angles for line in lines]
    assert kinds == [None, ("a", "b"), (0.1235, -1.0), (0.1235, -1.0), ("c",), (2.0,)]
    if kind == "tcp":
        assert [typed_json.decode(line, type=GraspLine | HeaderLine) for line in read_all(late).splitlines()] == [
            lines[1],
            *lines[3:],
        ]
    reader.close()
    late.close()


def read_all(reader: socket.socket) -> bytes:
    with reader.makefile("rb") as file:
        return file.read()


def test_a_line_of_before_there_were_segments_is_read_as_one_without(make_grasp: Callable[..., LiveGrasp]) -> None:
    told = json.loads(encode(make_grasp(7), None, None))
    older = {name: value for name, value in told.items() if not name.startswith(("state", "segment"))}
    assert len(told) - len(older) == 5
    assert typed_json.decode(json.dumps(older), type=GraspLine) == GraspLine(**asdict(make_grasp(7)))


def test_a_reader_tells_grasps_and_health_apart(make_grasp: Callable[..., LiveGrasp], health: HealthReport) -> None:
    lines = [encode(make_grasp(7), None, None), encode_health(health)]
    grasp, report = (typed_json.decode(line, type=GraspLine | HealthLine) for line in lines)
    assert isinstance(grasp, GraspLine)
    assert report == HealthLine(**{name: getattr(health, name) for name in health.__struct_fields__})
    assert [json.loads(line)["kind"] for line in lines] == ["grasp", "health"]
    assert lines[1].endswith(b"}\n")
