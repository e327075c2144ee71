from hypothesis import example, given
from hypothesis import strategies as st

from thenar.drivers.scanner_state import BoardClock

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
ANSWERED = st.lists(
    st.tuples(st.integers(0, 200_000), st.integers(0, 30_000), st.none() | st.integers(0, 30_000)),
    min_size=1,
    max_size=60,
)


@given(ANSWERED, st.integers(0, WRAP - 1), st.integers(0, 1_000_000), st.integers(-5000, 5000))
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
