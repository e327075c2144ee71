"""Replays of recorded movements, replays composed of single trials, and which of them a set gets."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.frontier.points import FrontierError
from thenar.compiler.frontier.replay import (
    GRIP_US,
    HOLD_US,
    RECORD_US,
    RELEASE_US,
    TRAVEL_US,
    Replay,
    composed,
    recorded,
    replay_of,
)
from thenar.compiler.recordings.graspset import GraspSet, Joint

from ...sets import grasp_set_of

TYPES = ("cup", "pen", "rod", "ball")
FRAMES = 40


def whole_movements(labels: list[int], codes_too: bool = True) -> GraspSet:
    """Movements of 40 rows: the switches of a type close one by one from row 10 to 15, and open from row 30 on."""
    switches = np.zeros((len(labels), FRAMES, 6), bool)
    for number, label in enumerate(labels):
        for switch in range(6):
            switches[number, 10 + switch : 30 + switch // 3, switch] = switch != label
    way = np.clip(np.arange(FRAMES) / 10, 0, 1)
    codes = 300 - 100 * way[np.newaxis, :, np.newaxis] + 9 * np.array(labels)[:, np.newaxis, np.newaxis]
    return grasp_set_of(
        TYPES,
        np.repeat(labels, FRAMES),
        switches=switches.reshape(-1, 6),
        codes=codes.reshape(-1, 1)[:, : int(codes_too)],
        trials=np.repeat(np.arange(len(labels)), FRAMES),
    )


def single_trials(seed: int, rows: int = 60, joints: int = 3, types: int = 4) -> GraspSet:
    random = np.random.default_rng(seed)
    labels = random.permutation(np.arange(rows) % types)
    codes = random.integers(200, 400, (rows, joints))
    return grasp_set_of(TYPES, labels, switches=random.random((rows, 6)) < 0.4, codes=codes)


def flat(replay: Replay) -> SimpleNamespace:
    """The states as arrays, the last of them the end; types are -1 while the hand moves."""
    arrivals, ends, _ = np.array(replay.grasps, np.intp).T
    rows = np.append(replay.stream.rows, replay.stream.rows[-1])
    at_us, types = np.append(replay.stream.at_us, replay.stream.end_us), np.full(len(rows), -1)
    for arrival, end, grasp in replay.grasps:
        types[arrival:end] = grasp
    return SimpleNamespace(
        bits=replay.bits[rows], codes=replay.codes[rows], at_us=at_us, types=types, arrivals=arrivals, ends=ends
    )


def same(one: SimpleNamespace, other: SimpleNamespace) -> bool:
    return all(np.array_equal(array, getattr(other, name)) for name, array in vars(one).items())


def check(stream: SimpleNamespace) -> None:
    """What every replay keeps."""
    assert (np.diff(stream.at_us) > 0).all()
    assert (stream.ends > stream.arrivals).all()
    assert (stream.ends < len(stream.at_us)).all()
    assert stream.types[-1] == -1
    for arrival, end in zip(stream.arrivals.tolist(), stream.ends.tolist(), strict=True):
        assert stream.types[arrival] >= 0
        assert (stream.types[arrival:end] == stream.types[arrival]).all()
        assert stream.types[arrival - 1] != stream.types[arrival]


def test_a_set_of_whole_movements_is_streamed_as_it_is() -> None:
    grasp_set = whole_movements([0, 2, 1, 3, 0])
    replay = replay_of(grasp_set, grasp_set.labels, seed=1)
    stream = flat(replay)
    check(stream)
    assert same(stream, flat(recorded(grasp_set, grasp_set.labels)))
    assert np.array_equal(stream.bits[:-1], grasp_set.switches)
    assert np.array_equal(stream.codes[:-1], grasp_set.codes)
    assert stream.types[stream.arrivals].tolist() == [0, 2, 1, 3, 0]
    # The switch that a type leaves open is not waited for.
    assert (stream.arrivals % FRAMES).tolist() == [15, 15, 15, 15, 15]
    assert (stream.ends % FRAMES).tolist() == [30, 30, 30, 30, 30]
    assert "5 recorded movements" in replay.what


def test_a_set_of_single_trials_is_composed_of_the_rows_given() -> None:
    grasp_set, rows = single_trials(0), np.arange(7, 40)
    part = grasp_set.rows(rows)
    replay = replay_of(grasp_set, grasp_set.labels, rows, seed=1, grasps=50)
    check(flat(replay))
    assert same(flat(replay), flat(composed(part, part.labels, seed=1, grasps=50)))
    assert "composed of 50 single trials" in replay.what


def test_incomplete_movements_are_left_out_of_the_replay() -> None:
    grasp_set = whole_movements([0, 2, 1, 3])
    rows = np.concatenate([np.arange(FRAMES), np.arange(2 * FRAMES, 3 * FRAMES), np.arange(FRAMES + 1, 2 * FRAMES)])
    stream = flat(recorded(grasp_set, grasp_set.labels, rows))
    check(stream)
    assert stream.types[stream.arrivals].tolist() == [0, 1]
    with pytest.raises(FrontierError, match="no whole movement"):
        recorded(grasp_set, grasp_set.labels, np.arange(5, 40))


def test_rows_are_a_period_apart_and_movements_out_of_step_with_it() -> None:
    grasp_set = whole_movements([0, 1] * 20)
    stream = flat(recorded(grasp_set, grasp_set.labels))
    steps = np.diff(stream.at_us).reshape(-1, FRAMES)
    assert (steps[:, :-1] == 10_000).all()
    assert ((steps[:-1, -1] > 10_000) & (steps[:-1, -1] < 20_000)).all()
    phases = np.sort(stream.at_us[:-1:FRAMES] % 10_000)
    assert np.diff(phases).max() < 1000


def test_timed_rows_keep_their_times_without_gaps_between_movements() -> None:
    grasp_set = whole_movements([0, 1, 2])
    random, rows = np.random.default_rng(1), np.arange(len(grasp_set))
    times_us = 6_000 * rows + random.integers(0, 900, len(rows)) + 10_000_000 * (rows // FRAMES)
    none = (rows % FRAMES < 9) | (rows % FRAMES >= 32)
    timed = replace(grasp_set, times_us=times_us, grasps=np.where(none, "none", grasp_set.grasps))
    replay = recorded(timed, np.where(none, -1, grasp_set.labels))
    stream = flat(replay)
    check(stream)
    steps = np.diff(stream.at_us[:-1]).tolist()
    for movement in range(3):
        own = slice(FRAMES * movement, FRAMES * (movement + 1))
        assert steps[own][: FRAMES - 1] == np.diff(times_us[own]).tolist()
    assert set(steps[FRAMES - 1 :: FRAMES]) == {10_000 + round(0.618034 * 10_000)}
    # The labels say while when a grasp is complete, whatever the switches do.
    assert (stream.arrivals % FRAMES).tolist() == [9] * 3
    assert (stream.ends % FRAMES).tolist() == [32] * 3
    assert stream.types[stream.arrivals].tolist() == [0, 1, 2]
    assert "frames when they were recorded" in replay.what


def test_of_many_movements_some_are_taken_from_all_over_the_set() -> None:
    labels = [number % 4 for number in range(41)]
    grasp_set = whole_movements(labels)
    stream = flat(recorded(grasp_set, grasp_set.labels, grasps=5))
    check(stream)
    first_codes = grasp_set.codes[::FRAMES, 0][[0, 10, 20, 30, 40]]
    assert stream.codes[:-1:FRAMES, 0].tolist() == first_codes.tolist()


@given(st.integers(0, 10_000), st.integers(0, 3), st.integers(2, 4), st.integers(1, 70))
def test_a_composed_stream_holds_trials_and_moves_between_them(seed: int, joints: int, types: int, grasps: int) -> None:
    trials = single_trials(seed, rows=24, joints=joints, types=types)
    stream = flat(composed(trials, trials.labels, seed=seed, grasps=grasps))
    check(stream)
    assert len(stream.arrivals) == grasps
    rows = {(row.tobytes(), codes.tobytes()) for row, codes in zip(trials.switches, trials.codes, strict=True)}
    held = zip(stream.bits[stream.arrivals], stream.codes[stream.arrivals], strict=True)
    assert all((row.tobytes(), codes.tobytes()) in rows for row, codes in held)
    held_us = stream.at_us[stream.ends] - stream.at_us[stream.arrivals]
    assert ((held_us >= HOLD_US[0]) & (held_us < HOLD_US[1])).all()
    comes_us = stream.at_us[stream.arrivals[1:]] - stream.at_us[stream.ends[:-1]]
    assert ((comes_us >= RELEASE_US + TRAVEL_US) & (comes_us < RELEASE_US + TRAVEL_US + GRIP_US)).all()
    assert np.diff(stream.at_us).max() <= max(HOLD_US[1], RELEASE_US + TRAVEL_US + GRIP_US)


@given(st.integers(0, 10_000))
def test_switches_open_before_the_hand_travels_and_close_after_it_has(seed: int) -> None:
    trials = single_trials(seed)
    stream = flat(composed(trials, trials.labels, seed=seed, grasps=9))
    for end, arrival in zip(stream.ends[:-1].tolist(), stream.arrivals[1:].tolist(), strict=True):
        way = np.arange(end, arrival + 1)
        since_us = stream.at_us[way] - stream.at_us[end]
        changes = np.diff(stream.bits[way].astype(int), axis=0)
        assert (changes[since_us[1:] < RELEASE_US] <= 0).all()
        assert (changes[since_us[1:] >= RELEASE_US + TRAVEL_US] >= 0).all()
        still = (since_us >= RELEASE_US) & (since_us < RELEASE_US + TRAVEL_US)
        assert not stream.bits[way[still]].any()
        moves = (np.diff(stream.codes[way].astype(int), axis=0) != 0).any(axis=1)
        assert (since_us[1:][moves] > RELEASE_US).all()
        assert ((since_us[1:][moves] - RELEASE_US) % RECORD_US == 0).all()


@pytest.mark.parametrize("opens_up", [False, True])
def test_joints_pass_through_a_more_open_hand(opens_up: bool) -> None:
    trials = single_trials(5, joints=1)
    codes = np.where(trials.labels[:, np.newaxis] == 0, 500 if opens_up else 100, 300).astype(np.uint16)
    labels = np.where(trials.labels == 1, 1, 2)
    ends = (0, 250.0, 1000, -250.0) if opens_up else (0, -250.0, 1000, 250.0)
    trials = replace(trials, codes=codes, joints=(Joint("j0", "deg", *ends),))
    stream = flat(composed(trials, labels, seed=2, grasps=9))
    spans = zip(stream.ends[:-1].tolist(), stream.arrivals[1:].tolist(), strict=True)
    ways = [stream.codes[end : arrival + 1, 0].astype(int) for end, arrival in spans]
    there_and_back = [way for way in ways if way[0] == way[-1] == 300]
    assert there_and_back
    for way in there_and_back:
        assert 95 <= abs(way - 300).max() <= 100
        assert ((way >= 300) if opens_up else (way <= 300)).all()


@given(st.integers(0, 10_000))
def test_every_trial_is_held_before_any_is_held_again(seed: int) -> None:
    trials = single_trials(seed, rows=20, joints=0)
    unlike = (np.arange(20)[:, np.newaxis] >> np.arange(6) & 1).astype(bool)
    stream = flat(composed(replace(trials, switches=unlike), trials.labels, seed=seed, grasps=20))
    held = {row.tobytes() for row in stream.bits[stream.arrivals]}
    # Where the rest of a round is all of one type, the next round begins before it.
    assert len(held) >= 17


def test_trials_of_one_type_make_no_replay() -> None:
    trials = single_trials(3)
    with pytest.raises(FrontierError, match="of one"):
        replay_of(trials, trials.labels, np.flatnonzero(trials.labels == 2), seed=1)
