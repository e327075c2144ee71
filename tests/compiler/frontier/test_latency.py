"""Latencies and decisions beside the live recogniser's, beside their definition, and where all can be said ahead."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs

from thenar.compiler.frontier.latency import NOTHING, POLICIES, decided_on, decider_of, decisions, latency
from thenar.compiler.frontier.points import FrontierError
from thenar.compiler.frontier.replay import Replay
from thenar.compiler.movements.segments import Span
from thenar.compiler.movements.streams import Stream
from thenar.runtime.build import Build
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.live.decision import Decision, Ranking
from thenar.runtime.live.recogniser import LiveRecognizer
from thenar.runtime.manifest import Calibration
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.policy import Policy
from thenar.runtime.published import UNKNOWN
from thenar.runtime.scores import LANE_OFFSET

from ...tables import describe

CLASSES, SWITCHES, JOINTS = 4, 7, 3
KINDS = ("single", "dwell", "segments")


def make_tables(seed: int, joints: int = JOINTS) -> IntegerTables:
    random = np.random.default_rng(seed)

    def rows(*shape: int) -> np.ndarray:
        return random.integers(-60, 61, shape).astype(np.int16)

    return IntegerTables.of(
        bias=rows(CLASSES),
        switch_rows=rows(SWITCHES, CLASSES),
        thresholds=tuple(np.sort(random.choice(256, 4, replace=False)).astype(np.uint16) for _ in range(joints)),
        joint_rows=tuple(rows(5, CLASSES) for _ in range(joints)),
        switch_means=rows(SWITCHES, CLASSES),
        joint_means=rows(joints, CLASSES),
        scale=40.0,
    )


def make_replay(
    bits: np.ndarray, codes: np.ndarray, at_us: np.ndarray, end_us: int, grasps: Iterable[tuple[int, int, int]]
) -> Replay:
    stream = Stream(np.arange(len(at_us)), at_us, end_us)
    spans = tuple(Span(*grasp) for grasp in grasps)
    return Replay(bits, codes, np.zeros((len(at_us), 0), np.uint16), stream, spans, "made up")


def make_random_replay(seed: int, grasps: int = 12) -> Replay:
    """Grasps of random states: eight on the way to each, five while it is held, of 1 to 40 ms."""
    random = np.random.default_rng(seed)
    states = 13 * grasps
    at_us = np.cumsum(random.integers(1_000, 40_000, states))
    arrivals = np.arange(grasps) * 13 + 8
    held = np.repeat(random.random((grasps, SWITCHES)) < 0.5, 13, axis=0)
    codes = np.repeat(random.integers(1, 256, (grasps, JOINTS)), 13, axis=0)
    bits = held ^ (random.random((states, SWITCHES)) < 0.2)
    codes = np.clip(codes + random.integers(-20, 21, codes.shape), 1, 255).astype(np.uint16)
    types = random.integers(0, CLASSES, grasps)
    spans = zip(arrivals.tolist(), (arrivals + 5).tolist(), types.tolist(), strict=True)
    return make_replay(bits, codes, at_us.astype(np.int64), int(at_us[-1]) + 30_000, spans)


def make_build(tables: IntegerTables) -> Build:
    joints = tuple(Calibration(n, f"j{n}", "raw", 1, 1.0, 255, 255.0) for n in range(tables.n_joints))
    return Build(structs.replace(describe(tables), joints=joints), tables)


def policy_of(kind: Any, dwell_us: int, hold_us: int = 500_000) -> Policy | None:
    changes: dict[str, Any] = {
        "single": {},
        "dwell": {"dwell_us": dwell_us, "hold_us": hold_us},
    }
    usual = POLICIES[kind]
    return None if usual is None else structs.replace(usual, **changes[kind])


def played_live(tables: IntegerTables, replay: Replay, step_us: int, policy: Policy | None) -> list[str]:
    """The grasp that the live recogniser publishes for every frame, given bytes and masks as devices deliver them, or
    that of the segment that it says is held.
    """
    live = LiveRecognizer(
        make_build(tables),
        sensor_names=tuple(f"j{number}" for number in range(JOINTS)),
        switch_period_us=step_us,
        glove_period_us=step_us if tables.n_joints else None,
        policy=policy or Policy(),
    )
    found = []
    for time_us in range(replay.stream.start_us, replay.stream.end_us, step_us):
        state = int(np.searchsorted(replay.stream.at_us, time_us, side="right")) - 1
        closed = sum(1 << column for column in range(SWITCHES) if replay.bits[state, column])
        glove = GloveFrame(time_us, replay.codes[state].astype(np.uint8).tobytes()) if tables.n_joints else None
        said = live.step(time_us, 0, SwitchFrame(time_us, closed), glove).grasp
        held = said.segment_type if said.state in ("held", "releasing") else UNKNOWN
        found.append(held if policy is None else said.grasp)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("joints", [0, JOINTS])
@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=40)
@given(
    seed=st.integers(0, 999),
    step_us=st.integers(700, 9_000),
    dwell_us=st.integers(0, 60_000),
)
def test_what_is_decided_is_what_the_live_recogniser_publishes(
    kind: Any, joints: int, seed: int, step_us: int, dwell_us: int
) -> None:
    tables, replay = make_tables(seed, joints), make_random_replay(seed, grasps=2)
    policy = policy_of(kind, dwell_us, 70_000)
    live = played_live(tables, replay, step_us, policy)
    found = decided_at(decided_on(tables, replay, step_us, policy), len(live))
    names = [UNKNOWN if number < 0 else f"grasp {number}" for number in found]
    assert names == live


def decided_at(decided: tuple[np.ndarray, np.ndarray], count: int) -> list[int]:
    """Return what is decided on at each of `count` frames."""
    frames, types = decided
    return [int(types[place]) for place in np.searchsorted(frames, np.arange(count), side="right") - 1]


def by_definition(tables: IntegerTables, replay: Replay, step_us: int, policy: Policy | None) -> list[float]:
    """mean, p99, missed and wrong, from every frame's answer and when it is there."""
    decided = decided_on(tables, replay, step_us, policy)
    count = -(-(replay.stream.end_us - replay.stream.start_us) // step_us)
    answers = decided_at(decided, count)
    answered_us = [replay.stream.start_us + (frame + 1) * step_us for frame in range(count)]

    def answer(time_us: int) -> int:
        there = [given for given, at_us in zip(answers, answered_us, strict=True) if at_us <= time_us]
        return there[-1] if there else -1

    waits, wrong, left = [], 0, 0
    at_us, before = [*replay.stream.at_us.tolist(), replay.stream.end_us], -1
    counted = []
    for arrival, end, right in replay.grasps:
        if right != before:
            counted.append((at_us[arrival], at_us[end], right))
        before = right
    for begins_us, ends_us, right in counted:
        moments = [begins_us, *(us for us in answered_us if begins_us < us < ends_us), ends_us]
        at_once = [us for us in moments if answer(us) == right]
        if at_once:
            waits.append(max(at_once[0] - begins_us, step_us))
            spans = [(us, nxt) for us, nxt in pairwise(moments) if us >= at_once[0]]
            wrong += sum(nxt - us for us, nxt in spans if answer(us) not in (right, -1))
            left += ends_us - at_once[0]
    missed = 1 - len(waits) / len(counted)
    return [sum(waits) / len(waits), sorted(waits)[math.ceil(0.99 * len(waits)) - 1], missed, wrong / left]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(5))
