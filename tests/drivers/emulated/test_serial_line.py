import os
import threading
from collections.abc import Iterator
from pathlib import Path
from queue import Queue
from time import monotonic

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.emulated.serial_line import Outgoing, PtyLine
from thenar.drivers.errors import DeviceError

BYTE_S = 0.001
GAPS = st.lists(st.tuples(st.integers(0, 60), st.integers(1, 30)), min_size=1, max_size=20)


def drained(outgoing: Outgoing, now: float) -> bytes:
    """Take all that has arrived by `now`, message by message."""
    taken = b""
    while arrived := outgoing.arrived(now):
        outgoing.take(len(arrived))
        taken += arrived
    return taken


@given(GAPS, st.integers(1, 50))
def test_bytes_arrive_on_the_lines_schedule_whatever_wakes_up(messages: list[tuple[int, int]], every: int) -> None:
    """Times in milliseconds, a byte taking one; whoever looks, how often, makes no difference."""
    outgoing, queued, free, ends = Outgoing(BYTE_S, 10_000), 0, 0, []
    for gap, length in messages:
        queued += gap
        free = max(queued, free) + length
        ends += [free - length + byte + 1 for byte in range(length)]
        outgoing.put(queued / 1000, b"x" * length)
    came = 0
    for now in range(0, free + every, every):
        came += len(drained(outgoing, now / 1000))
        assert came == sum(end <= now for end in ends)
    assert came == len(ends)


@given(GAPS, st.integers(10, 100))
def test_of_what_waits_the_oldest_goes_whole_when_there_is_too_much(messages: list[tuple[int, int]], most: int) -> None:
    outgoing = Outgoing(0.0, most)
    sent = [bytes([number]) * length for number, (_, length) in enumerate(messages)]
    for message in sent:
        outgoing.put(0.0, message)
    kept = drained(outgoing, 0.0)
    newest = sent[outgoing.dropped :]
    assert kept == b"".join(newest)
    assert newest
    assert len(kept) <= most or len(newest) == 1
    assert not outgoing.dropped or sum(map(len, sent[outgoing.dropped - 1 :])) > most


def test_damage_changes_what_goes_out_and_how_long_it_takes() -> None:
    outgoing = Outgoing(BYTE_S, 100)
    outgoing.damage = lambda message: b"" if message == b"gone" else message + b"!!"
    for message in (b"gone", b"here", b"gone", b"too"):
        outgoing.put(0.0, message)
    assert drained(outgoing, 0.006) == b"here!!"
    assert drained(outgoing, 0.011) == b"too!!"


def test_what_nobody_took_is_not_made_up_for_in_a_burst() -> None:
    outgoing = Outgoing(BYTE_S, 100)
    outgoing.put(0.0, b"a" * 10)
    outgoing.put(0.0, b"b" * 10)
    assert len(outgoing.arrived(0.005)) == 5
    outgoing.hold(3.0)
    assert drained(outgoing, 3.0) == b"a" * 10
    assert drained(outgoing, 3.004) == b"b" * 4


@pytest.fixture
def link(tmp_path: Path) -> Path:
    return tmp_path / "port"


@pytest.fixture
def line(link: Path) -> Iterator[PtyLine]:
    with PtyLine(link, 1_000_000) as line:
        yield line


def opened(link: Path, baud: int = 115200) -> serial.Serial:
    return serial.serial_for_url(str(link), baud, timeout=5, exclusive=True)


@pytest.mark.parametrize("baud", [9600, 38_400, 115_200])
def test_bytes_take_the_time_that_the_wire_takes(link: Path, baud: int) -> None:
    length = baud // 100  # a tenth of a second
    with PtyLine(link, baud) as line, opened(link, baud) as port:
        began = monotonic()
        for _ in range(10):
            line.send(b"x" * (length // 10))
        assert len(port.read(length // 10 * 10)) == length // 10 * 10
        assert monotonic() - began > 0.09


def test_what_the_client_says_is_heard_as_late_as_from_a_wire(link: Path) -> None:
    heard: Queue[float] = Queue()
    with PtyLine(link, 1200) as line, opened(link) as port:
        line.receive = lambda _: heard.put(monotonic())
        began = monotonic()
        port.write(b"x" * 12)
        assert heard.get(timeout=60) - began >= 0.1


def test_an_unplugged_port_dies_under_its_client_and_its_link_is_gone(line: PtyLine, link: Path) -> None:
    with opened(link) as port:
        line.unplug()
        assert not line.plugged
        assert not link.is_symlink()
        with pytest.raises(serial.SerialException):
            port.read(1)
        with pytest.raises(serial.SerialException):
            port.write(b"x")
    line.send(b"into the air")
    assert line.dropped_messages == 1


def test_a_replugged_port_stands_under_the_same_link_and_forgets_what_waited(link: Path) -> None:
    with PtyLine(link, 600) as line:
        line.send(b"o" * 60)  # takes a second
        line.send(b"l" * 60)
        for _ in range(3):
            line.unplug()
            line.replug()
        line.replug()
        assert line.plugged
        with opened(link) as port:
            line.send(b"new")
            assert port.read(3) == b"new"


def test_it_may_be_unplugged_and_replugged_from_what_receives(line: PtyLine, link: Path) -> None:
    done = threading.Event()

    def receive(data: bytes) -> None:
        line.unplug()
        line.replug()
        done.set()

    line.receive = receive
    with opened(link) as port:
        port.write(b"x")
        assert done.wait(5)
    with opened(link) as port:
        line.send(b"again")
        assert port.read(5) == b"again"


def test_with_nobody_listening_nothing_blocks_and_the_oldest_is_dropped_whole(link: Path) -> None:
    """The kernel keeps some, the line 4096 bytes: a client that comes late finds whole messages, the newest at last."""
    messages = [b"%07d\0" % number for number in range(30_000)]
    with PtyLine(link, paced=False) as line:
        for message in messages:
            line.send(message)
        assert line.dropped_messages > 0
        descriptor = os.open(link, os.O_RDWR | os.O_NOCTTY)
        read = b""
        while not read.endswith(messages[-1]):
            read += os.read(descriptor, 4096)
        os.close(descriptor)
    found = [int(piece) for piece in read.split(b"\0")[:-1]]
    assert found == sorted(set(found))
    assert len(read) % 8 == 0
    assert len(found) + line.dropped_messages == len(messages)


def test_a_link_that_an_earlier_run_left_is_taken_over(line: PtyLine, link: Path) -> None:
    with PtyLine(link) as second, opened(link) as port:
        second.send(b"second")
        assert port.read(6) == b"second"
        line.close()  # the link is not the first line's any more
        assert link.is_symlink()


@pytest.mark.parametrize("kind", ["a file", "a link to another port"])
def test_what_is_no_emulated_port_is_not_replaced(link: Path, kind: str) -> None:
    if kind == "a file":
        link.write_text("mine")
    else:
        link.symlink_to("/dev/null")
    with pytest.raises(DeviceError, match="exists and is not an emulated port"):
        PtyLine(link)
    assert link.exists()


def test_a_place_where_no_link_can_be_made_is_named(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"no/such/port: cannot link a port there: No such file"):
        PtyLine(tmp_path / "no" / "such" / "port")


def test_closing_leaves_no_thread_no_link_and_no_descriptor(link: Path) -> None:
    PtyLine(link).close()
    before = len(list(Path("/proc/self/fd").iterdir())), threading.active_count()
    for _ in range(5):
        PtyLine(link).close()
    assert (len(list(Path("/proc/self/fd").iterdir())), threading.active_count()) == before
    assert list(link.parent.iterdir()) == []
