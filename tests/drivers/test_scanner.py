import re
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from queue import Queue
from time import monotonic, monotonic_ns
from typing import Any

import numpy as np
import pytest

from thenar.drivers import scanner_protocol
from thenar.drivers.emulated.scanner import EmulatedScanner, ScannerBoard
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.drivers.errors import DeviceError, SettingError
from thenar.drivers.scanner import Scanner, ScannerReading
from thenar.drivers.scanner_protocol import Event, FromBoard, Heartbeat, Hello, SetChannels, State, frame

KEYS = 160
EVERY = (1 << KEYS) - 1
BAUD = 1_000_000
LONG_S = 60.0


@pytest.fixture
def line(tmp_path: Path) -> Iterator[PtyLine]:
    with PtyLine(tmp_path / "board", BAUD) as line:
        yield line


@pytest.fixture
def start(line: PtyLine) -> Iterator[Callable[..., EmulatedScanner]]:
    """Return what starts a board on the line, with ScannerBoard's settings."""
    with ExitStack() as stack:

        def start(rows: int = 1, columns: int = KEYS, **settings: int) -> EmulatedScanner:
            board = ScannerBoard(rows, columns, **settings)  # type: ignore[arg-type]
            return stack.enter_context(EmulatedScanner(line, rows * columns, board=board))

        yield start


def driver(line: PtyLine) -> Scanner:
    return Scanner(str(line.link), BAUD)


def now_us() -> int:
    return monotonic_ns() // 1000


def until(scanner: Scanner, wanted: Callable[[ScannerReading], bool]) -> ScannerReading:
    """Return the first reading that is wanted."""
    end = monotonic() + LONG_S
    while monotonic() < end:
        if (reading := scanner.read(0.5)) is not None and wanted(reading):
            return reading
    raise AssertionError(f"it never came: {scanner.counts}")


def sent(message: FromBoard, number: int) -> bytes:
    return scanner_protocol.encode(frame(message, number))


