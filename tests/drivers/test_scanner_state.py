from itertools import accumulate

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from thenar.drivers.emulated.scanner import ScannerBoard, read_without_diodes
from thenar.drivers.scanner_protocol import (
    WITHOUT_DIODES,
    Event,
    Faults,
    FrameDecoder,
    FromBoard,
    Heartbeat,
    Hello,
    Lost,
    State,
    from_board,
)
from thenar.drivers.scanner_state import BoardClock, BoardKeys, BoardTimes, ambiguous

MATRICES = st.tuples(st.integers(1, 5), st.integers(1, 5)).flatmap(
    lambda size: st.tuples(st.just(size[0]), st.just(size[1]), st.integers(0, (1 << size[0] * size[1]) - 1))
)


def test_three_corners_of_a_rectangle_make_all_four_doubtful() -> None:
    pressed = 0b0011_0000_0001  # rows of four: key 0, and keys 8 and 9
    read = read_without_diodes(pressed, 3, 4)
    assert read == 0b0011_0000_0011
    assert ambiguous(read, 3, 4) == read


def test_keys_of_one_row_or_one_column_are_sure() -> None:
    assert ambiguous(0b1111, 4, 4) == 0
    assert ambiguous(0b0001_0001_0001, 4, 4) == 0


@given(MATRICES)
def test_what_is_not_doubtful_is_as_pressed(matrix: tuple[int, int, int]) -> None:
    rows, columns, pressed = matrix
    read = read_without_diodes(pressed, rows, columns)
    sure = ~ambiguous(read, rows, columns)
    assert read & sure == pressed & sure
    assert read & pressed == pressed


@given(MATRICES)
def test_what_is_doubtful_reads_closed_and_might_be_open(matrix: tuple[int, int, int]) -> None:
    rows, columns, pressed = matrix
    read = read_without_diodes(pressed, rows, columns)
    doubtful = ambiguous(read, rows, columns)
    assert doubtful & ~read == 0
    for key in range(rows * columns):
        if doubtful >> key & 1:
            assert read_without_diodes(read & ~(1 << key), rows, columns) == read


@given(MATRICES, st.lists(st.integers(0, 24), max_size=2))
def test_two_keys_are_always_right(matrix: tuple[int, int, int], keys: list[int]) -> None:
    rows, columns, _ = matrix
    pressed = sum({1 << key % (rows * columns) for key in keys})
    assert read_without_diodes(pressed, rows, columns) == pressed
    assert ambiguous(pressed, rows, columns) == 0


KEYS = 12
EVERY = (1 << KEYS) - 1
MASKS = st.integers(0, EVERY)
MESSAGES: st.SearchStrategy[FromBoard] = st.one_of(
    st.builds(State, MASKS, st.just(KEYS)),
    st.builds(Heartbeat, st.just(0), MASKS, st.just(KEYS)),
    st.builds(Event, st.just(0), st.integers(0, KEYS - 1), st.integers(0, 1)),
    st.builds(Lost, MASKS, st.just(KEYS)),
    st.just(Faults(0, 0, 0, 0, 0)),
)


def told(keys: BoardKeys, sequence: int, message: FromBoard) -> None:
    keys.numbered(sequence)
    keys.heard(message)


def test_before_a_bitmap_nothing_is_known_and_events_change_nothing() -> None:
    keys = BoardKeys(1, KEYS, sequence=255)
    told(keys, 0, Event(0, 3, 1))
    assert (keys.known, keys.closed, keys.gaps) == (0, 0, 0)
    told(keys, 1, Heartbeat(0, 0b100, KEYS))
    told(keys, 2, Event(0, 0, 1))
    told(keys, 3, Event(0, 2, 0))
    assert (keys.known, keys.closed) == (EVERY, 0b001)
    told(keys, 4, State(0b1000, KEYS))
    assert (keys.known, keys.closed) == (EVERY, 0b1000)


def test_after_a_gap_nothing_is_known_until_the_next_heartbeat() -> None:
    keys = BoardKeys(1, KEYS)
    told(keys, 1, Heartbeat(0, 0b11, KEYS))
    told(keys, 3, Event(0, 5, 1))
    assert (keys.known, keys.gaps) == (0, 1)
    told(keys, 4, Event(0, 5, 0))
    assert keys.known == 0
    told(keys, 5, State(0b10, KEYS))
    assert keys.known == 0, "keys may be lost, of which a STATE says nothing"
    told(keys, 6, Heartbeat(0, 0b1, KEYS))
    assert (keys.known, keys.closed, keys.gaps) == (EVERY, 0b1, 1)


