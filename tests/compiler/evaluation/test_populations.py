from dataclasses import replace

import numpy as np
import pytest

from thenar.compiler.evaluation.folds import (
    EvaluationError,
    Scheme,
    concerns,
    may_choose,
    may_choose_pooled,
    populations_of,
    weka_folds,
)
from thenar.compiler.recordings.graspset import GraspSet

from .conftest import make_grasps


@pytest.mark.parametrize("scheme", ["trial", "object"])
def test_a_subject_is_trained_and_tested_on_own_rows_alone(scheme: Scheme) -> None:
    grasps = make_grasps()
    populations = populations_of(grasps, scheme, n_folds=4, repeats=2, seed=1)
    assert [population.name for population in populations] == ["A", "B"]
    for population in populations:
        own = np.flatnonzero(grasps.subjects == population.name)
        assert np.array_equal(population.rows, own)
        for fold in population.folds:
            assert np.array_equal(np.sort(np.concatenate([fold.train, fold.test])), own)


def test_leaving_a_subject_out_trains_on_all_others() -> None:
    grasps = make_grasps(subjects="ABC")
    for population in populations_of(grasps, "subject", n_folds=4, repeats=3, seed=1):
        ((fold,),) = population.repeats
        assert set(grasps.subjects[fold.test]) == {population.name}
        assert set(grasps.subjects[fold.train]) == {*"ABC"} - {population.name}
        assert len(population.rows) == len(grasps)


@pytest.mark.parametrize("scheme", ["trial", "subject", "object"])
@pytest.mark.parametrize("seed", [1, 2])
def test_no_scheme_parts_the_frames_of_a_trial(scheme: Scheme, seed: int) -> None:
    """Each row comes three times, as frames of its trial do, and all rows are in another order."""
    order = np.random.default_rng(seed).permutation(3 * 96) % 96
    grasps = make_grasps().rows(order)
    trials = grasps.trial_ids
    assert len(np.unique(trials)) == 96
    for population in populations_of(grasps, scheme, n_folds=4, repeats=2, seed=seed):
        for fold in population.folds:
            assert not set(trials[fold.train]) & set(trials[fold.test])


def test_repeats_are_wekas_folds_of_the_following_seeds() -> None:
    grasps = make_grasps(subjects="A")
    (population,) = populations_of(grasps, "trial", n_folds=4, repeats=3, seed=5)
    for repeat, folds in enumerate(population.repeats):
        for fold, weka in zip(folds, weka_folds(grasps.labels, 4, 5 + repeat), strict=True):
            assert np.array_equal(fold.train, weka.train)
            assert np.array_equal(fold.test, weka.test)


@pytest.mark.parametrize("scheme", ["subject", "object"])
def test_a_cut_without_chance_is_not_repeated(scheme: Scheme) -> None:
    assert all(len(population.repeats) == 1 for population in populations_of(make_grasps(), scheme, 4, 3, 1))


def test_the_classes_are_those_that_the_subject_shows() -> None:
    grasps = make_grasps(subjects="AB")
    without = grasps.rows((grasps.subjects == "A") | (grasps.grasps != "pinch"))
    shown = {population.name: population.grasps for population in populations_of(without, "trial", 4, 1, 1)}
    assert shown == {"A": (0, 1, 2, 3), "B": (0, 2, 3)}


def test_a_subject_who_cannot_be_cut_is_named() -> None:
    grasps = make_grasps()
    few = grasps.rows([*np.flatnonzero(grasps.subjects == "A"), len(grasps) - 1])
    with pytest.raises(EvaluationError, match="subject B: 1 rows cannot be cut into 4 folds"):
        populations_of(few, "trial", 4, 1, 1)


def test_the_paper_lets_test_rows_choose_and_honesty_does_not() -> None:
    grasps = make_grasps()
    everyone = np.arange(len(grasps))
    for scheme in ("trial", "object", "subject"):
        for population in populations_of(grasps, scheme, 4, 2, 1):
            for fold in population.folds:
                assert set(may_choose("paper", population, fold)) == set(population.rows)
                assert set(may_choose("nested", population, fold)) == set(population.rows) - set(fold.test)
                assert set(may_choose_pooled("paper", everyone, fold)) == set(everyone)
                assert set(may_choose_pooled("nested", everyone, fold)) == set(everyone) - set(fold.test)


def keep_some(grasps: GraspSet, grasp: str, n: int) -> GraspSet:
    rows = np.flatnonzero(grasps.grasps == grasp)
    return grasps.rows(np.setdiff1d(np.arange(len(grasps)), rows[n:]))


def test_a_balanced_set_is_of_no_concern() -> None:
    grasps = make_grasps()
    assert concerns(grasps, populations_of(grasps, "trial", 4, 1, 1), "trial", 4) == ()


def test_a_grasp_type_with_fewer_rows_than_folds_is_named() -> None:
    grasps = keep_some(make_grasps(subjects="A"), "tip", 3)
    (text,) = concerns(grasps, populations_of(grasps, "trial", 4, 1, 1), "trial", 4)
    assert text.startswith("subject A has 3 trial(s) of tip: fewer than the 4 folds")


def test_a_single_row_can_never_be_recognised_and_that_is_said() -> None:
    grasps = keep_some(make_grasps(subjects="A"), "tip", 1)
    texts = concerns(grasps, populations_of(grasps, "trial", 4, 1, 1), "trial", 4)
    assert any(
        text.startswith("1 row(s) of tip of subject A are tested by a fold that trains no such") for text in texts
    )


def test_leaving_objects_out_warns_of_types_with_one_object() -> None:
    grasps = make_grasps(subjects="A")
    own_object = np.where(grasps.grasps == "hook", "bag", grasps.objects)
    grasps = replace(grasps, objects=own_object)
    (text,) = concerns(grasps, populations_of(grasps, "object", 4, 1, 1), "object", 4)
    assert text.startswith("12 row(s) of hook of subject A")


def test_a_subject_of_one_grasp_type_is_named() -> None:
    grasps = make_grasps()
    only = grasps.rows(np.flatnonzero((grasps.subjects == "B") | (grasps.grasps == "tip")))
    (text,) = concerns(only, populations_of(only, "trial", 4, 1, 1), "trial", 4)
    assert text == "subject A: every row is of tip, the only type"


def test_rates_of_simulated_grasps_are_called_that() -> None:
    simulated = replace(make_grasps(), simulated="scene quick, seed 1")
    (text,) = concerns(simulated, populations_of(simulated, "trial", 4, 1, 1), "trial", 4)
    assert text.startswith("these grasps are simulated (scene quick, seed 1)")
