"""Every way by which lines come, against an emulated sender at its other end."""

import contextlib
import os
import socket
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from time import monotonic, monotonic_ns

import pytest

from thenar.drivers.emulated.ble import EmulatedPeripheral
from thenar.drivers.emulated.lines import BoardSender, DatagramLines, LineSender, LineServer, lines_like
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.drivers.errors import DeviceError, SettingError
from thenar.drivers.lines import Row
from thenar.drivers.readers import LineReader
from thenar.drivers.transports import line_port_fault

from . import bumble_backend

LONG_S = 10.0
Send = Callable[[bytes], None]


@pytest.fixture(params=["serial", "tcp://h:1", "udp://h:1", "ble"])
def way(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, Send]]:
    if request.param == "ble":
        with EmulatedPeripheral("lines") as peripheral:
            bumble_backend.use(monkeypatch, peripheral.hci)
            yield "ble://lines", peripheral.send
        return
    if request.param == "serial":
        with PtyLine(tmp_path / "port") as line:
            yield str(line.link), line.send
        return
    with contextlib.closing(lines_like(request.param)) as sender:
        yield sender.port, sender.send


def heard(reader: LineReader, rows: int) -> list[Row]:
    end, found = monotonic() + LONG_S, list[Row]()
    while len(found) < rows:
        assert monotonic() < end
        found += reader.read(0.1)
    return found


def test_the_same_rows_come_by_every_way(way: tuple[str, Send]) -> None:
    port, send = way
    with LineReader(port) as reader, LineSender(send, ("ms", "a", "b"), 200, "ms", "ms") as sender:
        reader.open()
        sender.show({"a": 1, "b": 0.25})
        last = heard(reader, 20)[-1]
        assert (last.names, last.values[1:]) == (None, (1, 0.25))
        reader.close()
        reader.open()
        assert heard(reader, 2)


def test_a_sender_may_name_its_columns(way: tuple[str, Send]) -> None:
    port, send = way
    with LineReader(port) as reader, LineSender(send, ("a", "b, c"), 200, None, "ms", named=True):
        reader.open()
        last = heard(reader, 300)[-1]  # the header comes once a second
        assert (last.names, last.values) == (("a", "b, c"), (0.0, 0.0))


def test_a_board_is_emulated_with_names_numbers_and_its_clock(way: tuple[str, Send]) -> None:
    port, send = way
    with LineReader(port) as reader, BoardSender(send, ("a", "b"), ("i",), 200) as sender:
        reader.open()
        sender.show({"b": 1, "i": 511.6})
        rows = heard(reader, 250)
        assert {row.names for row in rows} == {("a", "b", "i")}
        assert list(rows[-1].values) == [0, 1, 512]
        first, times = rows[0].sequence or 0, [row.time_s or 0.0 for row in rows]
        assert [row.sequence for row in rows] == list(range(first, first + len(rows)))
        assert all(earlier < later for earlier, later in pairwise(times))
        assert 1.0 < times[-1] - times[0] < LONG_S
        assert reader.counts().damaged <= 1  # cut by the beginning


def test_a_datagram_holds_several_lines_and_its_last_needs_no_end() -> None:
    with DatagramLines() as sender, LineReader(sender.port) as reader:
        reader.open()
        sender.send(b"1,2\n3,4")
        sender.send(b"5,6")
        assert [row.values for row in heard(reader, 3)] == [(1, 2), (3, 4), (5, 6)]


def datagrams(count: int) -> list[DatagramLines]:
    """Return senders of datagrams to one port."""
    senders = [DatagramLines() for _ in range(count)]
    for sender in senders:
        sender.to = senders[0].to
    return senders


def source_of(sender: DatagramLines) -> tuple[str, int]:
    """Return the address of which its datagrams are, once it has sent one."""
    return "127.0.0.1", int(sender._line.getsockname()[1])