def test_a_heartbeat_right_after_a_gap_does_not_heal_it_since_a_lost_may_be_missing() -> None:
    keys = BoardKeys(1, KEYS)
    told(keys, 77, Heartbeat(0, 0b1, KEYS))
    assert (keys.known, keys.gaps) == (0, 1)
    told(keys, 78, Heartbeat(0, 0b1, KEYS))
    assert (keys.known, keys.gaps) == (EVERY, 1)


def test_keys_that_the_board_cannot_read_are_not_known_until_it_says_so() -> None:
    keys = BoardKeys(1, KEYS)
    told(keys, 1, Lost(0b110, KEYS))
    assert keys.known == 0
    told(keys, 2, Heartbeat(0, 0b11, KEYS))
    assert (keys.known, keys.closed) == (EVERY & ~0b110, 0b11)
    told(keys, 3, Event(0, 1, 0))
    told(keys, 4, Lost(0, KEYS))
    assert (keys.known, keys.closed) == (EVERY, 0b01)


def test_a_heartbeat_that_follows_no_lost_says_that_all_can_be_read() -> None:
    keys = BoardKeys(1, KEYS)
    told(keys, 1, Lost(0b110, KEYS))
    told(keys, 2, Heartbeat(0, 0, KEYS))
    told(keys, 3, Heartbeat(0, 0, KEYS))
    assert keys.known == EVERY


def test_of_a_board_that_restarted_nothing_is_known_even_if_its_numbers_go_on() -> None:
    keys = BoardKeys(1, KEYS, sequence=254)
    told(keys, 255, Heartbeat(0, 0b11, KEYS))
    keys.numbered(0)
    keys.restarted()
    assert keys.known == 0


@given(
    st.lists(st.tuples(MASKS, st.just(0) | MASKS), max_size=30),
    st.sets(st.integers(1, 80)),
    st.integers(1, 9),
    st.booleans(),
)
def test_whatever_frames_are_missing_what_is_known_is_true(
    steps: list[tuple[int, int]], missing: set[int], beat: int, damaged: bool
) -> None:
    """A board tells every change, of keys and of what it can read, and now and then all; nothing else is believed."""
    board, decoder = ScannerBoard(1, KEYS, heartbeat_us=beat), FrameDecoder()
    board.boot(0)
    keys, truth = BoardKeys(1, KEYS), BoardKeys(1, KEYS)
    for now, (closed, unread) in enumerate(steps):
        for received in decoder.feed(b"".join(board.scan(closed, now, unread=unread))):
            message = from_board(received, KEYS)
            truth.numbered(received.sequence)
            truth.heard(message)
            if received.sequence not in missing:
                told(keys, received.sequence, message)
                assert keys.known in (0, truth.known)
                assert keys.closed & keys.known == truth.closed & keys.known
            elif damaged:
                keys.damaged()
                assert keys.known == 0
        assert (truth.known, truth.gaps) == (EVERY & ~unread, 0)
        assert (truth.closed ^ closed) & ~unread == 0


@given(st.integers(0, 255), MESSAGES)
def test_what_could_not_be_read_may_have_been_an_event(sequence: int, message: FromBoard) -> None:
    keys = BoardKeys(1, KEYS, sequence=sequence)
    told(keys, (sequence + 1) & 0xFF, Heartbeat(0, 0b1010, KEYS))
    keys.damaged()
    assert keys.known == 0
    told(keys, (sequence + 2) & 0xFF, message)
    assert keys.known == (EVERY if isinstance(message, State | Heartbeat) else 0)


@given(st.integers(0, 255), MESSAGES)
def test_a_frame_that_could_not_be_read_may_have_been_anything(sequence: int, message: FromBoard) -> None:
    keys = BoardKeys(1, KEYS, sequence=sequence)
    told(keys, (sequence + 1) & 0xFF, Heartbeat(0, 0b1010, KEYS))
    keys.numbered((sequence + 2) & 0xFF)
    keys.misread()
    told(keys, (sequence + 3) & 0xFF, message)
    assert keys.known == 0
    told(keys, (sequence + 4) & 0xFF, Heartbeat(0, 0b1, KEYS))
    assert keys.known == EVERY & ~(message.lost if isinstance(message, Lost) else 0)
    assert keys.gaps == 0


