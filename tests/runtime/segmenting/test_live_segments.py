"""Live segments are those of the offline decoder on everything up to now, read off a lag ago and at the newest tick."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.published import NONE
from thenar.runtime.segmenting.decoder import GRACE_US, Decoder, LiveSegments, Segment
from thenar.runtime.segmenting.model import SegmentModel

TICK = 10_000
TYPES = ("cup", "pen")
MODEL = SegmentModel(
    shift=0, gain=256, most=60, least=(3, 2, 2), stay=(1, 0, 0), enter=(40, 30), leave=(20, 20), direct=(70, 60)
)
FIRST_US = 123

rows = st.tuples(*[st.sampled_from((0, 0, 20, 60))] * 3)
# A few rows, each for some ticks.
streams = st.lists(st.tuples(rows, st.integers(1, 6)), min_size=1, max_size=10).map(
    lambda runs: [row for row, ticks in runs for _ in range(ticks)]
)


def segments(lag: int) -> LiveSegments:
    return LiveSegments(MODEL, (*TYPES, NONE), lag * TICK)


def expected(stream: Sequence[Any], lag: int) -> list[Segment]:
    """Return the segment at every tick, from paths that are found anew for each."""
    found, number, before = list[Segment](), 0, 2
    for tick in range(len(stream)):
        decoder = Decoder(MODEL, tick + 1)
        for row in stream[: tick + 1]:
            decoder.push(row)
        path = decoder.finish()
        then = tick - lag
        state = path[then] if then >= 0 else 2
        number += state not in (before, 2)
        before = state
        ends = [end for end, (one, other) in enumerate(pairwise(path)) if one != other]
        newest_start = ends[-1] + 1 if ends else 0
        if path[-1] == 2 and state == 2:
            found.append(Segment(number=number))
        elif path[-1] == 2 or (path[-1] == state and newest_start <= then):
            start = max([end + 1 for end in ends if end < then], default=0)
            found.append(segment("releasing" if path[-1] == 2 else "held", number, state, start))
        else:
            found.append(segment("forming", number + 1, path[-1], newest_start))
    return found


def segment(state: Any, number: int, label: int, start: int) -> Segment:
    return Segment(state, number, label, TYPES[label], FIRST_US + TICK * start)


@given(stream=streams, lag=st.integers(0, 8))
def test_the_live_segment_is_the_cheapest_paths(stream: list[Any], lag: int) -> None:
    live = segments(lag)
    assert [live.update(FIRST_US + TICK * tick, row) for tick, row in enumerate(stream)] == expected(stream, lag)


@given(updates=st.lists(st.tuples(st.integers(0, 45_000), rows), min_size=1, max_size=30), lag=st.integers(0, 4))
def test_ticks_take_the_next_update_missed_ones_the_last(updates: list[tuple[int, Any]], lag: int) -> None:
    live, now, taken = segments(lag), FIRST_US, [updates[0][1]]
    live.update(now, updates[0][1])
    for (_, before), (wait, row) in pairwise(updates):
        now += wait
        due = (now - FIRST_US) // TICK + 1 - len(taken)
        taken += [before] * (due - 1) + [row] * (due > 0)
        assert live.update(now, row) == expected(taken, lag)[-1]


HELD = [(60, 0, 0)] * 12
EMPTY = [(0, 0, 60)] * 12


def run(live: LiveSegments, now: int, stream: Sequence[Any]) -> tuple[int, Segment]:
    for row in stream:
        now += TICK
        live.update(now, row)
    return now, live.newest


@pytest.mark.parametrize("silent", [True, False])
def test_a_segment_outlasts_unread_frames_for_a_grace_only(silent: bool) -> None:
    live = segments(3)
    now, begun = run(live, 0, [*EMPTY, *HELD])
    assert (begun.state, begun.number, begun.type) == ("held", 1, "cup")
    for step in range(0, GRACE_US, 7919):
        assert silent or live.update(now + step, None) == begun
    # What is read again within the grace goes on with it.
    now, found = run(live, now + GRACE_US - TICK, HELD)
    assert found == begun
    if not silent:
        assert live.update(now + GRACE_US, None) == begun
        assert live.update(now + GRACE_US + 1, None) == Segment(number=1)
    now, found = run(live, now + GRACE_US + 1, HELD)
    assert (found.state, found.number, found.began_us) == ("held", 2, now - TICK * (len(HELD) - 1))


def test_a_segment_that_only_formed_is_not_counted_when_it_ends_unread() -> None:
    live = segments(8)
    now, found = run(live, 0, [*EMPTY, *HELD[:4]])
    assert (found.state, found.number) == ("forming", 1)
    assert live.update(now + GRACE_US + 1, None) == Segment(number=0)


def test_unread_ticks_are_neither_evidence_nor_segment_time() -> None:
    live, away = segments(2), 300_000
    now, _ = run(live, 0, EMPTY)
    live.update(now + 1, None)
    now, found = run(live, now + away, HELD)
    assert (found.state, found.began_us) == ("held", now - TICK * (len(HELD) - 1))


def test_a_clock_that_begins_anew_begins_afresh() -> None:
    live = segments(2)
    run(live, 10**9, [*EMPTY, *HELD])
    assert run(live, 0, HELD)[1].number == 2
