from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.scanner_protocol import Event, Faults, FromBoard, Heartbeat, Hello, State
from thenar.drivers.scanner_state import BoardTimes

KEYS = 8
START_US = 10_000_000_000
PERIOD_US = 10_000


def beat(time_us: int) -> Heartbeat:
    return Heartbeat(time_us, 0, KEYS)


def in_time() -> BoardTimes:
    """Return times that have seen a frame without any delay, sent when both clocks began."""
    times = BoardTimes()
    assert times.stamp(beat(0), START_US) == START_US
    return times


@pytest.mark.parametrize("late_us", [0, 1, 4000, 3_000_000])
@pytest.mark.parametrize("message", [State(0b1, KEYS), None], ids=["bitmap", "nothing that could be read"])
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
        (Hello(1, 0, 0, 1, 1, 0, 0, 1, KEYS, 1000, 0, 0, 0, 0, 400_000), 20),
    ]
    # A delay shorter than what the clocks may have drifted by since the last one is none.
    for (message, late_us), counted_us in zip(sent, (2219, 0, 69, 0), strict=True):
        sent_us = START_US + message.time_us
        times.stamp(message, sent_us + late_us)
        assert times.late_us == counted_us
        came_us = sent_us + 20_000
        assert times.stamp(State(0, KEYS), came_us) == came_us - counted_us


# A message with a time or without, how long after the one before it was sent, and how much later than that it came.
SENT = st.lists(st.tuples(st.booleans(), st.integers(0, 100_000), st.integers(0, 2_000_000)), min_size=1, max_size=60)


@given(SENT)
def test_no_time_goes_back_or_is_later_than_the_message_came_or_earlier_than_its_lateness_says(
    sent: list[tuple[bool, int, int]],
) -> None:
    times, before = in_time(), START_US
    moments = list(accumulate(passed for _, passed, _ in sent))
    came = accumulate((START_US + now + late for now, (_, _, late) in zip(moments, sent, strict=True)), max)
    for now, came_us, (timed, _, _) in zip(moments, came, sent, strict=True):
        time_us = times.stamp(beat(now) if timed else State(0, KEYS), came_us)
        assert time_us == max(before, came_us - times.late_us)
        assert time_us <= came_us
        if timed:
            assert time_us >= START_US + now
        before = time_us
