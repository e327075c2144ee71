from collections.abc import Callable
from dataclasses import replace

import numpy as np

from thenar.compiler.evaluation.concerns import concerns
from thenar.compiler.evaluation.populations import populations
from thenar.compiler.recordings.graspset import GraspSet

Make = Callable[..., GraspSet]


def keep_some(grasps: GraspSet, grasp: str, n: int) -> GraspSet:
    rows = np.flatnonzero(grasps.grasps == grasp)
    return grasps.rows(np.setdiff1d(np.arange(len(grasps)), rows[n:]))


def test_a_balanced_set_is_of_no_concern(make_grasps: Make) -> None:
    grasps = make_grasps()
    assert concerns(grasps, populations(grasps, "stratified", 4, 1, 1), "stratified", 4) == ()


def test_a_grasp_type_with_fewer_rows_than_folds_is_named(make_grasps: Make) -> None:
    grasps = keep_some(make_grasps(subjects="A"), "tip", 3)
    (text,) = concerns(grasps, populations(grasps, "stratified", 4, 1, 1), "stratified", 4)
    assert text.startswith("subject A has 3 row(s) of tip: fewer than the 4 folds")


def test_as_many_rows_as_folds_are_enough(make_grasps: Make) -> None:
    grasps = keep_some(make_grasps(subjects="A"), "tip", 4)
    assert concerns(grasps, populations(grasps, "stratified", 4, 1, 1), "stratified", 4) == ()


def test_a_single_row_can_never_be_recognised_and_that_is_said(make_grasps: Make) -> None:
    grasps = keep_some(make_grasps(subjects="A"), "tip", 1)
    texts = concerns(grasps, populations(grasps, "stratified", 4, 1, 1), "stratified", 4)
    assert any(
        text.startswith("1 row(s) of tip of subject A are tested by a fold that trains no such") for text in texts
    )


def test_an_object_of_its_own_grasp_type_is_noticed_when_objects_are_left_out(make_grasps: Make) -> None:
    grasps = make_grasps(subjects="A")
    own_object = np.where(grasps.grasps == "hook", "bag", grasps.objects)
    grasps = GraspSet(
        grasps.switches,
        grasps.switch_names,
        grasps.codes,
        grasps.joints,
        grasps.grasps,
        grasps.taxonomy,
        grasps.subjects,
        own_object,
        grasps.trials,
    )
    (text,) = concerns(grasps, populations(grasps, "object", 4, 1, 1), "object", 4)
    assert text.startswith("12 row(s) of hook of subject A")


def test_a_subject_of_one_grasp_type_is_named(make_grasps: Make) -> None:
    grasps = make_grasps()
    only = grasps.rows(np.flatnonzero((grasps.subjects == "B") | (grasps.grasps == "tip")))
    (text,) = concerns(only, populations(only, "stratified", 4, 1, 1), "stratified", 4)
    assert text == "subject A: every row is of tip, nothing is to be told apart"


def test_rates_of_simulated_grasps_are_called_that(make_grasps: Make) -> None:
    simulated = replace(make_grasps(), simulated="scene quick, seed 1")
    (text,) = concerns(simulated, populations(simulated, "stratified", 4, 1, 1), "stratified", 4)
    assert text.startswith("these grasps are simulated (scene quick, seed 1)")
