"""Which datagrams are taken, in what order, and what is counted of the others."""

import numpy as np
import pytest

from thenar.drivers import scanner_protocol
from thenar.drivers.errors import SettingError
from thenar.drivers.scanner import Scanner
from thenar.drivers.scanner_datagrams import FROM_BOARD, TO_BOARD, DatagramCounts, Datagrams, scanner_port_fault
from thenar.drivers.scanner_link import Break, Received
from thenar.drivers.scanner_protocol import Event, Frame, frame

SESSION, BOOT = 0xA1B2C3D4, 77


def datagram(number: int, *, session: int = SESSION, boot: int = BOOT, heard: int = 0, before: int = 0) -> bytes:
    whole = scanner_protocol.encode(frame(Event(5, 3, 1), number))
    return FROM_BOARD.pack(0x54, 1, session, boot, number % 2**32, heard, before) + whole


def numbers(received: list[Received]) -> list[int | Break]:
    return [each.sequence if isinstance(each, Frame) else each for each in received]


def taken(*datagrams: bytes) -> tuple[list[int | Break], DatagramCounts]:
    line = Datagrams(SESSION)
    return numbers([each for one in datagrams for each in line.take(one)]), line.counts


def test_what_comes_in_order_is_taken() -> None:
    assert taken(*map(datagram, (5, 6, 7))) == ([5, 6, 7], DatagramCounts())


def test_what_is_missing_is_told_before_the_next() -> None:
    assert taken(*map(datagram, (5, 8, 9))) == ([5, Break.MISSING, 8, 9], DatagramCounts(missing=2))


def test_what_is_late_is_dropped_and_what_comes_twice_too() -> None:
    came = taken(*map(datagram, (5, 7, 6, 6, 7, 8, 5)))
    assert came == ([5, Break.MISSING, 7, 8], DatagramCounts(missing=1, late=1, repeated=3))


def test_numbers_begin_anew_after_2_to_the_32() -> None:
    top = 2**32
    came, counts = taken(*map(datagram, (top - 2, top - 1, top, top - 1, top + 2)))
    assert came == [0xFE, 0xFF, 0, Break.MISSING, 2]
    assert counts == DatagramCounts(missing=1, repeated=1)


@pytest.mark.parametrize("ahead", [200, 256, 512, 1 << 16, (1 << 31) - 1])
def test_what_is_far_ahead_is_newer_and_what_was_before_it_late(ahead: int) -> None:
    """Of 8 bits, 200 ahead would be 56 late, and 256 ahead the same once more."""
    came, counts = taken(datagram(9), datagram(9 + ahead), datagram(10))
    assert came == [9, Break.MISSING, (9 + ahead) & 0xFF]
    assert counts == DatagramCounts(missing=ahead - 1, late=1)


def test_half_the_circle_ahead_is_behind() -> None:
    assert taken(datagram(9), datagram(9 + (1 << 31)))[0] == [9]


def test_a_boot_is_told_and_the_boots_before_it_are_late() -> None:
    came, counts = taken(datagram(500), datagram(0, boot=78), datagram(501), datagram(1, boot=78), datagram(502))
    assert came == [500 & 0xFF, Break.RESTARTED, 0, 1]
    assert counts == DatagramCounts(late=2)


def test_whatever_is_none_of_the_boards_is_foreign() -> None:
    good, random = datagram(5), np.random.default_rng(3)
    wrong = [
        b"",
        good[:-1],
        good[:22],
        good + b"\0",
        good + good[22:],
        b"U" + good[1:],
        good[:1] + b"\2" + good[2:],
        datagram(5, session=SESSION + 1),
        good[:10] + b"\6" + good[11:],
        good[:22] + b"\1" + good[23:],
        good + b"\1" * 300,
        *(random.bytes(int(size)) for size in random.integers(0, 1500, 200)),
    ]
    line = Datagrams(SESSION)
    assert not [each for one in wrong for each in line.take(one)]
    assert line.counts == DatagramCounts(foreign=len(wrong))
    assert numbers(line.take(good)) == [5]


def test_what_the_board_has_heard_is_acknowledged() -> None:
    line = Datagrams(SESSION)
    sent = [line.wrap(b"frame") for _ in range(40)]
    assert [number for number, _ in sent] == list(range(1, 41))
    assert sent[0][1] == TO_BOARD.pack(0x54, 1, SESSION, 1) + b"frame"
    assert not any(line.acknowledged(number) for number, _ in sent)
    line.take(datagram(1, heard=40, before=0b1 << 31 | 0b101))
    assert [number for number, _ in sent if line.acknowledged(number)] == [8, 37, 39, 40]
    line.take(datagram(0, heard=1))
    assert line.acknowledged(40), "what a late one says is over"


def test_memory_is_bounded() -> None:
    line = Datagrams(SESSION)
    for number in range(0, 200_000, 97):
        line.take(datagram(number, boot=number % 50))
    assert line._seen < 1 << 256
    assert len(line._earlier) == 8


@pytest.mark.parametrize(
    "port", ["udp://thenar-1:5253", "udp://192.168.4.1:1/", "udp://[fe80::1%eth0]:5253", "/dev/ttyACM0"]
)
def test_ports_of_boards(port: str) -> None:
    assert scanner_port_fault(port) == ""


@pytest.mark.parametrize(
    "port", ["udp://thenar-1", "udp://:5253", "udp://a:0", "udp://a:65536", "udp:a:1", "udp://a b:1"]
)
def test_texts_that_are_no_ports_of_boards(port: str) -> None:
    assert scanner_port_fault(port)
    with pytest.raises(SettingError, match="is not an address: a board on Wi-Fi is at udp://HOST:PORT"):
        Scanner(port).open()