def test_a_second_sender_counts_only_after_the_first_is_silent() -> None:
    with contextlib.ExitStack() as stack:
        first, second = (stack.enter_context(sender) for sender in datagrams(2))
        reader = stack.enter_context(LineReader(first.port))
        reader.open()
        for sender in (first, second, first):
            sender.send(b"a,b\n1,2" if sender is first else b"c,d\n3,4\n5,6")
        assert [row.names for row in heard(reader, 2)] == [("a", "b")] * 2
        assert reader.counts().foreign == 3
        ours, others = (f"127.0.0.1:{source_of(sender)[1]}" for sender in (first, second))
        assert reader.other_sender() == (
            f"{others} sends, too, and its lines are left out: those of {ours} count; stop it"
        )
        end, rows = monotonic() + LONG_S, list[Row]()
        while not rows:
            assert monotonic() < end
            second.send(b"7,8")
            rows += reader.read(0.05)
        assert rows[0] == Row(None, (7, 8), None, rows[0].came_us)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux dates datagrams")
def test_datagrams_are_dated_when_they_come_not_when_they_are_read() -> None:
    with DatagramLines() as sender, LineReader(sender.port) as reader:
        reader.open()
        end, late_us = monotonic() + LONG_S, 20_000
        while late_us >= 10_000:  # once is enough: this program may be interrupted while it reads two clocks
            assert monotonic() < end
            before_us = monotonic_ns() // 1000
            sender.send(b"1,2")
            sent_us = monotonic_ns() // 1000
            while monotonic_ns() // 1000 < sent_us + 20_000:
                pass
            (row,) = heard(reader, 1)
            assert row.came_us is not None
            late_us = row.came_us - before_us
            assert late_us > -1000  # the clock of the date may be slowed or sped up a little


def test_bytes_without_a_row_are_counted() -> None:
    with DatagramLines() as sender, LineReader(sender.port) as reader:
        reader.open()
        sender.send(b"A512,B300")
        end = monotonic() + LONG_S
        while not reader.received:
            assert monotonic() < end
            assert not reader.read(0.1)
        assert (reader.counts().misfits, reader.odd) == (1, "'A512,B300'")


def test_half_a_line_before_a_break_spoils_no_later_line() -> None:
    with LineServer() as first:
        port = first.port
    with LineReader(port) as reader:
        for last in (b"1,2\n77,", b"3,4\n"):
            with LineServer(int(port.rpartition(":")[2])) as server:
                reader.open()
                while not server._clients:
                    pass
                server.send(last)
                assert heard(reader, 1)[0].values == tuple(map(float, last.split(b"\n")[0].split(b",")))
            with pytest.raises(DeviceError, match="the sender hung up"):
                heard(reader, 2)
            reader.close()


def test_standard_input_is_read_and_its_end_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    out, into = os.pipe()
    with os.fdopen(out) as stdin, LineReader("-") as reader:
        monkeypatch.setattr("sys.stdin", stdin)
        reader.open()
        os.write(into, b"1,2\n")
        os.close(into)
        assert heard(reader, 1) == [Row(None, (1, 2))]
        with pytest.raises(DeviceError, match="the input has ended"):
            reader.read(LONG_S)


def test_nobody_there_is_a_device_error_that_says_what_to_look_at() -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    taken = DatagramLines()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(taken.to)
        for where, said in (
            (f"tcp://127.0.0.1:{port}", "is the sender running"),
            (taken.port, "close other programs that have the port"),
        ):
            with pytest.raises(DeviceError, match=said):
                LineReader(where).open()
    taken.close()


@pytest.mark.parametrize(
    "port",
    [
        *("", "tcp://:80", "tcp://h", "udp://h:0", "udp://h:99999", "ws://h/", "spy://x"),
        *(
            "ble://",
            "ble:x",
            "ble://a/b",
            "ble://a\n",
            "http://h:1",
            "tcp://a..b:1",
            f"tcp://{'a' * 64}.x:1",
            "udp://.a:1",
        ),
    ],
)
def test_what_is_no_port_is_refused_before_anything_is_opened(port: str) -> None:
    assert line_port_fault(port)
    with pytest.raises(SettingError):
        LineReader(port).open()
