from collections.abc import Callable

import numpy as np
import pytest

from thenar.compiler.evaluation.errors import EvaluationError
from thenar.compiler.evaluation.folds import weka_folds
from thenar.compiler.evaluation.populations import Scheme, populations
from thenar.compiler.recordings.graspset import GraspSet

Make = Callable[..., GraspSet]


@pytest.mark.parametrize("scheme", ["stratified", "object", "block"])
def test_a_subject_is_trained_and_tested_on_own_rows_alone(make_grasps: Make, scheme: Scheme) -> None:
    grasps = make_grasps()
    parts = populations(grasps, scheme, n_folds=4, repeats=2, seed=1)
    assert [part.name for part in parts] == ["A", "B"]
    for part in parts:
        own = np.flatnonzero(grasps.subjects == part.name)
        assert np.array_equal(part.rows, own)
        assert part.total == len(own)
        for fold in part.folds:
            assert np.array_equal(np.sort(np.concatenate([fold.train, fold.test])), own)


def test_leaving_a_subject_out_trains_on_all_others(make_grasps: Make) -> None:
    grasps = make_grasps(subjects="ABC")
    for part in populations(grasps, "subject", n_folds=4, repeats=3, seed=1):
        ((fold,),) = part.repeats
        assert set(grasps.subjects[fold.test]) == {part.name}
        assert set(grasps.subjects[fold.train]) == {*"ABC"} - {part.name}
        assert len(part.rows) == len(grasps)


def test_repeats_are_wekas_folds_of_the_following_seeds(make_grasps: Make) -> None:
    grasps = make_grasps(subjects="A")
    (part,) = populations(grasps, "stratified", n_folds=4, repeats=3, seed=5)
    for repeat, folds in enumerate(part.repeats):
        for fold, weka in zip(folds, weka_folds(grasps.labels, 4, 5 + repeat), strict=True):
            assert np.array_equal(fold.train, weka.train)
            assert np.array_equal(fold.test, weka.test)


@pytest.mark.parametrize("scheme", ["subject", "object", "block"])
def test_a_cut_without_chance_is_not_repeated(make_grasps: Make, scheme: Scheme) -> None:
    assert all(len(part.repeats) == 1 for part in populations(make_grasps(), scheme, 4, 3, 1))


def test_the_classes_are_those_that_the_subject_shows(make_grasps: Make) -> None:
    grasps = make_grasps(subjects="AB")
    without = grasps.rows((grasps.subjects == "A") | (grasps.grasps != "pinch"))
    shown = {part.name: part.grasps for part in populations(without, "stratified", 4, 1, 1)}
    assert shown == {"A": (0, 1, 2, 3), "B": (0, 2, 3)}


def test_a_subject_who_cannot_be_cut_is_named(make_grasps: Make) -> None:
    grasps = make_grasps()
    few = grasps.rows([*np.flatnonzero(grasps.subjects == "A"), len(grasps) - 1])
    with pytest.raises(EvaluationError, match="subject B: 1 rows cannot be cut into 4 folds"):
        populations(few, "stratified", 4, 1, 1)