def test_possible_ghosts_of_a_matrix_without_diodes_are_not_known() -> None:
    rectangle = Heartbeat(0, 0b000_011_011, 9)
    for flags, known in ((0, 0b111_111_111), (WITHOUT_DIODES, 0b111_100_100)):
        keys = BoardKeys(3, 3, flags)
        told(keys, 1, rectangle)
        assert keys.known == known


WRAP = 1 << 32
START = 10_000_000_000
# From frame to frame, and how late the host reads it.
SENT = st.lists(st.tuples(st.integers(0, 200_000), st.integers(0, 30_000)), min_size=1, max_size=60)


@given(SENT, st.integers(0, WRAP - 1))
@example([(0, 0), (100_000, 0)], WRAP - 1)
def test_the_time_of_a_frame_is_within_the_delays_of_the_truth_over_any_wrap(
    sent: list[tuple[int, int]], board_at_start: int
) -> None:
    """Never later than it came in; too late by the smallest delay so far and what is forgotten of it at most."""
    clock, now, smallest = BoardClock(), START, 1 << 40
    for passed, delay in sent:
        now += passed
        smallest = min(smallest + passed // 128 + 1, delay)
        time = clock.host_us((board_at_start + now - START) % WRAP, now + delay)
        assert now <= time <= now + smallest


@given(st.integers(-5000, 5000), st.integers(0, 1000))
def test_a_clock_that_runs_wrong_by_half_a_percent_is_followed(millionths: int, seed: int) -> None:
    clock = BoardClock()
    for number in range(400):
        now = number * 50_000
        board = now + now * millionths // 1_000_000
        delay = 1000 + (number * 7919 + seed) % 13 * 500
        time = clock.host_us(board % WRAP, START + now + delay)
        assert START + now - 1 <= time <= START + now + delay


def test_a_backlog_is_as_old_as_it_is_however_long_it_lasts() -> None:
    clock = BoardClock()
    for now in range(0, 1_000_000, 50_000):
        clock.host_us(now, START + now)
    for now in range(1_000_000, 31_000_000, 50_000):
        time = clock.host_us(now, START + now + 6_000_000)
        assert time <= START + now + 30_000_000 // 128


def test_an_answer_is_not_older_than_its_question() -> None:
    clock = BoardClock()
    clock.host_us(0, START)
    # The board's clock stood still for ten seconds: from then on all seems to be ten seconds late.
    assert clock.host_us(1000, START + 10_001_000) < START + 10_000
    assert clock.host_us(2000, START + 10_002_500, asked_us=START + 10_002_000) == START + 10_002_000
    assert clock.host_us(3000, START + 10_003_500) == START + 10_003_007


def test_a_board_that_starts_again_is_followed_at_once() -> None:
    clock = BoardClock()
    clock.host_us(0, START)
    clock.host_us(60_000_000, START + 60_000_000)
    assert clock.host_us(0, START + 62_000_000) == START + 62_000_000
    assert clock.host_us(1000, START + 62_003_000) == START + 62_001_000 + 1000 // 128


# How much later than the one before, how long on its way, and whether it answers a question asked so much before it.
REPLY_BYTES = st.lists(
    st.tuples(st.integers(0, 200_000), st.integers(0, 30_000), st.none() | st.integers(0, 30_000)),
    min_size=1,
    max_size=60,
)


@given(REPLY_BYTES, st.integers(0, WRAP - 1), st.integers(0, 1_000_000), st.integers(-5000, 5000))
@example([(0, 0, 0), (100_000, 0, None)], WRAP - 1, 400_000, 0)
def test_once_a_frame_was_asked_for_the_truth_lies_within_the_trip_whatever_delay_all_frames_share(
    sent: list[tuple[int, int, int | None]], board_at_start: int, shared_us: int, millionths: int
) -> None:
    clock, now, asked = BoardClock(), START, False
    for passed, delay, before in sent:
        now += passed
        board = (board_at_start + now - START + (now - START) * millionths // 1_000_000) % WRAP
        time = clock.host_us(board, now + shared_us + delay, None if before is None else now - before)
        asked |= before is not None
        assert clock.trip_us >= 0
        assert asked or clock.trip_us == 0
        if asked:
            assert time - clock.trip_us <= now + 1 <= time + 2


def test_between_questions_the_trip_grows_no_faster_than_clocks_drift_apart() -> None:
    clock = BoardClock()
    clock.host_us(0, START + 700, START - 300)
    assert clock.trip_us == 1000
    clock.host_us(128_000, START + 128_700)
    assert clock.trip_us == 2000
    clock.host_us(129_000, START + 129_700, START + 128_700)
    assert clock.trip_us == 1000


def test_a_board_that_starts_again_does_so_on_the_same_line() -> None:
    clock = BoardClock()
    clock.host_us(60_000_000, START + 400_000, START)
    assert clock.trip_us == 400_000
    clock.host_us(0, START + 500_000)
    assert clock.trip_us == 400_000
    # The first frame from then on was late by another 50 ms.
    clock.host_us(1000, START + 451_000)
    assert clock.trip_us == 400_000
    clock.host_us(2000, START + 452_000, START + 40_000)
    assert clock.trip_us == 412_000


TIMED_KEYS = 8
START_US = 10_000_000_000
PERIOD_US = 10_000


def beat(time_us: int) -> Heartbeat:
    return Heartbeat(time_us, 0, TIMED_KEYS)


def in_time() -> BoardTimes:
    """Return times that have seen a frame without any delay, sent when both clocks began."""
    times = BoardTimes()
    assert times.stamp(beat(0), START_US) == START_US
    return times


@pytest.mark.parametrize("late_us", [0, 1, 4000, 3_000_000])
@pytest.mark.parametrize("message", [State(0b1, TIMED_KEYS), None], ids=["bitmap", "nothing that could be read"])
def test_what_has_no_time_is_as_late_as_the_last_message_that_has_one(message: FromBoard | None, late_us: int) -> None:
    times = in_time()
    came_us = START_US + PERIOD_US + late_us
    drift_us = PERIOD_US // 128  # which may have been the clocks', and so counts as no delay
    times.stamp(beat(PERIOD_US), came_us)
    assert times.late_us == max(0, late_us - drift_us)
    assert times.stamp(message, came_us + 5000) == came_us + 5000 - times.late_us
    assert times.stamp(message, came_us + 7000) == came_us + 7000 - times.late_us
    assert times.late_us == max(0, late_us - drift_us)


def test_a_bitmap_goes_by_the_last_timed_message_of_any_kind() -> None:
    times = in_time()
    sent: list[tuple[Heartbeat | Event | Faults | Hello, int]] = [
        (beat(100_000), 3000),
        (Event(200_000, 1, 1), 50),
        (Faults(300_000, 0, 0, 0, 0), 900),
        (Hello(1, 0, 0, 1, 1, 0, 0, 1, TIMED_KEYS, 1000, 0, 0, 0, 0, 400_000), 20),
    ]
    # A delay shorter than what the clocks may have drifted by since the last one is none.
    for (message, late_us), counted_us in zip(sent, (2219, 0, 69, 0), strict=True):
        sent_us = START_US + message.time_us
        times.stamp(message, sent_us + late_us)
        assert times.late_us == counted_us
        came_us = sent_us + 20_000
        assert times.stamp(State(0, TIMED_KEYS), came_us) == came_us - counted_us


# A message with a time or without, how long after the one before it was sent, and how much later than that it came.
SENT_MESSAGES = st.lists(
    st.tuples(st.booleans(), st.integers(0, 100_000), st.integers(0, 2_000_000)), min_size=1, max_size=60
)


@given(SENT_MESSAGES)
def test_no_time_goes_back_or_is_later_than_the_message_came_or_earlier_than_its_lateness_says(
    sent: list[tuple[bool, int, int]],
) -> None:
    times, before = in_time(), START_US
    moments = list(accumulate(passed for _, passed, _ in sent))
    came = accumulate((START_US + now + late for now, (_, _, late) in zip(moments, sent, strict=True)), max)
    for now, came_us, (timed, _, _) in zip(moments, came, sent, strict=True):
        time_us = times.stamp(beat(now) if timed else State(0, TIMED_KEYS), came_us)
        assert time_us == max(before, came_us - times.late_us)
        assert time_us <= came_us
        if timed:
            assert time_us >= START_US + now
        before = time_us
