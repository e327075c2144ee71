"""The C of a board against drivers.emulated.scanner_board.ScannerBoard: the same bytes at the same times."""

import ctypes
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.firmware.protocol import BoardConfig, protocol_files
from thenar.drivers import scanner_protocol
from thenar.drivers.emulated.scanner import ScannerBoard
from thenar.drivers.scanner_protocol import (
    DEGRADED,
    NO_GRASP,
    Event,
    Faults,
    FromBoard,
    GetState,
    Grasp,
    Heartbeat,
    Hello,
    Lost,
    Ping,
    Segment,
    SetChannels,
    SetDebounce,
    SetRate,
    SetSegments,
    State,
    frame,
    from_board,
)

SharedLibrary = Callable[..., ctypes.CDLL]
WRAP = 1 << 32
LONGEST_US = 1 << 31

PORT = """
#include "thenar_board.h"

bool (*line)(const uint8_t *, uint8_t);

#ifdef THENAR_CHANNELS
uint32_t thenar_port_measure(const uint8_t *wanted_bitmap)
{
    uint32_t sweep_us = 0u;

    for (unsigned channel = 0u; channel < THENAR_CHANNELS; channel++) {
        if (((unsigned)wanted_bitmap[channel / 8u] >> (channel % 8u) & 1u) != 0u) {
            sweep_us += 208u;
        }
    }
    return sweep_us;
}
#endif

bool thenar_port_send(const uint8_t *frame, uint8_t length)
{
    return line(frame, length);
}
"""
Line = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.POINTER(ctypes.c_uint8), ctypes.c_uint8)

CONFIGS = {
    "8 keys": BoardConfig(1, 8),
    "33 keys, states": BoardConfig(3, 11, board=0xFEDCBA98, scan_us=4000, state_us=5000, heartbeat_us=0),
    "300 keys without diodes": BoardConfig(
        20, 15, diodes=False, scan_us=500, heartbeat_us=7000, press_us=5000, release_us=10_000
    ),
    "8 keys and segments": BoardConfig(1, 8, heartbeat_us=7000, segments=True),
    "9 channels beside 12 keys": BoardConfig(1, 12, channels=9),
    "122 channels, without diodes": BoardConfig(2, 4, diodes=False, channels=122),
}


