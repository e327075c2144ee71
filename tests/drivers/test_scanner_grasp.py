from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic, monotonic_ns

import pytest

from thenar.drivers.emulated.scanner import EmulatedScanner, ScannerBoard
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.drivers.scanner import BoardGrasp, BoardSegment, Scanner
from thenar.drivers.scanner_protocol import DEGRADED, NO_GRASP

KEYS = 12
EVERY = (1 << KEYS) - 1
BAUD = 1_000_000
LONG_S = 60.0


@pytest.fixture
def board(tmp_path: Path) -> Iterator[EmulatedScanner]:
    with PtyLine(tmp_path / "board", BAUD) as line, EmulatedScanner(line, KEYS) as board:
        yield board


@pytest.fixture
def scanner(board: EmulatedScanner) -> Iterator[Scanner]:
    with Scanner(str(board.line.link), BAUD) as scanner:
        yield scanner


def until(scanner: Scanner, there: Callable[[], bool]) -> None:
    end = monotonic() + LONG_S
    while not there():
        assert monotonic() < end, scanner.counts
        scanner.read(0.01)


def test_there_is_no_grasp_of_a_board_that_only_scans(scanner: Scanner) -> None:
    until(scanner, lambda: scanner.counts.frames > 3)
    assert scanner.grasp is None


@pytest.mark.parametrize("flags", [0, DEGRADED, 0xFE])
def test_what_the_board_recognised_is_told_with_its_time(board: EmulatedScanner, scanner: Scanner, flags: int) -> None:
    began = monotonic_ns() // 1000
    board.recognise(5, 291, flags)
    until(scanner, lambda: scanner.grasp is not None)
    assert scanner.grasp is not None
    assert began <= scanner.grasp.time_us <= monotonic_ns() // 1000
    assert scanner.grasp == BoardGrasp(scanner.grasp.time_us, 5, 291, bool(flags & DEGRADED))


def test_no_grasp_has_no_number_and_a_margin_beyond_the_frame_is_the_largest(
    board: EmulatedScanner, scanner: Scanner
) -> None:
    board.recognise(NO_GRASP, 0)
    until(scanner, lambda: scanner.grasp is not None and scanner.grasp.number is None)
    board.recognise(254, 65_536)
    until(scanner, lambda: scanner.grasp is not None and (scanner.grasp.number, scanner.grasp.margin) == (254, 65_535))


def test_the_newest_grasp_is_kept_and_the_keys_stay_trusted(board: EmulatedScanner, scanner: Scanner) -> None:
    reading = None
    for number in range(100):
        board.recognise(number, number)
        board.set(1 << number % KEYS)
    end = monotonic() + LONG_S
    while scanner.grasp is None or scanner.grasp.number != 99 or reading is None or reading.closed != 1 << 99 % KEYS:
        assert monotonic() < end
        if (reading := scanner.read(0.5)) is not None:
            assert reading.known in (0, EVERY)  # 0: before the first bitmap
    assert (scanner.counts.gaps, scanner.counts.misfits) == (0, 0)


def test_a_grasp_alone_says_nothing_of_keys(board: EmulatedScanner, scanner: Scanner) -> None:
    scanner.set_rate(1000, 0, 0)
    until(scanner, lambda: scanner.hello is not None and scanner.hello.heartbeat_us == 0)
    while scanner.read(0.2) is not None:
        pass
    board.recognise(1, 1)
    assert scanner.read(0.3) is None
    assert scanner.grasp is not None


def test_opening_again_forgets_what_was_recognised_before(board: EmulatedScanner, scanner: Scanner) -> None:
    board.recognise(1, 1)
    until(scanner, lambda: scanner.grasp is not None)
    scanner.open()
    assert scanner.grasp is None


def test_segments_are_asked_for_where_the_board_has_them_and_again_after_it_booted(tmp_path: Path) -> None:
    follows = ScannerBoard(1, KEYS, segments=True)
    with PtyLine(tmp_path / "board", BAUD) as line, EmulatedScanner(line, KEYS, board=follows) as board:
        board.segment(1, 4, 2)  # nobody has asked
        with Scanner(str(line.link), BAUD) as scanner:
            until(scanner, lambda: scanner.segment is not None)
            assert scanner.segment is not None
            assert scanner.segment == BoardSegment(scanner.segment.time_us, 1, 4, "held")
            board.segment(1, NO_GRASP, 0)
            until(scanner, lambda: scanner.segment is not None and scanner.segment.state == "none")
            assert scanner.segment[1:] == (1, None, "none")
            assert (scanner.counts.gaps, scanner.counts.misfits) == (0, 0)
            board.reboot()
            until(scanner, lambda: scanner.segment is None)
            until(scanner, lambda: scanner.segment is not None)
            board.segment(1, 2, 1)
            until(scanner, lambda: scanner.segment is not None and scanner.segment[1:] == (1, 2, "forming"))


def test_a_board_without_segments_is_not_asked_for_them(board: EmulatedScanner, scanner: Scanner) -> None:
    until(scanner, lambda: scanner.counts.frames > 10)
    assert (scanner.segment, board.board.refused) == (None, 0)
