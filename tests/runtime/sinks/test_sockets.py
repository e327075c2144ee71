"""Lines to several readers at a time, over real sockets: slow, hanging and vanishing ones among them."""

import socket
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count
from time import monotonic

import pytest
from msgspec import json

from thenar.runtime.published import HealthReport, LiveGrasp
from thenar.runtime.sinks import GraspLine, HealthLine, sockets
from thenar.runtime.sinks.sockets import HANGING_S, MAX_READERS, SocketLines, open_tcp

from ...conftest import peak_bytes
from ..conftest import eventually

MakeGrasp = Callable[..., LiveGrasp]


@pytest.fixture
def sink() -> Iterator[SocketLines]:
    made = open_tcp("127.0.0.1:0")
    yield made
    made.close()


class Reader:
    """Connects, and reads lines when told to."""

    def __init__(self, sink: SocketLines) -> None:
        self.socket = socket.create_connection(sink.address)
        self.socket.settimeout(20)
        self.lines = self.socket.makefile("rb")

    def number(self) -> int:
        return json.decode(self.lines.readline(), type=GraspLine).number

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

    def publish() -> None:
        for number in range(2000):
            sink.publish(make_grasp(number), None, None)
            assert reader.number() == number

    assert peak_bytes(publish) < 100_000
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


def test_where_all_keep_up_the_newest_is_turned_away(
    sink: SocketLines, connect: Connect, make_grasp: MakeGrasp
) -> None:
    readers = []
    for _ in range(MAX_READERS + 1):
        readers.append(connect())
        sink.publish(make_grasp(3), None, None)
        assert {reader.number() for reader in readers[:MAX_READERS]} == {3}
    assert sink.report().readers == MAX_READERS
    assert "rejected" in sink.report().error
    assert not sink.report().gone
    assert readers[-1].socket.recv(1) == b""


def hang(sink: SocketLines, connect: Connect, make_grasp: MakeGrasp, many: int) -> list[Reader]:
    """Let in readers that never read, and publish until not one of them takes anything more."""
    hanging = []
    for _ in range(many):
        hanging.append(connect())
        sink.publish(make_grasp(0), None, None)
    sent = -1
    while sent < sink.report().sent:
        sent = sink.report().sent
        for _ in range(20):
            sink.publish(make_grasp(0, lost=("s001",) * 100), None, None)
    return hanging


@pytest.fixture
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let readers hang sooner than after 5 s."""
    assert HANGING_S == 5.0
    monkeypatch.setattr(sockets, "HANGING_S", 0.5)


@pytest.mark.usefixtures("soon")
def test_one_that_takes_nothing_is_dropped_and_counted(
    sink: SocketLines, connect: Connect, make_grasp: MakeGrasp
) -> None:
    [hanging] = hang(sink, connect, make_grasp, 1)
    honest, numbers = connect(), count(1)
    began = monotonic()

    def dropped() -> bool:
        number = next(numbers)
        sink.publish(make_grasp(number), None, None)
        assert honest.number() == number
        return "dropped" in sink.report().error

    eventually(dropped)
    report = sink.report()
    assert monotonic() - began > 0.3
    assert (report.readers, report.error) == (1, "readers dropped that took nothing for 0.5 s: 1")
    # It sees the end.
    with suppress(ConnectionResetError):
        while hanging.socket.recv(1 << 16):
            pass


@pytest.mark.usefixtures("soon")
def test_one_that_takes_a_little_and_one_that_is_sent_nothing_stay(
    sink: SocketLines, connect: Connect, make_grasp: MakeGrasp
) -> None:
    [slow], quiet, numbers = hang(sink, connect, make_grasp, 1), open_tcp("127.0.0.1:0"), count(1)
    with socket.create_connection(quiet.address):
        quiet.publish(make_grasp(0), None, None)
        end = monotonic() + 1.5

        def takes_a_little() -> bool:
            slow.socket.recv(1 << 14)
            sink.publish(make_grasp(next(numbers)), None, None)
            return monotonic() > end

        eventually(takes_a_little)
        quiet.publish(make_grasp(1), None, None)
    for each in (sink, quiet):
        assert (each.report().readers, each.report().error) == (1, "")
    quiet.close()


@pytest.mark.usefixtures("soon")
def test_where_readers_hang_on_every_place_honest_ones_follow(
    sink: SocketLines, connect: Connect, make_grasp: MakeGrasp
) -> None:
    hang(sink, connect, make_grasp, MAX_READERS)
    refused = connect()
    sink.publish(make_grasp(0), None, None)
    assert sink.report().error == "more than 32 readers: the newest were rejected"
    assert refused.socket.recv(1) == b""

    def all_dropped() -> bool:
        sink.publish(make_grasp(0), None, None)
        return not sink.report().readers

    eventually(all_dropped)
    honest: list[Reader] = []
    for number in range(MAX_READERS):
        honest.append(connect())
        sink.publish(make_grasp(number), None, None)
        assert {reader.number() for reader in honest} == {number}
    assert sink.report().readers == MAX_READERS
    assert sink.report().error == f"readers dropped that took nothing for 0.5 s: {MAX_READERS}"


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
