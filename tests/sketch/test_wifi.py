"""The firmware of a board in a Wi-Fi, as it runs on this machine, through a network that loses, doubles and delays."""

import socket
from collections.abc import Callable
from time import monotonic
from typing import Any

import numpy as np
import pytest

from thenar.drivers import scanner, scanner_datagrams, scanner_protocol
from thenar.drivers.errors import DeviceError
from thenar.drivers.scanner import Scanner, ScannerReading
from thenar.drivers.scanner_datagrams import FROM_BOARD, TO_BOARD
from thenar.drivers.scanner_protocol import Heartbeat, Ping, SetRate, frame

Start = Callable[..., Any]
Connect = Callable[..., Any]

GPIO = (4, 5, 13, 14, 18, 19, 22, 23)
KEYS = len(GPIO)
BOARD = "".join(('part = "esp32"\n[wifi]\n[pins]\n', *(f's{key} = "GPIO{pin}"\n' for key, pin in enumerate(GPIO))))
EVERY = (1 << KEYS) - 1
LONG_S = 20.0
WEATHERS: dict[str, dict[str, float]] = {
    "fair": {},
    "drops": {"dropped": 0.25},
    "doubles": {"doubled": 0.4},
    "delays": {"held": 0.5},
    "storm": {"dropped": 0.2, "doubled": 0.2, "held": 0.4},
}


def toggle(board: Any, key: int, closed: int) -> int:
    """Change one switch, and return which are closed then."""
    closed ^= 1 << key
    board.do(f"wire {GPIO[key]} 255 {closed >> key & 1}")
    return closed


def until(scanner: Scanner, wanted: Callable[[ScannerReading], bool]) -> ScannerReading:
    """Return the first reading that is wanted."""
    end = monotonic() + LONG_S
    while monotonic() < end:
        if (reading := scanner.read(0.5)) is not None and wanted(reading):
            return reading
    raise AssertionError(f"it never came: {scanner.counts}")


def met(scanner: Scanner, wanted: Callable[[], bool]) -> None:
    """Read until something is so."""
    end = monotonic() + LONG_S
    while not wanted():
        scanner.read(0.05)
        assert monotonic() < end, scanner.counts


@pytest.mark.parametrize("weather", WEATHERS)
def test_every_change_comes_through_whatever_becomes_of_datagrams(start: Start, connect: Connect, weather: str) -> None:
    board, random, closed = start(BOARD), np.random.default_rng(11), 0
    network = connect(board, seed=3, **WEATHERS[weather])
    with Scanner(network.url) as host:
        for key in random.integers(0, KEYS, 30):
            before, closed = closed, toggle(board, int(key), closed)
            now = closed
            reading = until(host, lambda reading: reading.known == EVERY and reading.closed == now)  # noqa: B023
            assert reading.time_us > 0
            after = host.read(0.0)
            assert after is None or not after.known or after.closed == now, f"{before:b} is over"
        counts = host.counts
    assert (counts.damaged, counts.misfits, counts.foreign) == (0, 0, 0)
    assert (counts.missing > 0) == (weather in ("drops", "delays", "storm")) or weather == "doubles"
    assert (counts.late > 0) == (weather in ("delays", "storm"))
    assert (counts.repeated > 0) >= (weather == "doubles")
    if weather == "fair":
        assert (counts.gaps, counts.missing, counts.late, counts.repeated) == (0, 0, 0, 0)


def test_no_state_is_told_that_was_not_or_is_over(start: Start, connect: Connect) -> None:
    """Switches change faster than anybody asks. All states are different, so each reading says when it was true.

    The board sends STATEs, for of two switches that change between two scans EVENTs tell in the order of their keys.
    """
    board = start(BOARD.replace("[wifi]", "state_us = 2000\n[wifi]"))
    network = connect(board, seed=9, dropped=0.03, doubled=0.2, held=0.1, late_s=0.02)
    states, seen = [0], [0]

    def note(reading: ScannerReading | None) -> None:
        if reading is not None and reading.known == EVERY:
            seen.append(states.index(reading.closed))

    with Scanner(network.url) as host:
        for number in range(1, 256):  # in the order of Gray's code
            key = (number & -number).bit_length() - 1
            states.append(toggle(board, key, states[-1]))
            note(host.read(0.01))
        while seen[-1] < 255:
            note(until(host, lambda reading: reading.known == EVERY))
    assert seen == sorted(seen), "what was over was told again"
    assert len(set(seen)) > 50
    assert host.counts.missing > 0


def test_times_are_those_of_the_board_however_late_a_datagram_is(start: Start, connect: Connect) -> None:
    network = connect(start(BOARD), seed=5, held=1.0, late_s=0.03)
    with Scanner(network.url) as host:
        times = [until(host, lambda _: True).time_us for _ in range(40)]
        assert times == sorted(times)
        assert host.times.clock.trip_us > 0


def test_settings_are_sent_until_they_are_acknowledged(start: Start, connect: Connect) -> None:
    network = connect(start(BOARD), seed=2)
    with Scanner(network.url) as host:
        network.weather.dropped = 0.6
        host.set_rate(2000, 0, 20_000)
        host.set_debounce(5000, 9000)
        met(host, lambda: host.hello is not None and host.hello.heartbeat_us == 20_000)
        met(host, lambda: host.hello is not None and (host.hello.press_us, host.hello.release_us) == (5000, 9000))
        assert network.lost > 0


