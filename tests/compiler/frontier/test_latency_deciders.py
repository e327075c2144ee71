"""Decisions on runs of equal frames, beside the runtime's deciders."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.frontier.latency import NOTHING, decider_of, decisions
from thenar.runtime.live.decision import Decision, Ranking, SequentialTest
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.policy import Policy
from thenar.runtime.scores import LANE_OFFSET

CLASSES, SCALE = 3, 4.0
Runs = tuple[np.ndarray, np.ndarray, int]


def bare_tables(classes: int = CLASSES) -> IntegerTables:
    nothing = np.zeros((0, classes), np.int16)
    return IntegerTables.of(np.zeros(classes, np.int16), nothing, (), (), nothing, nothing, SCALE)


def at_each(decided: tuple[np.ndarray, np.ndarray], count: int) -> list[int]:
    frames, types = decided
    return [int(types[place]) for place in np.searchsorted(frames, np.arange(count), side="right") - 1]


def frame_by_frame(runs: Runs, policy: Policy) -> list[int]:
    decider: Decision | SequentialTest
    if policy.error_rate is None:
        decider = Decision(policy.lead_steps(SCALE), policy.dwell_us, policy.hold_us)
    else:
        decider = SequentialTest(CLASSES, SCALE, policy.error_rate, policy.hold_us, policy.spacing_us)
    scores, at_us, step_us = runs
    found = []
    for time_us in range(0, int(at_us[-1]), step_us):
        state = int(np.searchsorted(at_us, time_us, side="right")) - 1
        held = decider.update(time_us, Ranking(tuple((scores[state] + LANE_OFFSET).tolist())))
        found.append(NOTHING if held is None else held)
    return found


rows = st.tuples(*[st.integers(-9, 9)] * CLASSES)
times = st.integers(0, 400)


@st.composite
def runs(draw: st.DrawFn) -> Runs:
    """Up to twelve stretches of equal frames: scores, when each begins and the last ends, and the time of a frame."""
    scores = draw(st.lists(rows, min_size=1, max_size=12))
    lengths = draw(st.lists(st.integers(1, 40) | st.integers(100, 300), min_size=len(scores), max_size=len(scores)))
    step_us = draw(st.integers(1, 30))
    return np.array(scores, np.int32), step_us * np.concatenate([[0], np.cumsum(lengths)]), step_us


@st.composite
def policies(draw: st.DrawFn) -> Policy:
    dwell_us = draw(times)
    return Policy(
        lead=draw(st.sampled_from([0.0, 0.3, 1.0, 4.0])),
        dwell_us=dwell_us,
        hold_us=dwell_us + draw(times),
        error_rate=draw(st.sampled_from([None, 0.5, 0.1, 1e-3])),
        spacing_us=draw(st.sampled_from([0, 1, 17, 60, 300])),
    )


@settings(max_examples=50)
@given(runs(), policies())
def test_decisions_of_all_frames_are_those_of_the_runtime(runs: Runs, policy: Policy) -> None:
    expected = frame_by_frame(runs, policy)
    assert at_each(decisions(*runs, decider_of(bare_tables(), policy)), len(expected)) == expected


@given(
    st.lists(st.tuples(st.integers(0, 50), st.integers(0, 2)), min_size=1, max_size=20),
    st.integers(0, 1000),
    st.integers(1, 60),
)
def test_every_frame_sees_the_state_that_began_last(
    given_states: list[tuple[int, int]], begins_us: int, step_us: int
) -> None:
    lengths, values = zip(*given_states, strict=True)
    at_us = begins_us + np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    scores = np.array([[value, 0] for value in values], np.int32)
    due = np.arange(begins_us, at_us[-1], step_us)
    seen = scores[np.searchsorted(at_us, due, side="right") - 1, 0]
    shown: list[int] = []

    def decide(time_us: int, standing: Ranking) -> int:
        shown.append(time_us)
        return standing.lanes[0] - LANE_OFFSET

    found = decisions(scores, at_us, step_us, decide)
    assert shown == (due - begins_us).tolist()
    assert not shown or at_each(found, len(due)) == seen.tolist()
