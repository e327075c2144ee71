import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.live.decision import Decision, Ranking

Frame = tuple[int, tuple[int, ...]]

LEAD, DWELL, HOLD = 5, 40, 150

lanes = st.lists(st.integers(100, 112), min_size=3, max_size=3).map(tuple)
steps = st.lists(st.tuples(st.integers(0, 25), lanes), min_size=1, max_size=60)


@given(scores=st.lists(st.integers(0, 65535), min_size=2, max_size=6).map(tuple))
def test_a_ranking_says_what_the_scores_say(scores: tuple[int, ...]) -> None:
    standing = Ranking(scores)
    assert standing.candidate == int(np.argmax(scores))
    assert standing.margin == np.diff(np.sort(scores)[-2:])[0]
    assert [standing.lead(number) for number in range(len(scores))] == [max(scores) - lane for lane in scores]
    for number in range(len(scores)):
        assert standing.contradicts(number, 5) == (scores[number] + 5 <= max(scores) and number != standing.candidate)
    total = math.fsum(standing.probability(number, 3.0) for number in range(len(scores)))
    assert math.isclose(total, 1.0)


def test_a_probability_far_below_all_others_is_zero_and_no_error() -> None:
    standing = Ranking((0, 65535, 7))
    assert [standing.probability(number, 1e-3) for number in range(3)] == [0.0, 1.0, 0.0]


def decide(frames: list[tuple[int, tuple[int, ...]]]) -> list[tuple[int, int, int]]:
    """Time, candidate and decision of every frame; frames come with the time since the one before."""
    decision, time_us, found = Decision(LEAD, DWELL, HOLD), 1000, []
    for wait, scores in frames:
        time_us += wait
        standing = Ranking(scores)
        found.append((time_us, standing.candidate, decision.update(time_us, standing)))
    return found


@given(frames=steps)
def test_it_never_changes_faster_than_the_dwell(frames: list[Frame]) -> None:
    found = decide(frames)
    changes = [after[0] for before, after in pairwise(found) if after[2] != before[2]]
    assert all(later - earlier >= DWELL for earlier, later in pairwise([found[0][0], *changes]))


@given(frames=steps, end=st.permutations([107, 101, 100]).map(tuple), wait=st.integers(1, 60))
def test_a_change_that_persists_is_followed_within_the_dwell(
    frames: list[Frame], end: tuple[int, ...], wait: int
) -> None:
    """At the first frame that is at least the dwell after the change began: a lead of 6 over anybody is enough."""
    lasting = [(wait, end)] * (DWELL // wait + 2)
    found = decide(frames + lasting)[len(frames) :]
    began = found[0][0]
    assert all(decided == end.index(107) for time_us, _, decided in found if time_us - began >= DWELL)


@given(frames=steps)
def test_nothing_is_held_against_the_frames_beyond_its_time(frames: list[Frame]) -> None:
    supported = 0
    for time_us, candidate, decided in decide(frames):
        if candidate == decided:
            supported = time_us
        assert time_us - supported < HOLD


@given(frames=steps)
def test_what_is_decided_on_was_a_candidate(frames: list[Frame]) -> None:
    candidates = set()
    for _, candidate, decided in decide(frames):
        candidates.add(candidate)
        assert decided in candidates


def test_a_small_lead_takes_over_only_after_the_hold() -> None:
    found = decide([(0, (104, 100, 100)), *[(10, (100, 104, 100))] * 20])
    assert next(time_us for time_us, _, decided in found if decided == 1) == 1000 + HOLD
    found = decide([(0, (104, 100, 100)), *[(10, (100, 105, 100))] * 20])
    assert next(time_us for time_us, _, decided in found if decided == 1) == 1010 + DWELL


def test_a_frame_for_the_old_type_begins_the_dwell_anew() -> None:
    old, new = (110, 100, 100), (100, 110, 100)
    found = decide([(0, old), (10, new), (30, new), (5, old), (5, new), (35, new), (5, new)])
    assert [decided for _, _, decided in found] == [0, 0, 0, 0, 0, 0, 1]


@pytest.mark.parametrize("between", [(110, 109, 100), (100, 103, 104)])
def test_a_frame_without_the_lead_begins_the_dwell_anew(between: tuple[int, ...]) -> None:
    old, new = (110, 100, 100), (100, 110, 100)
    found = decide([(0, old), (10, new), (30, between), (20, new), (39, new), (1, new)])
    assert [decided for _, _, decided in found] == [0, 0, 0, 0, 0, 1]


A, B, C = (110, 100, 100), (100, 110, 100), (100, 100, 110)


def follow(frames: Sequence[tuple[int, tuple[int, ...], bool]]) -> list[int]:
    """What is decided after each frame of a time, scores, and whether it is whole."""
    decision = Decision(LEAD, DWELL, HOLD)
    return [decision.update(time_us, Ranking(scores), whole=whole) for time_us, scores, whole in frames]


def test_frames_with_lost_inputs_never_displace_a_decision_on_whole_frames() -> None:
    lost = [(time_us, B, False) for time_us in range(10, HOLD, 10)]
    assert set(follow([(0, A, True), *lost, (HOLD, A, True)])) == {0}


def test_after_the_hold_without_a_whole_frame_frames_with_lost_inputs_decide() -> None:
    """At once, and from then on by hysteresis and dwell among themselves."""
    lost = [(HOLD - 1, B, False), (HOLD, B, False), (HOLD + 10, C, False), (HOLD + 10 + DWELL, C, False)]
    assert follow([(0, A, True), *lost]) == [0, 0, 1, 1, 2]


def test_the_first_whole_frame_displaces_a_degraded_decision_at_once() -> None:
    assert follow([(0, B, False), (10, B, False), (20, A, True)]) == [1, 1, 0]


def test_a_dwell_is_made_of_whole_frames_in_a_row() -> None:
    frames = [(0, A, True), (10, B, True), (10 + DWELL - 1, B, False), (10 + DWELL, B, True)]
    assert follow(frames) == [0, 0, 0, 0]
    assert follow([*frames, (10 + 2 * DWELL, B, True)])[-1] == 1


def test_any_whole_frame_renews_the_decisions_age() -> None:
    """Too old is what had no whole frame for the hold, not what had none for it."""
    frames = [(0, A, True), (HOLD - 1, (100, 104, 100), True), (HOLD + 10, B, False)]
    assert follow(frames) == [0, 0, 0]


def test_what_was_forgotten_is_not_kept_against_frames_with_lost_inputs() -> None:
    decision = Decision(LEAD, DWELL, HOLD)
    decision.update(0, Ranking(A))
    decision.forget()
    assert decision.update(10, Ranking(B), whole=False) == 1
    assert decision.update(20, Ranking(A), whole=True) == 0
