"""One training serves all numbers of rounds, one path all parameters: each answer is that of doing it alone."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from thenar.compiler.evaluation.choosing import choose_path
from thenar.compiler.evaluation.folds import EvaluationError
from thenar.compiler.frontier.cache import question
from thenar.compiler.frontier.search import SHAPES, Search
from thenar.compiler.frontier.survey import Cuts, FoldHits, fit_stages
from thenar.compiler.placement.elements import Element
from thenar.compiler.placement.placement import InputSelection
from thenar.compiler.placement.ports import PortCosts
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.compiler.trainers.logitboost import boost
from thenar.runtime.model.tables import winners
from thenar.runtime.recipe import Recipe

from ..conftest import make_set

COLUMNS = (3, 0, 7, 9)


def kept(columns: tuple[int, ...], joints: int = 0) -> InputSelection:
    """Return the selection of these switches, and of the first joints."""
    return InputSelection.of(tuple(map(Element, columns)), tuple(range(joints)))


SEARCH = Search(methods=("id3",), repeats=2)


@pytest.fixture(scope="module")
def samples(grasp_set: GraspSet) -> Samples:
    return Samples.of(grasp_set)


@pytest.fixture(scope="module")
def cuts(grasp_set: GraspSet) -> Cuts:
    return cuts_of(grasp_set)


def cuts_of(grasp_set: GraspSet) -> Cuts:
    return Cuts.of(Samples.of(grasp_set), SEARCH)


def counted(packed: bytes) -> int:
    return int.from_bytes(packed).bit_count()


def fit_of(samples: Samples, cuts: Cuts, stages: tuple[int, ...], columns: tuple[int, ...] = COLUMNS) -> FoldHits:
    selection = kept(columns, samples.codes.shape[1])
    return fit_stages(samples, cuts.screening[0], selection, stages, stages, SHAPES, SEARCH.training)


@pytest.mark.parametrize("inputs", ["both", "switches"])
def test_every_stage_is_as_if_trained_for_it_alone(grasp_set: GraspSet, cuts: Cuts, inputs: Any) -> None:
    fold, stages, samples = cuts.screening[0], (1, 4, 9), Samples.of(grasp_set, inputs)
    fit, X = fit_of(samples, cuts, stages), samples.keeping(COLUMNS).inputs
    for stage, correct in zip(stages, fit.stages, strict=True):
        stumps, _ = boost(X[fold.train], samples.labels[fold.train], 4, rounds=stage)
        answers = winners(stumps.scores(X[fold.test]))
        # Each row of the set is a trial of its own, numbered as the rows are.
        assert correct == np.packbits((answers == samples.labels[fold.test])[np.argsort(fold.test)]).tobytes()


def test_without_an_input_that_varies_the_most_frequent_type_is_answered(grasp_set: GraspSet, cuts: Cuts) -> None:
    samples, fold = Samples.of(grasp_set, "switches"), cuts.screening[0]
    fit = fit_of(samples, cuts, (1, 3), columns=())
    most = np.bincount(samples.labels[fold.train]).argmax()
    same = int(np.count_nonzero(samples.labels[fold.test] == most))
    assert [counted(packed) for packed in fit.stages] == [same, same]
    assert {counted(packed) for row in fit.tables for packed in row} == {same}
    assert [len(row) for row in fit.tables] == [len(SHAPES)] * 2


def test_folds_and_costs_of_ports_are_told_apart(samples: Samples, cuts: Cuts) -> None:
    one, two = (0,) * 13 + (1,), (0,) * 12 + (1, 1)
    several = (((0,) * 14, (1.0,)), ((0,) * 14, (2.0,)), (one, (1.0, 1.0)), (two, (1.0, 1.0)))
    costs = [None, *(PortCosts(*each) for each in several)]
    folds = [*cuts.screening, *cuts.others, cuts.everything]
    asked = {question(choose_path, (samples, folds[0].train, Recipe(), (0.0,), (), ports), {}) for ports in costs}
    asked |= {question(fit_stages, (samples, fold, kept((0,)), (1,), (), (), SEARCH.training), {}) for fold in folds}
    assert len(asked) == len(costs) + len(folds)


def test_left_out_subjects_are_untrained_and_grouped_into_ten_folds() -> None:
    for subjects, folds in ((3, 3), (10, 10), (24, 10)):
        grasp_set = make_set(rows=480, subjects=subjects)
        cuts = cuts_of(grasp_set)
        assert (len(cuts.subjects), cuts.by, cuts.other) == (folds, "new subject", "pooled")
        assert cuts.screening == cuts.subjects
        for fold in cuts.subjects:
            assert set(grasp_set.subjects[fold.train]).isdisjoint(grasp_set.subjects[fold.test])


def test_points_are_chosen_by_what_is_asked_for() -> None:
    samples = Samples.of(make_set(subjects=3))
    by_trial = Cuts.of(samples, replace(SEARCH, by="trial"))
    assert (by_trial.by, by_trial.other, by_trial.screening) == ("pooled", "new subject", by_trial.repeats[0])
    assert Cuts.of(samples, replace(SEARCH, by="subject")).by == "new subject"
    with pytest.raises(EvaluationError, match="needs two or more subjects"):
        Cuts.of(Samples.of(make_set()), replace(SEARCH, by="subject"))


def test_every_fold_tests_rows_that_it_does_not_train_on() -> None:
    grasp_set = make_set(subjects=2)
    # The rate by which points are not chosen is of one repeat.
    for search, repeats in ((replace(SEARCH, by="subject"), 1), (replace(SEARCH, by="trial"), SEARCH.repeats)):
        cuts = Cuts.of(Samples.of(grasp_set), search)
        assert len((*cuts.screening, *cuts.others)) == repeats * SEARCH.folds + 2
        for fold in (*cuts.screening, *cuts.others):
            assert np.array_equal(np.sort(np.concatenate([fold.train, fold.test])), np.arange(len(grasp_set)))


def test_a_trial_is_recognised_as_most_of_its_frames_are() -> None:
    """Counted here once more: each row's answer, and the label that most frames of a trial are given."""
    grasp_set = make_set(rows=288, subjects=3)
    grasp_set = replace(grasp_set, trials=np.arange(288) // 4 % 24 // 2, objects=np.array(["thing"] * 288))
    samples, cuts = Samples.of(grasp_set), cuts_of(grasp_set)
    assert len(cuts.people) < len(cuts.trials)
    fits = {
        fold: fit_stages(samples, fold, kept(COLUMNS, samples.codes.shape[1]), (3,), (3,), SHAPES, SEARCH.training)
        for fold in cuts.subjects
    }
    right_trials, right_rows = 0, 0
    for fold in cuts.subjects:
        X = samples.keeping(COLUMNS).inputs
        stumps, _ = boost(X[fold.train], samples.labels[fold.train], 4, rounds=3)
        answers = winners(stumps.scores(X[fold.test]))
        right_rows += int(np.count_nonzero(answers == samples.labels[fold.test]))
        for trial in np.unique(cuts.trials[fold.test]):
            mine = cuts.trials[fold.test] == trial
            right_trials += int(np.bincount(answers[mine]).argmax() == samples.labels[fold.test][mine][0])
    judged = cuts.judged("new subject", {fold: fit.stages[0] for fold, fit in fits.items()})
    assert (judged.rate.correct, judged.rate.total, judged.rate.over) == ((right_trials,), len(cuts.people), 3)
    assert (judged.hits.sum(), judged.repeats, judged.rate.what) == (right_trials, 1, "new subject, trials")
    frames = cuts.judged("new subject", {fold: fit.frames[0][0] for fold, fit in fits.items()}, "frames").rate
    assert (frames.correct, frames.total, frames.what) == ((right_rows,), 288, "new subject, frames")


def test_a_rate_is_of_the_repeats_that_were_fitted() -> None:
    cuts = cuts_of(make_set())
    wrong = {fold: np.packbits(np.zeros(len(fold.test), bool)).tobytes() for fold in cuts.repeats[0]}
    right = {fold: np.packbits(np.ones(len(fold.test), bool)).tobytes() for fold in cuts.repeats[1]}
    assert (cuts.judged("pooled", wrong).rate.mean, cuts.judged("pooled", wrong).repeats) == (0.0, 1)
    both = cuts.judged("pooled", wrong | right)
    assert (both.rate.correct, both.repeats, set(both.hits.tolist())) == ((0, 96), 2, {1})
