"""Decisions on runs of equal frames, beside the runtime's deciders."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.frontier.latency import NOTHING, Stretches, decisions, stretches
from thenar.runtime.live.decision import Decision, Ranking, SequentialTest
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.policy import Policy
from thenar.runtime.scores import LANE_OFFSET

CLASSES, SCALE = 3, 4.0


def bare_tables(classes: int = CLASSES) -> IntegerTables:
    nothing = np.zeros((0, classes), np.int16)
    return IntegerTables.of(np.zeros(classes, np.int16), nothing, (), (), nothing, nothing, SCALE)


def frame_by_frame(frames: Stretches, policy: Policy) -> list[int]:
    decider: Decision | SequentialTest
    if policy.error_rate is None:
        decider = Decision(policy.lead_steps(SCALE), policy.dwell_us, policy.hold_us)
    else:
        decider = SequentialTest(CLASSES, SCALE, policy.error_rate, policy.hold_us, policy.spacing_us)
    found = []
    for times, scores in zip(frames.times, frames.scores, strict=True):
        for time_us in times:
            standing = Ranking(tuple((scores + LANE_OFFSET).tolist()))
            held = decider.update(time_us, standing)
            found.append(NOTHING if held is None else held)
    return found


rows = st.tuples(*[st.integers(-9, 9)] * CLASSES)
times = st.integers(0, 400)


@st.composite
def runs(draw: st.DrawFn) -> Stretches:
    """Up to twelve stretches of equal frames."""
    scores = draw(st.lists(rows, min_size=1, max_size=12))
    lengths = draw(st.lists(st.integers(1, 40) | st.integers(100, 300), min_size=len(scores), max_size=len(scores)))
    first = np.concatenate([[0], np.cumsum(lengths)])
    return Stretches(np.array(scores, np.int32), first, draw(st.integers(1, 30)))


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
def test_decisions_of_all_frames_are_those_of_the_runtime(frames: Stretches, policy: Policy) -> None:
    found = decisions(bare_tables(), frames, policy)
    assert found.at(np.arange(frames.first[-1])).tolist() == frame_by_frame(frames, policy)


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
    scores = np.array([[value, 0] for value in (*values, 0)], np.int32)
    frames = stretches(scores, at_us, step_us)
    due = np.arange(begins_us, at_us[-1], step_us)
    seen = scores[np.searchsorted(at_us, due, side="right") - 1]
    assert frames.first[-1] == len(due)
    assert np.repeat(frames.scores, np.diff(frames.first), axis=0).tolist() == seen.tolist()
