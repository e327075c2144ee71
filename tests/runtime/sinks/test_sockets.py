"""Lines to several readers at a time, over real Unix and TCP sockets: slow, hanging and vanishing ones among them."""

import socket
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from msgspec import json

from thenar.runtime.live.health import HealthReport
from thenar.runtime.live.published import LiveGrasp
from thenar.runtime.preshape import Preshape
from thenar.runtime.sinks import HealthLine, JointAngles, Line, SocketLines
from thenar.runtime.sinks.listening import open_tcp, open_unix
from thenar.runtime.sinks.sockets import MAX_READERS

MakeGrasp = Callable[..., LiveGrasp]


@pytest.fixture(params=["unix", "tcp"])
def sink(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[SocketLines]:
    made = open_unix(str(tmp_path / "grasps")) if request.param == "unix" else open_tcp("127.0.0.1:0")
    yield made
    made.close()


class Reader:
    """Connects, and reads lines when told to."""

    def __init__(self, sink: SocketLines) -> None:
        address = sink.address
        if isinstance(address, str):
            self.socket = socket.socket(socket.AF_UNIX)
            self.socket.connect(address)
        else:
            self.socket = socket.create_connection(address)
        self.socket.settimeout(20)
        self.lines = self.socket.makefile("rb")

    def number(self) -> int:
        return json.decode(self.lines.readline(), type=Line).number

    def close(self) -> None:
        self.lines.close()
        self.socket.close()


@pytest.fixture
def connect(sink: SocketLines) -> Iterator[Callable[[], Reader]]:
    readers: list[Reader] = []

    def connect() -> Reader:
        readers.append(Reader(sink))
        return readers[-1]

    yield connect
    for reader in readers:
        reader.close()


Connect = Callable[[], Reader]


def test_every_reader_gets_every_frame_from_when_it_came(
    sink: SocketLines, connect: Connect, make_grasp: MakeGrasp
) -> None:
    sink.publish(make_grasp(0), None, None)
    readers = [connect()]
    for number in range(1, 6):
        readers.append(connect())
        sink.publish(make_grasp(number), None, None)
        assert [reader.number() for reader in readers[: number + 1]] == [number] * (number + 1)
    assert sink.report().readers == 6
    assert sink.report().sent == 2 + 3 + 4 + 5 + 6


def test_a_line_holds_the_preshape_and_the_angles(
    sink: SocketLines, connect: Connect, make_grasp: MakeGrasp, preshape: Preshape, angles: JointAngles
) -> None:
    reader = connect()
    sink.publish(make_grasp(), preshape, angles)
    line = json.decode(reader.lines.readline(), type=Line)
    assert (line.preshape, line.angles) == (preshape, angles)


def test_readers_hear_how_the_glove_fares(
    sink: SocketLines, connect: Connect, make_grasp: MakeGrasp, health: HealthReport
) -> None:
    sink.health(health)  # nobody is there, and that is no loss
    reader = connect()
    sink.publish(make_grasp(), None, None)
    sink.health(health)
    assert reader.number() == 0
    assert json.decode(reader.lines.readline(), type=HealthLine).switch_hz == 100.0
    assert sink.report().lost == 0


def test_one_that_never_reads_holds_up_nobody_and_costs_no_memory(
    sink: SocketLines, connect: Connect, make_grasp: MakeGrasp
) -> None:
    connect()
    reader = connect()
    grasp = make_grasp(0, lost=("s001",) * 50)
    for _ in range(500):
        sink.publish(grasp, None, None)
        assert reader.number() == 0
    assert sink.report().lost > 0
    tracemalloc.start()
    for number in range(2000):
        sink.publish(make_grasp(number), None, None)
        assert reader.number() == number
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 100_000
    assert sink.report().readers == 2


def test_a_slow_reader_loses_whole_lines_and_then_has_the_present(
    sink: SocketLines, connect: Connect, make_grasp: MakeGrasp
) -> None:
    reader = connect()
    for number in range(5000):
        sink.publish(make_grasp(number), None, None)
    assert sink.report().lost > 0
    numbers = [reader.number() for _ in range(sink.report().sent - 1)]
    assert numbers == sorted(set(numbers))
    # Room again: the line that was begun is finished, and then comes what is new.
    sink.publish(make_grasp(5001), None, None)
    sink.publish(make_grasp(5002), None, None)
    newest = numbers[-1]
    while newest < 5002:
        before, newest = newest, reader.number()
        assert newest > before


def test_one_that_leaves_in_the_middle_of_a_line_is_forgotten(
    sink: SocketLines, connect: Connect, make_grasp: MakeGrasp
) -> None:
    stays, leaves = connect(), connect()
    for number in range(3000):
        sink.publish(make_grasp(number), None, None)
        assert stays.number() == number
    assert sink.report().lost > 0  # a line for the other one waits half sent
    leaves.close()
    for number in range(3000, 3004):
        sink.publish(make_grasp(number), None, None)
        assert stays.number() == number
    assert sink.report().readers == 1
    assert sink.report().error == ""


def test_what_readers_say_is_not_listened_to(sink: SocketLines, connect: Connect, make_grasp: MakeGrasp) -> None:
    reader = connect()
    reader.socket.sendall(b"GET / HTTP/1.1\r\n\r\n" * 50)
    reader.socket.shutdown(socket.SHUT_WR)
    sink.publish(make_grasp(1), None, None)
    assert reader.number() == 1


def test_too_many_readers_are_turned_away(sink: SocketLines, connect: Connect, make_grasp: MakeGrasp) -> None:
    readers = []
    for _ in range(MAX_READERS + 1):
        readers.append(connect())
        sink.publish(make_grasp(3), None, None)
    assert sink.report().readers == MAX_READERS
    assert "turned away" in sink.report().error
    assert not sink.report().over
    assert readers[-1].socket.recv(1) == b""
    assert readers[0].number() == 3


def test_closing_ends_every_reader_and_may_be_done_twice(
    sink: SocketLines, connect: Connect, make_grasp: MakeGrasp
) -> None:
    reader = connect()
    sink.publish(make_grasp(1), None, None)
    sink.close()
    sink.close()
    sink.publish(make_grasp(2), None, None)
    assert reader.number() == 1
    assert reader.lines.readline() == b""
    assert sink.report().readers == 0