def test_latency_follows_its_definition_frame_by_frame(kind: Any, seed: int) -> None:
    tables, replay, policy = make_tables(seed), make_random_replay(seed), policy_of(kind, 15_000)
    found = latency(tables, replay, 2_500.2, policy)
    assert [found.mean_us, found.p99_us, found.missed, found.wrong] == pytest.approx(
        by_definition(tables, replay, 2_500, policy)
    )


def two_grasps(flicker: bool = False) -> tuple[IntegerTables, Replay]:
    """Class 0 for a second, its switch open; class 1 for a second, its switch closed from the arrival on."""
    rows = np.array([[-400, 400]], np.int16)
    none = np.zeros((0, 2), np.int16)
    tables = IntegerTables.of(np.array([200, -200], np.int16), rows, (), (), rows // 2, none, 100.0)
    closed = [False, True, not flicker, True]
    at_us = np.array([0, 1_000_300, 1_500_300, 1_600_300])
    codes = np.zeros((4, 0), np.uint16)
    return tables, make_replay(np.array([closed]).T, codes, at_us, 2_000_300, [(0, 1, 0), (1, 4, 1)])


@pytest.mark.parametrize(
    ("policy", "first", "second"),
    [
        # Frames begin at 0, 1, 2 ... ms: the first that sees class 1 begins 0.7 ms after it, and takes 1 ms.
        (POLICIES["single"], 1_000, 1_700),
        (Policy(dwell_us=50_000, lead=1.0), 1_000, 51_700),
        # Of a tick each 10 ms that of 1010 ms is the first of class 1, and is final 15 ticks later.
        (None, 151_000, 160_700),
    ],
)
def test_latencies_that_can_be_said_ahead(policy: Policy | None, first: int, second: int) -> None:
    tables, replay = two_grasps()
    found = latency(tables, replay, 1_000, policy)
    assert found.p99_us == second
    assert found.mean_us == (first + second) / 2
    assert (found.missed, found.wrong) == (0, 0)


def test_shorter_frames_are_played_once_a_millisecond_and_take_their_own_time() -> None:
    tables, replay = two_grasps()
    found = latency(tables, replay, 200, POLICIES["single"])
    # The frame at 1001 ms is the first that sees the second grasp.
    assert (found.mean_us, found.p99_us) == ((200 + 900) / 2, 900)


def test_where_all_grasps_are_missed_latency_is_how_long_the_longest_lasted() -> None:
    tables, replay = two_grasps()
    found = latency(tables, replay, 3_000_000, POLICIES["single"])
    assert (found.mean_us, found.p99_us, found.missed) == (1_000_300, 1_000_300, 1)


def wrong_class(replay: Replay) -> Replay:
    return replace(replay, grasps=tuple(grasp._replace(state=grasp.state + 9) for grasp in replay.grasps))


def without_grasps(replay: Replay) -> Replay:
    return replace(replay, grasps=())


def without_a_switch(replay: Replay) -> Replay:
    return replace(replay, bits=replay.bits[:, 1:])


def without_a_joint(replay: Replay) -> Replay:
    return replace(replay, codes=replay.codes[:, 1:])


@pytest.mark.parametrize(
    ("change", "frame_us", "says"),
    [
        (without_a_switch, 1_000.0, "tables of 7 switches and 3 joints, for 6 and 3"),
        (without_a_joint, 1_000.0, "tables of 7 switches and 3 joints, for 7 and 2"),
        (wrong_class, 1_000.0, "does not fit 4 types"),
        (None, 0.0, "must take some time"),
        (None, math.nan, "must take some time"),
        (without_grasps, 1_000.0, "no grasp"),
    ],
)
def test_what_does_not_fit_is_refused(change: Callable[[Replay], Replay] | None, frame_us: float, says: str) -> None:
    replay = make_random_replay(0)
    with pytest.raises(FrontierError, match=says):
        latency(make_tables(0), change(replay) if change else replay, frame_us, POLICIES["single"])


DECIDED, SCALE = 3, 4.0
Runs = tuple[np.ndarray, np.ndarray, int]


def bare_tables(classes: int = DECIDED) -> IntegerTables:
    nothing = np.zeros((0, classes), np.int16)
    return IntegerTables.of(np.zeros(classes, np.int16), nothing, (), (), nothing, nothing, SCALE)


def at_each(decided: tuple[np.ndarray, np.ndarray], count: int) -> list[int]:
    frames, types = decided
    return [int(types[place]) for place in np.searchsorted(frames, np.arange(count), side="right") - 1]


def frame_by_frame(runs: Runs, policy: Policy) -> list[int]:
    decider = Decision(policy.lead_steps(SCALE), policy.dwell_us, policy.hold_us)
    scores, at_us, step_us = runs
    found = []
    for time_us in range(0, int(at_us[-1]), step_us):
        state = int(np.searchsorted(at_us, time_us, side="right")) - 1
        held = decider.update(time_us, Ranking(tuple((scores[state] + LANE_OFFSET).tolist())))
        found.append(NOTHING if held is None else held)
    return found


rows = st.tuples(*[st.integers(-9, 9)] * DECIDED)
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
        return standing.biased_scores[0] - LANE_OFFSET

    found = decisions(scores, at_us, step_us, decide)
    assert shown == (due - begins_us).tolist()
    assert not shown or at_each(found, len(due)) == seen.tolist()