def test_a_board_that_boots_is_followed_and_told_again(start: Start, connect: Connect) -> None:
    board = start(BOARD)
    network = connect(board, seed=4)
    with Scanner(network.url) as host:
        host.set_rate(2000, 0, 20_000)
        met(host, lambda: host.hello is not None and host.hello.heartbeat_us == 20_000)
        old = network.last
        board.close()
        board = start(BOARD)
        network.board = int(board.port("udp"))
        closed = toggle(board, 3, 0)
        until(host, lambda reading: reading.known == EVERY and reading.closed == closed)
        met(host, lambda: host.hello is not None and host.hello.heartbeat_us == 20_000)
        late = host.counts.late
        network.forge(old)  # one of the board's last life comes now
        met(host, lambda: host.counts.late > late)
        assert host.counts.foreign == 0


def test_what_others_send_changes_nothing(start: Start, connect: Connect) -> None:
    board, random = start(BOARD), np.random.default_rng(8)
    network = connect(board, seed=6)
    with Scanner(network.url) as host, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        until(host, lambda reading: reading.known == EVERY)
        wished = scanner_protocol.encode(frame(SetRate(9000, 0, 9_000_000), 1))
        there = ("127.0.0.1", int(board.port("udp")))
        for number in range(200):
            stranger.sendto(random.bytes(int(random.integers(0, 1400))), there)
            stranger.sendto(TO_BOARD.pack(0x54, 1, number, 1_000_000) + wished, there)
            stranger.sendto(TO_BOARD.pack(0x54, 1, number, 1_000_000), there)  # a farewell
        lie = scanner_protocol.encode(frame(Heartbeat(1, EVERY, KEYS), 200))
        before = host.counts.foreign
        for number in range(50):  # as from the board, of another session
            network.forge(FROM_BOARD.pack(0x54, 1, number, number, 200, 0, 0) + lie)
            network.forge(random.bytes(int(random.integers(0, 1400))))
        last = network.last
        network.forge(last[:-3])
        network.forge(last + b"\0")
        network.forge(last[:10] + bytes([last[10] ^ 1]) + last[11:])  # its number is not its frame's
        met(host, lambda: host.counts.foreign == before + 103)
        closed = toggle(board, 1, 0)
        until(host, lambda reading: reading.known == EVERY and reading.closed == closed)
        assert host.hello is not None
        assert host.hello.scan_us == 1000
        assert host.counts.gaps == 0


def test_one_host_is_heard_and_the_next_once_it_has_gone(
    start: Start, connect: Connect, monkeypatch: pytest.MonkeyPatch
) -> None:
    board = start(BOARD)
    one, other = connect(board, seed=1), connect(board, seed=2)
    with Scanner(one.url) as host:
        with monkeypatch.context() as patch:
            patch.setattr(scanner, "_BOOT_S", 0.3)
            with pytest.raises(DeviceError, match="the board serves one at a time"):
                Scanner(other.url).open()
        until(host, lambda reading: reading.known == EVERY)
    with Scanner(other.url) as host:
        until(host, lambda reading: reading.known == EVERY)


def test_a_board_that_falls_silent_is_gone(start: Start, connect: Connect, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scanner_datagrams, "_SILENT_S", 0.3)
    network = connect(start(BOARD), seed=1)
    with Scanner(network.url) as host:
        until(host, lambda reading: reading.known == EVERY)
        network.weather.dropped = 1.0
        with pytest.raises(DeviceError, match=r"has sent nothing for 0\.3 s"):
            until(host, lambda _: False)


def test_a_network_that_goes_and_comes_back_is_joined_again(start: Start, connect: Connect) -> None:
    board = start(BOARD)
    network = connect(board, seed=1)
    with Scanner(network.url) as host:
        until(host, lambda reading: reading.known == EVERY)
        before = board.port("udp")
        board.do("wifi 0")
        met(host, lambda: host.read(0.3) is None)
        closed = toggle(board, 2, 0)
        board.do("wifi 1")
        met(host, lambda: board_moved(board, network, before))
        until(host, lambda reading: reading.known == EVERY and reading.closed == closed)
        assert host.hello is not None


def board_moved(board: Any, network: Any, before: str) -> bool:
    """Point the network to where the board listens now, and return whether that is new."""
    board.do("wire 30 31 0")
    network.board = int(board.ports["udp"])
    return bool(board.ports["udp"] != before)


def test_a_name_that_leads_nowhere_is_told() -> None:
    with pytest.raises(DeviceError, match=r"there is no thenar-9\.invalid"):
        Scanner("udp://thenar-9.invalid:5253").open()


def test_a_ping_is_all_that_makes_a_host(start: Start) -> None:
    """Nobody is sent anything before it has sent a whole frame."""
    board = start(BOARD)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as host:
        host.connect(("127.0.0.1", int(board.port("udp"))))
        host.settimeout(LONG_S)
        ping = scanner_protocol.encode(frame(Ping(77), 0))
        for number, wrong in enumerate((b"", ping[:-1], ping + b"\0", ping + ping, ping[:2] + b"\xff" + ping[3:])):
            host.send(TO_BOARD.pack(0x54, 1, 5, number) + wrong)
        host.send(TO_BOARD.pack(0x54, 1, 6, 0xFFFF_FFFF) + ping)
        mark, version, session, _, number, heard, before = FROM_BOARD.unpack_from(host.recv(4096))
        assert (mark, version, session, heard, before) == (0x54, 1, 6, 0xFFFF_FFFF, 0)
        assert number > 0, "frames before that were counted, and went nowhere"
