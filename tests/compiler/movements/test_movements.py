"""Which rows make a movement."""

from dataclasses import replace
from typing import Any

import numpy as np

from thenar.compiler.movements.streams import in_movements
from thenar.compiler.recordings.graspset import GraspSet

from ...sets import grasp_set_of

TYPES = ("cup", "pen", "rod")


def set_of(labels: Any, trials: Any, objects: Any = "thing") -> GraspSet:
    things, numbers = (np.broadcast_to(values, len(labels)) for values in (objects, trials))
    blank = np.zeros((len(labels), 1))
    return grasp_set_of(TYPES, labels, switches=blank, codes=blank, objects=things, trials=numbers)


def rows_inside(grasp_set: GraspSet) -> list[int]:
    return np.flatnonzero(in_movements(grasp_set)).tolist()


def test_rows_of_one_trial_that_follow_one_another_are_a_movement() -> None:
    assert rows_inside(set_of(np.repeat([0, 1, 2], 4), np.repeat([1, 2, 3], 4))) == list(range(12))
    single = set_of([0, 1, 0, 1, 0, 1, 0, 0], 1)
    assert rows_inside(single) == [6, 7]
    assert rows_inside(replace(single, independent=True)) == []
    assert rows_inside(single.rows([])) == []


def test_another_object_trial_session_or_subject_begins_another_movement() -> None:
    rows = set_of([0] * 8, [0, 0, 1, 1, 1, 1, 1, 1], list("aaaabbbc"))
    assert rows_inside(rows) == list(range(7))
    assert rows_inside(replace(rows, sessions=np.array(list("11111222")))) == [0, 1, 2, 3, 5, 6]
    # Subjects recorded at once.
    at_once = replace(set_of([0] * 5, 1), subjects=np.array(list("ABABC")))
    assert rows_inside(at_once) == [0, 1, 2, 3]


def test_rows_of_none_belong_to_their_movement() -> None:
    whole = set_of([0] * 9, 1)
    held = np.where(np.arange(9) % 3 == 1, whole.grasps, "none")
    assert rows_inside(replace(whole, grasps=held)) == list(range(9))