def codes_at(clock_us: int, channels: int) -> list[int]:
    """Return what the channels have at some time: anything."""
    return [(clock_us // 7 + 37 * channel) % 1024 for channel in range(channels)]


class Board:
    """thenar_board.c, and what stands in for its port: what it sent, and whether there is room for more."""

    def __init__(self, shared_library: SharedLibrary, config: BoardConfig) -> None:
        self.config = config
        self.library = shared_library({**protocol_files(config), "port.c": PORT})
        self.library.thenar_board_scan_us.restype = ctypes.c_uint32
        self.library.thenar_board_scanned.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_uint32]
        self._line = Line(self._take)
        ctypes.c_void_p.in_dll(self.library, "line").value = ctypes.cast(self._line, ctypes.c_void_p).value
        self.full = False
        self._sent: list[bytes] = []

    def _take(self, start: "ctypes._Pointer[ctypes.c_uint8]", length: int) -> bool:
        if not self.full:
            self._sent.append(bytes(start[:length]))
        return not self.full

    def sent(self) -> bytes:
        """Return what was sent since the last call."""
        sent, self._sent = b"".join(self._sent), []
        return sent

    def boot(self, clock_us: int) -> bytes:
        self.full = False
        self.library.thenar_board_boot(clock_us)
        return self.sent()

    def receive(self, data: bytes, clock_us: int) -> bytes:
        for byte in data:
            self.library.thenar_board_receive(byte, ctypes.c_uint32(clock_us))
        return self.sent()

    def ready(self) -> None:
        """Start it, and let it scan."""
        self.boot(0)
        self.scan(0, 0)

    def scan(self, closed: int, clock_us: int, *, unread: int = 0) -> bytes:
        keys = self.config.keys
        known = State(((1 << keys) - 1) & ~unread, keys).payload()
        self.library.thenar_board_scanned(State(closed, keys).payload(), known, clock_us % WRAP)
        if self.config.channels:
            codes = codes_at(clock_us % WRAP, self.config.channels)
            array = (ctypes.c_uint16 * len(codes))(*codes)
            self.library.thenar_board_measured(array, ctypes.c_uint32(clock_us % WRAP))
        return self.sent()

    def grasp(self, grasp: int, margin: int, flags: int, clock_us: int) -> bytes:
        self.library.thenar_board_grasp(grasp, margin, flags, ctypes.c_uint32(clock_us))
        return self.sent()

    def segment(self, number: int, grasp: int, state: int, clock_us: int) -> bytes:
        self.library.thenar_board_segment(number, grasp, state, ctypes.c_uint32(clock_us))
        return self.sent()


class Model(ScannerBoard):
    """The emulated board of a configuration; with the rules for telling grasps and segments, and a line that can
    be full.

    What is due, and finds no room, stays due.
    """

    def __init__(self, config: BoardConfig, clock_us: int) -> None:
        how = asdict(config)
        press_us, release_us, _ = (how.pop(name) for name in ("press_us", "release_us", "fastest_us"))
        bits = how.pop("code_bits")
        super().__init__(**how, bits=bits, clock_us=clock_us)
        self.debounce = SetDebounce(press_us, release_us)
        self.full = False
        self.beaten = self.untold = False
        self._grasp = (NO_GRASP, 0)

    def _sent(self, message: FromBoard) -> bytes:
        sent = super()._sent(message)
        beats = isinstance(message, Heartbeat) and not self.full
        self.beaten |= beats
        self.untold = self.full if isinstance(message, Segment) else self.untold or beats
        self.dropped += self.full
        return b"" if self.full else sent

    def _due_state(self, now: int) -> list[bytes]:
        due_at, sent = self._state_at, super()._due_state(now)
        self._state_at = due_at if self.full else self._state_at
        return sent

    def _heartbeat(self, now: int) -> bytes:
        due_at, sent = self._heartbeat_at, super()._heartbeat(now)
        self._heartbeat_at = due_at if self.full else self._heartbeat_at
        return sent

    def _read(self, closed: int) -> int:
        return closed

    def scan(self, closed: int, now: int, *, unread: int = 0) -> list[bytes]:
        self.codes, due_at = codes_at(self._clock(now), self.analog.channels), self._analog_at
        sent = super().scan(closed, now, unread=unread)
        self._analog_at = due_at if self.full else self._analog_at
        return sent

    def grasp(self, grasp: int, margin: int, flags: int, now: int) -> list[bytes]:
        if not self.beaten and self._grasp == (grasp, flags & DEGRADED):
            return []
        self._grasp, self.beaten = (grasp, flags & DEGRADED), self.full
        return self.recognised(grasp, margin, flags, now)

    def segmented(self, number: int, grasp: int, state: int, now: int) -> list[bytes]:
        before = self.segment
        assert before is not None
        self.untold |= (number, grasp, state) != (before.number, before.grasp, before.state)
        return super().segmented(number, grasp, state, now) if self.untold else []


@pytest.fixture(scope="module", params=CONFIGS)
def board(request: pytest.FixtureRequest, shared_library: SharedLibrary) -> Board:
    return Board(shared_library, CONFIGS[request.param])


@pytest.fixture(scope="module")
def eight(shared_library: SharedLibrary) -> Board:
    return Board(shared_library, CONFIGS["8 keys"])


@dataclass(frozen=True)
class Scan:
    """Keys, of which those there are count; those that could not be read."""

    closed: int
    unread: int = 0


@dataclass(frozen=True)
class Received:
    data: bytes


@dataclass(frozen=True)
class Recognised:
    grasp: int
    margin: int
    flags: int


@dataclass(frozen=True)
class Segmented:
    number: int
    grasp: int
    state: int


@dataclass(frozen=True)
class Overrun:
    pass


@dataclass(frozen=True)
class Full:
    full: bool


Step = Scan | Received | Recognised | Segmented | Overrun | Full
PERIODS = st.one_of(
    st.sampled_from([0, 1, 250, 1000, 3000, WRAP - 1]), st.integers(0, 30_000), st.integers(0, WRAP - 1)
)
SHORT = st.integers(0, 0xFFFF)
ASKED = st.one_of(
    st.builds(SetRate, st.sampled_from([0, 500, 1000, 4000, WRAP - 1]), PERIODS, PERIODS),
    st.builds(SetDebounce, SHORT, SHORT),
    st.just(GetState()),
    st.builds(Ping, SHORT),
    st.builds(SetChannels, st.integers(0, 255), PERIODS, st.integers(0, (1 << 128) - 1), st.just(128)),
    st.builds(SetChannels, st.integers(0, 255), PERIODS, st.integers(0, 255), st.just(8)),
    st.builds(SetSegments, st.integers(0, 2)),
).map(lambda message: scanner_protocol.encode(frame(message, 0)))
UNKNOWN = st.builds(scanner_protocol.Frame, st.integers(0, 0x20), st.just(0), st.binary(max_size=20)).map(
    scanner_protocol.encode
)
KEYS = st.one_of(
    st.sampled_from([0, 1, 3]), st.integers(0, (1 << 300) - 1), st.integers(0, 299).map(lambda key: 1 << key)
)
STEPS: st.SearchStrategy[list[tuple[int, Step]]] = st.lists(
    st.tuples(
        st.one_of(st.just(1000), st.integers(0, 60_000), st.sampled_from([0, 1_000_000]), st.integers(0, LONGEST_US)),
        st.one_of(
            st.builds(Scan, KEYS),
            st.builds(Scan, KEYS, st.sampled_from([0, 1 << 5, -1]) | KEYS),
            st.builds(Received, st.one_of(ASKED, ASKED, UNKNOWN, st.binary(max_size=30))),
            st.builds(Recognised, st.sampled_from([0, 1, 255]), SHORT, st.integers(0, 3)),
            st.builds(Segmented, st.integers(0, 2) | SHORT, st.sampled_from([0, 1, 255]), st.integers(0, 3)),
            st.just(Overrun()),
            st.builds(Full, st.booleans()),
        ),
    ),
    max_size=40,
)


def stepped(board: Board, model: Model, step: Step, now: int) -> tuple[bytes, list[bytes]]:
    """Let both take a step, and return what both send."""
    clock = now + model.clock_us
    match step:
        case Scan(closed, unread):
            every = (1 << board.config.keys) - 1
            sent = board.scan(closed & every, clock, unread=unread & every)
            return sent, model.scan(closed & every, now, unread=unread & every)
        case Received(data):
            return board.receive(data, clock), model.receive(data, now)
        case Recognised(grasp, margin, flags):
            return board.grasp(grasp, margin, flags, clock), model.grasp(grasp, margin, flags, now)
        case Segmented(number, grasp, state) if board.config.segments:
            return board.segment(number, grasp, state, clock), model.segmented(number, grasp, state, now)
        case Overrun():
            board.library.thenar_board_overrun()
            model.overruns += 1
        case Full(full):
            board.full = model.full = full
    return board.sent(), []


@given(st.one_of(st.integers(WRAP - 100_000, WRAP - 1), st.integers(0, WRAP - 1)), STEPS)
def test_it_sends_what_the_model_sends_when_the_model_sends_it(
    board: Board, clock_us: int, steps: list[tuple[int, Step]]
) -> None:
    model, now = Model(board.config, clock_us), 0
    assert board.boot(clock_us) == b"".join(model.boot(0))
    for passed, step in steps:
        # Time is told by scans and by sound frames: 71 minutes must not pass without any.
        now += passed if isinstance(step, Scan) else passed % 30_000_000
        sent, expected = stepped(board, model, step, now)
        assert sent == b"".join(expected), step
        assert board.library.thenar_board_scan_us() == model.rate.scan_us


def kinds(sent: bytes) -> list[int]:
    return [received.kind for received in scanner_protocol.FrameDecoder().feed(sent)]


def said(sent: bytes, keys: int = 8) -> list[FromBoard]:
    return [from_board(received, keys) for received in scanner_protocol.FrameDecoder().feed(sent)]


def test_it_begins_with_an_end_and_a_hello(eight: Board) -> None:
    sent = eight.boot(5)
    assert sent.startswith(b"\0")
    (hello,) = said(sent)
    assert isinstance(hello, Hello)
    assert (hello.rows, hello.columns, hello.flags, hello.board, hello.time_us) == (1, 8, 0, 1, 5)


def test_it_says_nothing_of_keys_before_its_first_scan_and_then_all(eight: Board) -> None:
    get_state = scanner_protocol.encode(frame(GetState(), 0))
    eight.boot(0)
    assert eight.receive(get_state, 10) == b""
    assert eight.receive(get_state, 200_000) == b""
    assert said(eight.scan(0b101, 200_010)) == [Heartbeat(200_010, 0b101, 8)]
    assert said(eight.receive(get_state, 200_020)) == [Heartbeat(200_020, 0b101, 8)]


def test_without_heartbeats_too_the_first_scan_tells_all_keys(shared_library: SharedLibrary) -> None:
    board = Board(shared_library, replace(CONFIGS["8 keys"], heartbeat_us=0))
    board.boot(0)
    assert said(board.scan(0b11, 1000)) == [Heartbeat(1000, 0b11, 8)]
    assert board.scan(0b11, 9_000_000) == b""


def test_keys_that_cannot_be_read_are_told_when_they_change_and_before_every_heartbeat(eight: Board) -> None:
    eight.ready()
    eight.scan(0b110, 1000)
    assert said(eight.scan(0, 2000, unread=0b1010)) == [Event(2000, 2, 0), Lost(0b1010, 8)]
    assert eight.scan(0, 3000, unread=0b1010) == b""
    assert said(eight.scan(0, 50_000, unread=0b1010)) == [Lost(0b1010, 8), Heartbeat(50_000, 0b10, 8)]
    assert said(eight.scan(0b10, 51_000, unread=0b1000)) == [Lost(0b1000, 8)]
    assert said(eight.scan(0, 52_000)) == [Event(52_000, 1, 0), Lost(0, 8)]
    assert said(eight.scan(0, 100_000)) == [Heartbeat(100_000, 0, 8)]


def test_keys_that_never_could_be_read_are_told_before_the_first_heartbeat(eight: Board) -> None:
    eight.boot(0)
    assert said(eight.scan(0, 10, unread=0xFF)) == [Lost(0xFF, 8), Heartbeat(10, 0, 8)]


def test_schedules_are_kept_across_the_wrap_of_the_clock(eight: Board) -> None:
    eight.boot(WRAP - 120_000)
    eight.scan(0, WRAP - 120_000)
    beats = [now for now in range(1000, 500_000, 1000) if eight.scan(0, WRAP - 120_000 + now)]
    assert beats == list(range(50_000, 500_000, 50_000))


def test_states_come_in_step_after_a_late_scan(eight: Board) -> None:
    eight.ready()
    eight.receive(scanner_protocol.encode(frame(SetRate(1000, 10_000, 0), 0)), 0)
    told = [now for now in (0, 9_000, 12_000, 19_000, 20_000, 57_000, 59_000, 60_000) if eight.scan(0, now)]
    assert told == [0, 12_000, 20_000, 57_000, 60_000]


def test_schedules_go_on_from_when_the_host_asked(eight: Board) -> None:
    eight.ready()
    eight.scan(0, 1000)
    # The HEARTBEAT that is due at 50000 is sent for the asking, and not again; a new rate begins when it comes in.
    assert said(eight.receive(scanner_protocol.encode(frame(GetState(), 0)), 50_500)) == [Heartbeat(50_500, 0, 8)]
    assert eight.scan(0, 51_000) == b""
    eight.receive(scanner_protocol.encode(frame(SetRate(1000, 10_000, 0), 0)), 57_000)
    assert [now for now in range(60_000, 90_000, 1000) if eight.scan(0, now)] == [60_000, 67_000, 77_000, 87_000]


def test_failed_transactions_are_told_once_a_second(eight: Board) -> None:
    eight.ready()
    eight.receive(scanner_protocol.encode(frame(SetRate(1000, 0, 0), 0)), 0)
    eight.library.thenar_board_bus_fault()
    eight.library.thenar_board_bus_fault()
    assert said(eight.scan(0, 1000)) == [Faults(1000, 0, 0, 0, 2)]
    eight.library.thenar_board_bus_fault()
    assert said(eight.scan(0, 1_000_999)) == []
    assert said(eight.scan(0, 1_001_000)) == [Faults(1_001_000, 0, 0, 0, 3)]
    assert said(eight.scan(0, 9_001_000)) == []


def test_a_frame_that_finds_no_room_leaves_a_gap_in_the_numbers_and_is_counted(eight: Board) -> None:
    eight.ready()
    eight.receive(scanner_protocol.encode(frame(SetRate(1000, 0, 0), 0)), 0)
    eight.full = True
    assert eight.scan(0b1, 1000) == b""
    eight.full = False
    received = scanner_protocol.FrameDecoder().feed(eight.scan(0b11, 1_001_000))
    # HELLO 0, HEARTBEAT 1 and HELLO 2 came; EVENT 3, and ERROR 4 that counted it, were lost.
    assert [one.sequence for one in received] == [5, 6]
    assert [from_board(one, 8) for one in received] == [Event(1_001_000, 1, 1), Faults(1_001_000, 0, 0, 2, 0)]


def test_a_grasp_is_told_when_it_changes_and_after_every_heartbeat(eight: Board) -> None:
    eight.ready()
    told = [
        now
        for now, grasp, flags in [
            (1, 3, 0),  # after the HEARTBEAT at boot
            (2, 3, 0),
            (3, 4, 0),  # another
            (4, 4, 0),
            (5, 4, DEGRADED),  # an input is missing
            (6, 4, DEGRADED),
            (7, NO_GRASP, 0),
            (8, NO_GRASP, 0),
        ]
        if eight.grasp(grasp, 9, flags, now)
    ]
    assert told == [1, 3, 5, 7]
    eight.receive(scanner_protocol.encode(frame(GetState(), 0)), 9)
    assert said(eight.grasp(NO_GRASP, 0xFFFF, DEGRADED, 10)) == [Grasp(10, NO_GRASP, 0xFFFF, DEGRADED)]
    assert eight.grasp(NO_GRASP, 0xFFFF, DEGRADED, 11) == b""


def test_segments_are_told_to_those_who_asked_when_they_change_and_after_every_heartbeat(
    shared_library: SharedLibrary,
) -> None:
    board = Board(shared_library, CONFIGS["8 keys and segments"])
    (hello,) = said(board.boot(0))
    assert isinstance(hello, Hello)
    assert hello.has_segments
    board.scan(0, 0)
    assert board.segment(1, 3, 1, 1) == b""  # an older host cannot read it
    ask = scanner_protocol.encode(frame(SetSegments(1), 0))
    assert said(board.receive(ask, 2)) == [Segment(2, 1, 3, 1)]
    assert board.segment(1, 3, 1, 3) == b""
    assert said(board.segment(1, 3, 2, 4)) == [Segment(4, 1, 3, 2)]
    board.scan(0, 7001)
    assert said(board.segment(1, 3, 2, 7001)) == [Segment(7001, 1, 3, 2)]
    assert said(board.receive(scanner_protocol.encode(frame(SetSegments(0), 0)), 7002)) == [Segment(7002, 1, 3, 2)]
    assert board.segment(2, 3, 2, 7003) == b""


def test_a_grasp_that_finds_no_room_is_told_as_soon_as_there_is_some(shared_library: SharedLibrary) -> None:
    board = Board(shared_library, replace(CONFIGS["8 keys"], heartbeat_us=0))
    board.ready()
    board.grasp(3, 9, 0, 1)
    board.full = True
    assert board.grasp(4, 9, 0, 2) == b""
    board.full = False
    assert said(board.grasp(4, 8, 0, 3)) == [Grasp(3, 4, 8, 0)]
    assert board.grasp(4, 8, 0, 4) == b""


@pytest.mark.parametrize("state_us", [0, 10_000], ids=["HEARTBEAT", "STATE"])
def test_what_is_due_and_finds_no_room_is_due_at_the_next_scan(eight: Board, state_us: int) -> None:
    eight.ready()
    eight.receive(scanner_protocol.encode(frame(SetRate(1000, state_us, 10_000 - state_us), 0)), 0)
    eight.scan(0, 0)
    eight.full = True
    assert eight.scan(0, 10_000) == b""
    eight.full = False
    due = State(0, 8) if state_us else Heartbeat(11_000, 0, 8)
    assert due in said(eight.scan(0, 11_000))
    assert [now for now in range(12_000, 30_000, 1000) if due.KIND in kinds(eight.scan(0, now))] == [20_000]


def test_bits_beyond_the_last_key_are_not_sent(shared_library: SharedLibrary) -> None:
    board = Board(shared_library, replace(CONFIGS["8 keys"], columns=9, state_us=1000, heartbeat_us=0))
    board.boot(0)
    board.library.thenar_board_scanned(b"\xff\xff", b"\0\0", 0)
    assert said(board.sent(), 9) == [State(0, 9), Lost(0x1FF, 9), Heartbeat(0, 0, 9)]
    board.library.thenar_board_scanned(b"\xff\xff", b"\xff\xff", 1000)
    assert said(board.sent(), 9) == [State(0x1FF, 9), Lost(0, 9)]


def test_no_host_makes_it_faster_than_it_can_be(shared_library: SharedLibrary) -> None:
    board = Board(shared_library, replace(CONFIGS["8 keys"], fastest_us=400))
    board.boot(0)
    (hello,) = said(board.receive(scanner_protocol.encode(frame(SetRate(399, 1, 0), 0)), 0))
    assert isinstance(hello, Hello)
    assert (hello.scan_us, hello.state_us, hello.heartbeat_us) == (400, 400, 0)
    assert board.library.thenar_board_scan_us() == 400


def test_debouncing_that_is_asked_for_is_done(eight: Board) -> None:
    eight.boot(0)
    bitmap = ctypes.create_string_buffer(b"\1", 1)
    eight.library.thenar_debounce(bitmap, b"\1", 0)
    eight.receive(scanner_protocol.encode(frame(SetDebounce(5000, 10_000), 0)), 0)
    for now, expected in ((1000, b"\1"), (9000, b"\1"), (12_000, b"\0")):
        bitmap.raw = b"\0"
        eight.library.thenar_debounce(bitmap, b"\1", now)
        assert bitmap.raw == expected


def test_a_key_that_was_lost_is_taken_as_it_is_read_again(eight: Board) -> None:
    """Its release does not wait for what it was before; that of a key that was read all the time does."""
    eight.ready()
    eight.receive(scanner_protocol.encode(frame(SetDebounce(5000, 10_000), 0)), 0)
    bitmap = ctypes.create_string_buffer(1)

    def scan(closed: int, known: int, now: int) -> list[FromBoard]:
        bitmap.raw = bytes([closed])
        eight.library.thenar_board_found(bytes([known]))
        eight.library.thenar_debounce(bitmap, bytes([known]), now)
        return said(eight.scan(bitmap.raw[0], now, unread=0xFF & ~known))

    assert scan(0b11, 0xFF, 1000) == [Event(1000, 0, 1), Event(1000, 1, 1)]
    assert scan(0b11, 0xFF, 11_000) == []
    assert scan(0b10, 0xFE, 12_000) == [Lost(0b1, 8)]
    assert scan(0b00, 0xFF, 13_000) == [Event(13_000, 0, 0), Lost(0, 8)]
    assert scan(0b00, 0xFF, 14_000) == []
    assert scan(0b00, 0xFF, 24_000) == [Event(24_000, 1, 0)]


def test_events_tell_their_key_and_edge(eight: Board) -> None:
    eight.ready()
    assert said(eight.scan(0b1000_0001, 1000)) == [Event(1000, 0, 1), Event(1000, 7, 1)]
    assert said(eight.scan(0b1000_0000, 2000)) == [Event(2000, 0, 0)]
