"""Which rows make a movement, and while which of them its grasp is complete."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.movements.streams import frames_are_dense, hold_of, holds_of, movements_of
from thenar.compiler.recordings.graspset import GraspSet

from ...sets import grasp_set_of

TYPES = ("cup", "pen", "rod")
SWITCHES, JOINTS = 6, 2


def set_of(switches: Any, codes: Any, labels: Any, trials: Any, objects: Any = "thing") -> GraspSet:
    things, numbers = (np.broadcast_to(values, len(labels)) for values in (objects, trials))
    return grasp_set_of(TYPES, labels, switches=switches, codes=codes, objects=things, trials=numbers)


def movement(
    random: np.random.Generator, held: int = 40, noise: int = 2, joints: int = JOINTS
) -> tuple[np.ndarray, np.ndarray, int, int]:
    """A movement: switches and codes, and between which frames its grasp is complete."""
    coming, rising = 30, 10
    frames = coming + rising + held + 20
    switches = np.zeros((frames, SWITCHES), bool)
    closing = np.sort(random.integers(coming, coming + rising, SWITCHES - 2))
    for switch, frame in enumerate(closing.tolist()):
        switches[frame : coming + rising + held + (0 if frame == closing[-1] else 5), switch] = True
    pose, start = random.integers(100, 200, joints), random.integers(300, 400, joints)
    way = np.clip(np.arange(frames) / coming, 0, 1)[:, np.newaxis]
    codes = np.rint(start + (pose - start) * way) + random.integers(-noise, noise + 1, (frames, joints))
    return switches, codes.astype(np.uint16), int(closing[-1]), coming + rising + held


def recorded(seed: int, count: int = 6) -> GraspSet:
    random = np.random.default_rng(seed)
    made = [movement(random) for _ in range(count)]
    labels = np.repeat(np.arange(count) % len(TYPES), [len(each[0]) for each in made])
    trials = np.repeat(np.arange(count), [len(each[0]) for each in made])
    return set_of(np.vstack([each[0] for each in made]), np.vstack([each[1] for each in made]), labels, trials)


def trials_of(seed: int, rows: int = 120) -> GraspSet:
    random = np.random.default_rng(seed)
    labels = np.arange(rows) % len(TYPES)
    centres = np.random.default_rng(9).random((len(TYPES), SWITCHES)) < 0.5
    switches = centres[labels] ^ (random.random((rows, SWITCHES)) < 0.2)
    codes = 100 + 30 * labels[:, np.newaxis] + random.integers(-9, 10, (rows, JOINTS))
    return set_of(switches, codes, labels, np.arange(rows))


def without_trial_numbers(grasp_set: GraspSet) -> GraspSet:
    """The same rows by grasp type, all of trial 1, as a table without a column of trials is imported."""
    order = np.argsort(grasp_set.labels, kind="stable")
    return set_of(grasp_set.switches[order], grasp_set.codes[order], grasp_set.labels[order], 1)


@given(st.integers(0, 10_000))
def test_frames_of_movements_are_dense_and_single_trials_are_not(seed: int) -> None:
    assert frames_are_dense(recorded(seed))
    assert not frames_are_dense(trials_of(seed))
    assert not frames_are_dense(without_trial_numbers(trials_of(seed)))


def test_an_empty_set_and_equal_trials_are_not_dense() -> None:
    empty = trials_of(0).rows([])
    assert not frames_are_dense(empty)
    assert len(movements_of(empty)) == 0
    assert not frames_are_dense(set_of(np.ones((60, 2)), np.full((60, 1), 7), np.repeat([0, 1, 2], 20), 1))


@pytest.mark.parametrize("joints", [0, 2])
@pytest.mark.parametrize("noise", [0, 1, 4])
def test_a_grasp_is_complete_from_last_closing_to_first_opening(noise: int, joints: int) -> None:
    # In one of 250 movements, frames at an end of the hold are noisier than twice the median.
    for seed in range(100):
        switches, codes, complete, released = movement(np.random.default_rng(seed), noise=noise, joints=joints)
        assert hold_of(switches, codes) == (complete, released)


@given(st.integers(0, 10_000), st.integers(0, 2))
def test_where_no_switch_closes_the_joints_tell(seed: int, noise: int) -> None:
    _, codes, *_ = movement(np.random.default_rng(seed), held=60, noise=noise)
    complete, released = hold_of(np.zeros((len(codes), SWITCHES), bool), codes)
    assert 27 <= complete <= 30  # the last steps of the way may lie within the noise
    assert released == len(codes)


def test_a_bounce_interrupts_no_hold() -> None:
    switches = np.repeat([[False], [True], [False]], [10, 30, 10], axis=0)
    switches[[11, 20, 21]] = False
    assert hold_of(switches, np.zeros((50, 0), np.uint16)) == (10, 40)


def spans(grasp_set: GraspSet) -> list[list[int]]:
    found = movements_of(grasp_set)
    return [found.rows[a:b].tolist() for a, b in zip(found.first.tolist(), found.beyond.tolist(), strict=True)]


def test_movements_are_the_runs_of_one_trial_in_their_order() -> None:
    grasp_set = recorded(3)
    assert spans(grasp_set) == np.arange(600).reshape(6, 100).tolist()
    random = np.random.default_rng(3)
    held = [movement(random)[2:] for _ in range(6)]
    complete, released = holds_of(grasp_set, movements_of(grasp_set))
    assert list(zip(complete.tolist(), released.tolist(), strict=True)) == held


def test_another_object_trial_session_or_subject_begins_another_movement() -> None:
    blank = np.zeros((8, 1))
    rows = set_of(blank, blank, [0] * 8, [0, 0, 1, 1, 1, 1, 1, 1], list("aaaabbbb"))
    assert spans(replace(rows, sessions=np.array(list("11111122")))) == [[0, 1], [2, 3], [4, 5], [6, 7]]
    # Subjects recorded at once.
    at_once = replace(set_of(blank, blank, [0] * 8, 1), subjects=np.array(list("ABABABAB")))
    assert spans(at_once) == [[0, 2, 4, 6], [1, 3, 5, 7]]
    single = set_of(blank, blank, [0, 1, 0, 1, 0, 1, 0, 0], 1)
    assert spans(single) == [[6, 7]]
    assert spans(replace(single, independent=True)) == []


def test_rows_of_none_belong_to_their_movement_and_bound_the_grasp() -> None:
    whole = recorded(3)
    frame = np.arange(len(whole)) % 100
    grasps = np.where((frame >= 42) & (frame < 77) & (frame != 50), whole.grasps, "none")
    labelled = replace(whole, grasps=grasps)
    assert spans(labelled) == spans(whole)
    complete, released = holds_of(labelled, movements_of(labelled))
    assert complete.tolist() == [42] * 6
    assert released.tolist() == [77] * 6
    assert frames_are_dense(labelled)
