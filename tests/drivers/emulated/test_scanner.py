import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers import scanner_protocol
from thenar.drivers.emulated.scanner import ScannerBoard
from thenar.drivers.scanner_protocol import (
    WITHOUT_DIODES,
    Event,
    Faults,
    FromBoard,
    GetState,
    Grasp,
    Heartbeat,
    Hello,
    Lost,
    Ping,
    SetDebounce,
    SetRate,
    State,
    ToBoard,
    frame,
    from_board,
)


def said(sent: list[bytes], keys: int = 8) -> list[FromBoard]:
    return [from_board(received, keys) for received in scanner_protocol.FrameDecoder().feed(b"".join(sent))]


def asked(board: ScannerBoard, message: ToBoard, now: int) -> FromBoard:
    (answer,) = said(board.receive(scanner_protocol.encode(frame(message, 0)), now))
    return answer


def run(board: ScannerBoard, until: int) -> list[bytes]:
    """Return what the board sends by itself before `until`."""
    sent: list[bytes] = []
    while (due := board.next_us()) is not None and due < until:
        sent += board.scan(0, due)
    return sent


def scanned(board: ScannerBoard) -> ScannerBoard:
    """Return it as it is once it has booted and scanned."""
    board.boot(0)
    board.scan(0, 0)
    return board


def test_it_begins_with_an_end_and_a_hello_and_tells_all_keys_once_it_has_scanned_them() -> None:
    board = ScannerBoard(2, 4, diodes=False, board=77, heartbeat_us=0)
    sent = board.boot(5)
    assert sent[0].startswith(b"\0")
    (hello,) = said(sent)
    assert isinstance(hello, Hello)
    assert (hello.rows, hello.columns, hello.flags, hello.board, hello.time_us) == (2, 4, WITHOUT_DIODES, 77, 5)
    assert board.next_us() == 5
    assert board.receive(scanner_protocol.encode(frame(GetState(), 0)), 6) == []
    assert said(board.scan(0b101, 7)) == [Heartbeat(7, 0b101, 8)]
    assert board.next_us() is None
    assert asked(board, GetState(), 8) == Heartbeat(8, 0b101, 8)


def test_keys_that_cannot_be_read_keep_their_state_and_are_told_when_they_change_and_before_heartbeats() -> None:
    board = scanned(ScannerBoard(1, 8))
    board.scan(0b110, 1000)
    assert said(board.scan(0, 2000, unread=0b1010)) == [Event(2000, 2, 0), Lost(0b1010, 8)]
    assert said(board.scan(0, 3000, unread=0b1010)) == []
    assert said(board.scan(0, 50_000, unread=0b1010)) == [Lost(0b1010, 8), Heartbeat(50_000, 0b10, 8)]
    get_state = scanner_protocol.encode(frame(GetState(), 0))
    assert said(board.receive(get_state, 50_001)) == [Lost(0b1010, 8), Heartbeat(50_001, 0b10, 8)]
    assert said(board.scan(0b10, 51_000, unread=0b1000)) == [Lost(0b1000, 8)]
    assert said(board.scan(0, 52_000)) == [Event(52_000, 1, 0), Lost(0, 8)]
    assert said(board.scan(0, 100_000)) == [Heartbeat(100_000, 0, 8)]


def test_a_change_is_seen_at_the_next_scan_and_every_key_has_its_event() -> None:
    board = scanned(ScannerBoard(1, 8, heartbeat_us=0))
    assert board.next_us() is None
    board.touch(2500)
    assert board.next_us() == 3000
    assert said(board.scan(0b101, 3000)) == [Event(3000, 0, 1), Event(3000, 2, 1)]
    assert said(board.scan(0b001, 4000)) == [Event(4000, 2, 0)]
    assert board.next_us() is None


@pytest.mark.parametrize("period_us", [2000, 7000])
def test_heartbeats_and_states_keep_their_schedule(period_us: int) -> None:
    beating, streaming = (
        ScannerBoard(1, 8, heartbeat_us=period_us),
        ScannerBoard(1, 8, state_us=period_us, heartbeat_us=0),
    )
    assert len(said(beating.boot(0) + run(beating, 100 * period_us))) == 1 + 100
    streaming.boot(0)
    first, heartbeat, *states = said(run(streaming, 100 * period_us))
    assert heartbeat == Heartbeat(0, 0, 8)
    assert [first, *states] == [State(0, 8)] * 100
    late = streaming.scan(0, 100 * period_us + period_us // 2)
    assert len(late) == 1
    assert streaming.next_us() == 101 * period_us


def test_frames_are_numbered_in_the_order_they_are_sent() -> None:
    board = ScannerBoard(1, 8, heartbeat_us=1000)
    sent = b"".join(board.boot(0) + run(board, 300_000))
    numbers = [received.sequence for received in scanner_protocol.FrameDecoder().feed(sent)]
    assert numbers == [number % 256 for number in range(len(numbers))]


def test_commands_are_answered_by_what_holds_from_then_on() -> None:
    board = ScannerBoard(1, 8)
    board.scan(0b11, 1000)
    assert asked(board, GetState(), 7) == Heartbeat(7, 0b11, 8)
    pong = asked(board, Ping(513), 8)
    assert isinstance(pong, Hello)
    assert (pong.token, pong.time_us) == (513, 8)
    rate = asked(board, SetRate(1, 50, 0), 9)
    assert isinstance(rate, Hello)
    assert (rate.scan_us, rate.state_us, rate.heartbeat_us, rate.token) == (100, 100, 0, 0)
    debounce = asked(board, SetDebounce(5000, 10_000), 10)
    assert isinstance(debounce, Hello)
    assert (debounce.press_us, debounce.release_us) == (5000, 10_000)


def test_what_it_cannot_understand_is_counted_and_told_once_a_second() -> None:
    board = scanned(ScannerBoard(1, 8, heartbeat_us=0))
    damaged = b"\x05nonsense\0"
    unknown = scanner_protocol.encode(scanner_protocol.Frame(0x77, 0, b""))
    assert board.receive(damaged + unknown, 0) == []
    assert board.next_us() == 0
    assert said(board.scan(0, 10)) == [Faults(10, 0, 2, 0, 0)]
    assert board.next_us() is None
    board.receive(damaged, 20)
    assert board.next_us() == 1_000_010
    assert said(board.scan(0, 30)) == []
    assert said(board.scan(0, 1_000_010)) == [Faults(1_000_010, 0, 3, 0, 0)]


def test_what_it_recognises_is_sent_with_the_time_and_no_margin_is_too_large() -> None:
    board = ScannerBoard(1, 8, clock_us=0xFFFFFFFF)
    assert said(board.recognised(3, 70_000, 2, 5)) == [Grasp(4, 3, 0xFFFF, 2)]


def test_its_clock_wraps() -> None:
    board = scanned(ScannerBoard(1, 8, clock_us=2**32 - 10))
    assert asked(board, GetState(), 30) == Heartbeat(20, 0, 8)


def test_a_matrix_without_diodes_reads_ghosts() -> None:
    board = ScannerBoard(2, 4, diodes=False)
    board.scan(0b0001_0011, 1000)
    assert asked(board, GetState(), 1000) == Heartbeat(1000, 0b0011_0011, 8)


@given(st.binary(max_size=600))
def test_bytes_from_the_line_never_raise(data: bytes) -> None:
    board = ScannerBoard(1, 8)
    said(board.receive(data, 0))
    board.receive(b"\0", 0)
    assert isinstance(asked(board, Ping(1), 0), Hello)
