from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import GraspSet
from thenar.compiler.evaluation.folds import EvaluationError
from thenar.compiler.evaluation.interim import (
    interim_accuracy,
    interim_accuracy_of,
)
from thenar.compiler.recordings.graspset import Joint
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.recording.session import Collection, CollectionTask, Label, Session
from thenar.runtime.recording.writer import Recorder

from ...sets import grasp_set_of


def grasps(repetitions: int, *, noise: float, seed: int = 3) -> GraspSet:
    """Three types by one joint and switches; the third is like the second but for noise."""
    random = np.random.default_rng(seed)
    labels = np.tile(np.arange(3), repetitions)
    centres = np.array([60, 150, 150])
    return grasp_set_of(
        ["cup", "pen", "rod"],
        labels,
        switches=np.array([[1, 0, 0], [0, 1, 0], [0, 1, 0]])[labels],
        switch_names=("a", "b", "c"),
        codes=(centres[labels] + random.normal(0, noise, len(labels)))[:, None],
        joints=(Joint("j", "raw", 1, 1.0, 255, 255.0),),
    )


def test_types_that_are_taken_for_each_other_come_first_and_say_so() -> None:
    found = interim_accuracy(grasps(12, noise=3))
    assert found.total == 36
    assert found.correct == sum(one.correct for one in found.types)
    assert found.types[-1].grasp == "cup"
    assert (found.types[-1].correct, found.types[-1].taken_for) == (12, "")
    for one in found.types[:2]:
        assert one.correct < 12
        assert one.taken_for == {"pen": "rod", "rod": "pen"}[one.grasp]
        assert one.low <= one.correct / one.total < one.high
    assert [one.low for one in found.types] == sorted(one.low for one in found.types)


def test_of_equally_good_types_that_with_fewer_trials_comes_first() -> None:
    whole = grasps(10, noise=3)
    cups = np.flatnonzero(whole.grasps == "cup")
    few = whole.rows(np.setdiff1d(np.flatnonzero(whole.grasps != "rod"), cups[3:]))
    found = interim_accuracy(few)
    assert [(one.grasp, one.correct, one.total) for one in found.types] == [("cup", 3, 3), ("pen", 10, 10)]


def test_a_type_with_one_trial_has_no_accuracy_and_does_not_count() -> None:
    whole = grasps(6, noise=3)
    rods = np.flatnonzero(whole.grasps == "rod")
    found = interim_accuracy(whole.rows(np.setdiff1d(np.arange(18), rods[1:])))
    rod = next(one for one in found.types if one.grasp == "rod")
    assert (rod.total, rod.correct, rod.low, rod.high, rod.taken_for) == (1, 0, 0.0, 1.0, "")
    assert found.types[0] is rod
    assert found.total == 12 == sum(one.total for one in found.types if one is not rod)
    assert found.correct == sum(one.correct for one in found.types)
    first = interim_accuracy(whole.rows(np.arange(3)))
    assert (first.total, first.correct, first.low, first.high) == (0, 0, 0.0, 1.0)


def test_rows_of_a_trial_count_once() -> None:
    whole = grasps(6, noise=3)
    thrice = whole.rows(np.repeat(np.arange(len(whole)), 3))
    one, three = interim_accuracy(whole), interim_accuracy(thrice)
    assert three.total == one.total == 18


def test_a_trial_takes_no_part_in_its_own_prediction() -> None:
    random = np.random.default_rng(1)
    noise = grasp_set_of(["cup", "pen"], np.arange(40) % 2, switches=random.random((40, 60)) < 0.5)
    assert interim_accuracy(noise).correct < 30


def test_one_type_alone_is_taken_for_nothing_else() -> None:
    whole = grasps(4, noise=1)
    with pytest.raises(EvaluationError, match="all trials are of one grasp type"):
        interim_accuracy(whole.rows(np.flatnonzero(whole.grasps == "cup")))


def test_a_recording_is_read_while_it_is_written(tmp_path: Path) -> None:
    tasks = (CollectionTask("cup", ("mug",)), CollectionTask("pen", ("biro",)))
    collection = Collection("A", "own", ("cup", "pen"), tasks, 3, 0)
    session = Session(thenar="1", switches=("a", "b"), sensors=("j",), collection=collection)
    path = tmp_path / "a.mcap"
    with Recorder(path, session) as recorder:
        for number in range(1, 7):
            recorder.frame(SwitchFrame(10 * number, 1 + number % 2))
            recorder.frame(GloveFrame(10 * number, bytes((100 + 50 * (number % 2),))))
            name, thing = (("pen", "biro"), ("cup", "mug"))[number % 2]
            for event in ("begun", "captured", "accepted"):
                recorder.label(Label(10 * number, event, number, name, "A", thing))
            found = interim_accuracy_of(path)
            assert (found is None) == (number == 1)
    assert found is not None
    assert (found.total, found.correct) == (6, 6)