def test_it_finds_the_board_and_its_keys(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    board = start(2, 20)
    board.set(0b1011)
    with driver(line) as scanner:
        assert scanner.hello is not None
        assert (scanner.hello.rows, scanner.hello.columns, scanner.hello.keys) == (2, 20, 40)
        reading = until(scanner, lambda reading: reading.closed == 0b1011)
        assert reading.known == (1 << 40) - 1


@pytest.mark.parametrize("state_us", [0, 2000])
def test_every_set_of_keys_comes_through_whole_and_in_order(
    line: PtyLine, start: Callable[..., EmulatedScanner], state_us: int
) -> None:
    board, random = start(state_us=state_us, heartbeat_us=20_000), np.random.default_rng(3)
    with driver(line) as scanner:
        for _ in range(30):
            closed = int.from_bytes(random.bytes(KEYS // 8), "little")
            began = now_us()
            board.set(closed)
            reading = until(scanner, lambda reading, closed=closed: reading.closed == closed)  # type: ignore[misc]
            assert reading.known == EVERY
            # An event has a time of its own. A bitmap has none: it counts as late as the last message that has one.
            assert began <= reading.time_us + (scanner.times.late_us if state_us else 0)
            assert reading.time_us <= now_us()
        assert scanner.counts.gaps == 0


def test_times_go_forward_and_are_never_later_than_now(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    start(state_us=1000, heartbeat_us=5000, clock_us=2**32 - 100_000)
    with driver(line) as scanner:
        times = []
        for _ in range(200):
            reading = until(scanner, lambda _: True)
            assert reading.time_us <= now_us()
            times.append(reading.time_us)
        assert times == sorted(times)
        assert times[-1] - times[0] > 100_000


CODES = [1023, 0, 512, None, 7]


def measured(scanner: Scanner, codes: tuple[int | None, ...]) -> ScannerReading:
    return until(scanner, lambda reading: reading.codes == codes)


def test_it_measures_the_channels_that_are_asked_for(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    board = start(1, 8, channels=5)
    board.press(CODES)
    board.set(0b101)
    with driver(line) as scanner:
        assert scanner.hello is not None
        assert scanner.hello.has_analog
        until(scanner, lambda reading: reading.closed == 0b101 and reading.codes is None)
        scanner.set_channels(2000, 0b111010)
        began = now_us()
        reading = measured(scanner, (0, None, 7))
        assert (reading.closed, reading.known) == (0b101, 0xFF)
        assert began <= reading.time_us + scanner.times.clock.trip_us
        assert reading.time_us <= now_us()
        assert scanner.analog is not None
        assert (scanner.analog.channels, scanner.analog.bits, scanner.analog.wanted) == (5, 10, 0b11010)
        scanner.set_channels(2000, 0b00101)
        measured(scanner, (1023, 512))
        board.press([1, 2, 3])
        measured(scanner, (1, 3))
        assert scanner.counts.misfits == 0


def test_keys_go_on_beside_the_codes(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    board = start(1, 8, channels=5)
    with driver(line) as scanner:
        scanner.set_channels(2000, 0b1)
        for closed in (1, 3, 2, 0x80, 0):
            board.set(closed)
            until(scanner, lambda reading, closed=closed: reading.closed == closed)  # type: ignore[misc]
        assert scanner.counts.gaps == 0


def test_no_faster_than_the_converter(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    start(1, 8, channels=5, channel_us=1000)
    with driver(line) as scanner:
        scanner.set_channels(100, 0b11111)
        until(scanner, lambda reading: reading.codes is not None)
        assert scanner.analog is not None
        assert scanner.analog.analog_us == 5000


def test_a_board_that_restarts_measures_again(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    board = start(1, 8, channels=5)
    board.press(CODES)
    with driver(line) as scanner:
        scanner.set_channels(2000, 0b11)
        measured(scanner, (1023, 0))
        board.reboot()
        board.press([5, 6])
        measured(scanner, (5, 6))


def test_channels_are_asked_for_until_they_are_answered(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    start(1, 8, channels=5).press(CODES)
    with driver(line) as scanner:
        kind = scanner_protocol.Channels.KIND
        lost: list[bytes] = []

        def lose(data: bytes) -> bytes:
            if len(lost) < 2 and data[1] == kind:
                lost.append(data)
                return b""
            return data

        line.damage = lose
        scanner.set_channels(2000, 0b11)
        measured(scanner, (1023, 0))
        assert len(lost) == 2


def test_a_board_of_version_1_is_understood_and_has_no_channels(
    line: PtyLine, start: Callable[..., EmulatedScanner]
) -> None:
    board = start(1, 8)
    with driver(line) as scanner:
        assert scanner.hello is not None
        assert not scanner.hello.has_analog
        with pytest.raises(SettingError, match="no analog channels, its firmware speaks version 1"):
            scanner.set_channels(2000, 1)
        assert board.board.receive(scanner_protocol.encode(frame(SetChannels(1, 0, 0, 0), 0)), 0) == []
        assert board.board.refused == 1


def test_a_board_of_version_2_says_nothing_new_to_a_host_of_version_1() -> None:
    """Which takes a HELLO of protocol 1 and 35 bytes, whatever its flags, and counts other kinds as misfits."""
    board = ScannerBoard(1, 8, channels=5)
    board.codes = CODES
    sent = b"".join(board.boot(0))
    for now in range(0, 200_000, 1000):
        sent += b"".join(board.scan(now // 7 & 0xFF, now))
    frames = scanner_protocol.FrameDecoder().feed(sent)
    assert {found.kind for found in frames} == {Hello.KIND, Event.KIND, Heartbeat.KIND}
    assert (frames[0].payload[0], len(frames[0].payload)) == (1, 35)


def test_a_silent_board_times_out_no_earlier_than_asked(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    start(heartbeat_us=0)
    with driver(line) as scanner:
        while scanner.read(0.25) is not None:
            pass  # what it said at boot, and what it was asked for
        began = monotonic()
        assert scanner.read(0.25) is None
        assert monotonic() - began >= 0.25
        assert scanner.read(0.0) is None


def test_a_lost_event_is_known_to_be_lost_and_asked_for(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    """Without heartbeats, which would heal it anyway: the next event shows the gap, GET_STATE fills it."""
    board = start(heartbeat_us=0)
    with driver(line) as scanner:
        until(scanner, lambda reading: reading.known == EVERY)
        asked = scanner.counts.asked
        line.damage = lambda _: b""
        board.set(0b1)
        board.set(0b11)
        gone = threading.Event()
        line.damage = lambda _: (gone.set(), b"")[1]  # type: ignore[func-returns-value]
        board.set(0b111)
        assert gone.wait(LONG_S)
        line.damage = None
        board.set(0b1111)
        doubtful = until(scanner, lambda _: True)
        assert (doubtful.known, doubtful.closed) == (0, 0)
        healed = until(scanner, lambda reading: reading.known == EVERY)
        assert healed.closed == 0b1111
        assert scanner.counts.gaps >= 1
        assert scanner.counts.asked > asked


def test_a_damaged_frame_is_not_trusted_away_before_the_next_one_comes(
    line: PtyLine, start: Callable[..., EmulatedScanner]
) -> None:
    board = start(heartbeat_us=0)
    with driver(line) as scanner:
        until(scanner, lambda reading: reading.known == EVERY)
        line.damage = lambda message: bytes([message[0], message[1] ^ 4]) + message[2:]
        board.set(0b1)
        assert until(scanner, lambda _: True).known == 0
        line.damage = None
        assert until(scanner, lambda reading: reading.known == EVERY).closed == 0b1
        assert scanner.counts.damaged >= 1


@pytest.mark.parametrize("seed", range(3))
def test_through_a_bad_cable_nothing_is_believed_that_is_not_so(
    line: PtyLine, start: Callable[..., EmulatedScanner], seed: int
) -> None:
    """One message in three is cut, swallowed, changed, doubled or grown; only true sets of keys are ever known."""
    board, random = start(heartbeat_us=3000), np.random.default_rng(seed)

    def cable(message: bytes) -> bytes:
        kind, place = int(random.integers(15)), int(random.integers(len(message)))
        changed = bytes([message[place] ^ int(random.integers(1, 256))])
        worse = [b"", message[:place], message[:place] + changed + message[place + 1 :], message[place:] * 2]
        return (*worse, bytes(int(random.integers(1, 50))) + message)[kind] if kind < 5 else message

    truths = [0b1 << n | 0b1 << n + 80 for n in range(40)]
    line.damage = cable
    with driver(line) as scanner:
        for before, truth in pairwise([0, *truths]):

            def arrived(reading: ScannerReading, before: int = before, truth: int = truth) -> bool:
                # The keys of one scan are told one by one: any of the changes may still be on its way.
                assert reading.closed & ~(truth | before) == 0
                assert reading.known in (0, EVERY)
                return (reading.known, reading.closed) == (EVERY, truth)

            board.set(truth)
            until(scanner, arrived)
        counts = scanner.counts
        assert counts.damaged + counts.short + counts.gaps > 0
        line.damage = None
        board.set(EVERY)
        until(scanner, lambda reading: reading.closed == EVERY)


def test_a_board_that_restarts_is_followed(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    board = start(heartbeat_us=10_000)
    with driver(line) as scanner:
        board.set(0b101)
        until(scanner, lambda reading: reading.closed == 0b101)
        board.reboot()
        reading = until(scanner, lambda reading: reading.known == 0 or scanner.counts.gaps > 0)
        assert reading.time_us <= now_us()
        set_us = now_us()
        board.set(0b111)
        reading = until(scanner, lambda reading: reading.closed == 0b111)
        assert set_us - scanner.times.clock.trip_us <= reading.time_us <= now_us()


@pytest.mark.parametrize("settings", [{"heartbeat_us": 10_000}, {"state_us": 2000}, {"heartbeat_us": 0}])
def test_a_board_that_restarts_is_not_believed_before_it_has_scanned(
    line: PtyLine, start: Callable[..., EmulatedScanner], settings: dict[str, Any]
) -> None:
    board = start(**settings)
    board.set(0b101)
    with driver(line) as scanner:
        for _ in range(5):
            board.reboot()
            gaps = scanner.counts.gaps
            end = monotonic() + LONG_S
            while scanner.counts.gaps == gaps:
                assert monotonic() < end
                scanner.read(0.01)
            reading = until(scanner, lambda reading: reading.known != 0)
            assert (reading.closed, reading.known) == (0b101, EVERY)


@pytest.mark.parametrize("settings", [{"heartbeat_us": 10_000}, {"state_us": 2000}, {"heartbeat_us": 0}])
def test_keys_that_the_board_cannot_read_are_not_known_until_it_can(
    line: PtyLine, start: Callable[..., EmulatedScanner], settings: dict[str, Any]
) -> None:
    board = start(**settings)
    with driver(line) as scanner:
        board.set(0b1011)
        until(scanner, lambda reading: reading.closed == 0b1011)
        board.lose(0b110)
        board.set(0b1100)
        reading = until(scanner, lambda reading: reading.closed == 0b1000)
        assert reading.known == EVERY & ~0b110
        board.reboot()
        reading = until(scanner, lambda reading: reading.known == EVERY & ~0b110)
        assert reading.closed == 0b1000
        board.lose(0)
        reading = until(scanner, lambda reading: reading.known == EVERY)
        assert reading.closed == 0b1100


@pytest.mark.parametrize("settings", [{"heartbeat_us": 3000}, {"state_us": 2000, "heartbeat_us": 20_000}])
def test_through_a_bad_cable_keys_that_cannot_be_read_are_never_known(
    line: PtyLine, start: Callable[..., EmulatedScanner], settings: dict[str, Any]
) -> None:
    """One message in three is swallowed. A change is over once it was told; before that the keys are in between."""
    board, random = start(**settings), np.random.default_rng(7)
    line.damage = lambda message: b"" if random.integers(3) == 0 else message
    with driver(line) as scanner:
        for number in range(20):
            lost = EVERY & ~(0b111 << number)
            board.lose(lost)
            until(scanner, lambda reading, lost=lost: reading.known == EVERY & ~lost)  # type: ignore[misc]
            for _ in range(10):
                if (reading := scanner.read(0.01)) is not None:
                    assert reading.known in (0, EVERY & ~lost)
            board.lose(0)
            until(scanner, lambda reading: reading.known == EVERY)


def test_another_board_in_its_place_is_an_error(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    board = start()
    with driver(line) as scanner:
        board.reboot(ScannerBoard(1, 8, board=2))
        with pytest.raises(DeviceError, match="the scanner board is not the one that was opened"):
            until(scanner, lambda _: False)


def test_keys_that_may_be_ghosts_are_not_known(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    board = start(3, 4, diodes=False)
    with driver(line) as scanner:
        board.set(0b0100_0001_0011)
        reading = until(scanner, lambda reading: reading.closed == 0b0100_0000_0000)
        assert reading.known == 0b1111_1100_1100


def test_settings_are_answered_by_a_hello(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    start()
    with driver(line) as scanner:
        scanner.set_rate(500, 2000, 100_000)
        scanner.set_debounce(5000, 10_000)
        until(scanner, lambda _: scanner.hello is not None and scanner.hello.release_us == 10_000)
        assert scanner.hello is not None
        assert (scanner.hello.scan_us, scanner.hello.state_us, scanner.hello.heartbeat_us) == (500, 2000, 100_000)
        assert scanner.hello.press_us == 5000


def test_a_board_that_restarts_is_told_its_settings_again(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    board = start()
    with driver(line) as scanner:

        def state_us() -> int:
            assert scanner.hello is not None
            return scanner.hello.state_us

        scanner.set_rate(500, 2000, 100_000)
        scanner.set_debounce(5000, 10_000)
        until(scanner, lambda _: state_us() == 2000)
        board.reboot()
        until(scanner, lambda _: state_us() == 0)
        until(scanner, lambda _: state_us() == 2000 and scanner.hello is not None and scanner.hello.press_us == 5000)


def test_a_setting_that_no_frame_can_carry_is_refused(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    start()
    with driver(line) as scanner:
        for wrong in (-1, 1 << 32):
            with pytest.raises(SettingError, match="no frame can carry"):
                scanner.set_rate(wrong, 0, 0)


def test_the_troubles_of_the_board_are_heard(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    board = start(heartbeat_us=10_000)
    with driver(line) as scanner:
        board.board.overruns = 3
        until(scanner, lambda _: scanner.faults is not None and scanner.faults.overruns == 3)


def test_unplugged_is_an_error_and_opening_again_the_way_back(
    line: PtyLine, start: Callable[..., EmulatedScanner]
) -> None:
    board = start(heartbeat_us=10_000)
    with driver(line) as scanner:
        until(scanner, lambda reading: reading.known == EVERY)
        line.unplug()
        with pytest.raises(DeviceError, match=re.escape(str(line.link))):
            until(scanner, lambda _: False)
        with pytest.raises(DeviceError, match="there is no such port"):
            scanner.open()
        line.replug()
        board.reboot()
        scanner.open()
        board.set(0b1)
        until(scanner, lambda reading: reading.closed == 0b1)


def test_a_line_without_a_board_is_an_error_that_says_what_came(line: PtyLine) -> None:
    line.receive = lambda _: line.send(b"login: \0")
    with pytest.raises(DeviceError, match=r"no scanner board replied at 1000000 baud in 3 s \(\d+ bytes came, 0 sound"):
        Scanner(str(line.link), BAUD).open()


def test_a_board_of_another_protocol_is_an_error_that_says_so(line: PtyLine) -> None:
    hello = Hello(2, 0, 0, 1, 1, 0, 0, 1, KEYS, 1000, 0, 0, 0, 0, 0)
    line.receive = lambda _: line.send(sent(hello, 0))
    with pytest.raises(DeviceError, match=r"board: the board speaks protocol 2"):
        Scanner(str(line.link), BAUD).open()


def test_a_board_that_is_not_open_cannot_be_read(tmp_path: Path) -> None:
    scanner = Scanner(str(tmp_path / "nothing"))
    scanner.close()
    with pytest.raises(DeviceError, match="is not open"):
        scanner.read(0)
    assert scanner.counts.frames == 0


class Scripted:
    """A board that says what it is told to, when it is told to, and notes what it is asked."""

    def __init__(self, line: PtyLine) -> None:
        self.line, self.number, self.asked = line, 0, Queue[scanner_protocol.Frame]()
        self.answers_pings = True
        self._decoder = scanner_protocol.FrameDecoder()
        line.receive = self._receive

    def say(self, message: FromBoard) -> None:
        self.line.send(sent(message, self.number))
        self.number += 1

    def hello(self, token: int, time_us: int) -> Hello:
        return Hello(1, 0, token, 1, 1, 0, 0, 1, KEYS, 1000, 0, 0, 0, 0, time_us % 2**32)

    def _receive(self, data: bytes) -> None:
        for received in self._decoder.feed(data):
            self.asked.put(received)
            if received.kind == 0x14 and self.answers_pings:
                self.say(self.hello(int.from_bytes(received.payload, "little"), 0))


def test_a_backlog_keeps_its_age_and_states_share_that_of_the_frame_before(line: PtyLine) -> None:
    """A host that was held up for a second reads what was sent then: it must not take it for new."""
    board = Scripted(line)
    with driver(line) as scanner:
        opened_us = now_us()
        board.say(Heartbeat(0, 0, KEYS))
        until(scanner, lambda _: True)
        board.answers_pings = False
        # The board's clock says that only 10 ms passed since the HELLO; it is more by now, so this is late.
        threading.Event().wait(1.1)
        board.say(Heartbeat(10_000, 0b1, KEYS))
        board.say(State(0b11, KEYS))
        beat = until(scanner, lambda reading: reading.closed == 0b1)
        state = until(scanner, lambda reading: reading.closed == 0b11)
        assert beat.time_us < opened_us + 50_000
        assert now_us() - state.time_us > 1_000_000
        assert scanner.counts.pings == 2  # at the opening; and when it was read again


def test_the_state_is_asked_for_again_while_it_does_not_come(line: PtyLine) -> None:
    board = Scripted(line)
    with driver(line) as scanner:
        assert scanner.read(0.5) is None
        assert 3 <= scanner.counts.asked <= 6
    asked = [board.asked.get(timeout=LONG_S).kind for _ in range(1 + 3)]
    assert asked == [0x14, 0x13, 0x13, 0x13]


def test_once_the_state_came_the_next_loss_is_asked_about_without_waiting(
    line: PtyLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("thenar.drivers.scanner._ASK_AGAIN_S", 10 * LONG_S)
    board, end = Scripted(line), monotonic() + LONG_S
    with driver(line) as scanner:
        board.say(Heartbeat(0, 0, KEYS))
        for closed in range(1, 6):
            board.number += 1  # a frame gets lost
            board.say(State(0, KEYS))
            until(scanner, lambda reading: not reading.known)
            while scanner.counts.asked < closed:
                assert monotonic() < end, scanner.counts
                scanner.read(0.01)
            board.say(Heartbeat(0, closed, KEYS))
            while (reading := until(scanner, lambda reading: bool(reading.known))).closed != closed:
                assert monotonic() < end, reading


def test_an_event_out_of_range_is_a_misfit_and_the_state_is_asked_for(line: PtyLine) -> None:
    board = Scripted(line)
    with driver(line) as scanner:
        board.say(Heartbeat(0, 0b1, KEYS))
        assert until(scanner, lambda _: True).known == EVERY
        board.say(Event(0, KEYS, 1))
        assert until(scanner, lambda _: True).known == 0
        assert scanner.counts.misfits == 1
        scanner.read(0.3)
        kinds: list[int] = []
        while kinds.count(0x13) < 2:  # once after opening, once now
            kinds.append(board.asked.get(timeout=LONG_S).kind)


def test_in_a_flood_of_zeros_or_of_noise_reading_comes_to_its_end(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).bytes(4000)
    with PtyLine(tmp_path / "board", paced=False) as line:
        board = Scripted(line)
        with driver(line) as scanner:
            board.answers_pings = False  # one that is lost in the flood would be missed
            stop = threading.Event()

            def flood() -> None:
                while not stop.is_set():
                    line.send(bytes(4000))
                    line.send(noise)

            flooding = threading.Thread(target=flood)
            flooding.start()
            try:
                for _ in range(10):
                    scanner.read(0.05)
                assert scanner.counts.frames < 5
            finally:
                stop.set()
                flooding.join()
            line.send(b"\0")
            board.say(Heartbeat(1, 0b10, KEYS))
            until(scanner, lambda reading: reading.closed == 0b10)


def age_us(scanner: Scanner, reading: ScannerReading) -> int:
    """How old the reading is at most, as far as the driver knows."""
    return now_us() - reading.time_us + scanner.times.clock.trip_us


@pytest.mark.parametrize("settings", [{"heartbeat_us": 10_000}, {"heartbeat_us": 10_000, "state_us": 5000}])
def test_a_delay_that_all_frames_share_shows_in_their_age(
    line: PtyLine, start: Callable[..., EmulatedScanner], settings: dict[str, Any]
) -> None:
    """From the opening on, after the board has started again, and no longer than it lasts."""
    line.delay_s = 0.4
    board = start(1, 40, **settings)
    with driver(line) as scanner:
        for _ in range(20):
            assert age_us(scanner, until(scanner, lambda _: True)) >= 400_000
        board.reboot(ScannerBoard(1, 40, **settings))
        begun_us = now_us()
        while now_us() < begun_us + 800_000:
            if (reading := scanner.read(0.1)) is not None:
                assert age_us(scanner, reading) >= 400_000
        line.delay_s = 0.0
        until(scanner, lambda reading: age_us(scanner, reading) < 100_000)


def test_a_delay_that_begins_while_the_board_is_read_shows_for_as_long_as_it_lasts(
    line: PtyLine, start: Callable[..., EmulatedScanner]
) -> None:
    """The clocks might drift apart and have it forgotten, but for the PINGs."""
    start(1, 40, heartbeat_us=10_000)
    with driver(line) as scanner:
        until(scanner, lambda reading: age_us(scanner, reading) < 100_000)
        line.delay_s, begun_us = 0.2, now_us()
        until(scanner, lambda reading: age_us(scanner, reading) >= 200_000)
        while now_us() < begun_us + 1_500_000:
            if (reading := scanner.read(0.1)) is not None:
                assert age_us(scanner, reading) >= 200_000


def test_the_trip_of_a_good_line_is_that_of_a_ping(line: PtyLine, start: Callable[..., EmulatedScanner]) -> None:
    start(1, 40, heartbeat_us=10_000)
    with driver(line) as scanner:
        found = [until(scanner, lambda _: True) and scanner.times.clock.trip_us for _ in range(100)]
        # PING and HELLO, less the HEARTBEAT, whose way is the shortest there is.
        on_the_wire_us = (8 + 41 - 15) * 10 * 1_000_000 // BAUD
        assert on_the_wire_us <= min(found) < 20_000
