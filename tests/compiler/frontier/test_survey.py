"""One training serves all numbers of rounds, one path all parameters: each answer is that of doing it alone."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import winners
from thenar.compiler.frontier.search import SHAPES, Search, Shape
from thenar.compiler.frontier.survey import Cuts, Tally, choose_path, fit_stages
from thenar.compiler.placement.id3 import grow_id3
from thenar.compiler.placement.ports import PortCosts
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.compiler.tables.collapse import collapse
from thenar.compiler.tables.quantise import quantise
from thenar.runtime.scores import Scorer

COLUMNS = (3, 0, 7, 9)
SEARCH = Search(methods=("id3",), rivals=(), repeats=2)


@pytest.fixture(scope="module")
def samples(grasp_set: GraspSet) -> Samples:
    return Samples.of(grasp_set)


@pytest.fixture(scope="module")
def cuts(grasp_set: GraspSet) -> Cuts:
    return cuts_of(grasp_set)


def cuts_of(grasp_set: GraspSet) -> Cuts:
    return Cuts.of(Samples.of(grasp_set).labels, grasp_set.subjects, SEARCH)


def fit_of(samples: Samples, cuts: Cuts, stages: tuple[int, ...], columns: tuple[int, ...] = COLUMNS) -> Tally:
    return fit_stages(samples, cuts.screening[0], columns, stages, stages, SHAPES, SEARCH.training)


@pytest.mark.parametrize("inputs", ["both", "switches"])
def test_every_stage_is_as_if_trained_for_it_alone(grasp_set: GraspSet, cuts: Cuts, inputs: Any) -> None:
    fold, stages, samples = cuts.screening[0], (1, 4, 9), Samples.of(grasp_set, inputs)
    fit, X = fit_of(samples, cuts, stages), samples.kept(COLUMNS)
    for stage, correct in zip(stages, fit.correct, strict=True):
        stumps, _ = boost(X[fold.train], samples.labels[fold.train], 4, rounds=stage)
        answers = winners(stumps.scores(X[fold.test]))
        assert correct == np.count_nonzero(answers == samples.labels[fold.test])
    assert fit.total == len(fold.test)


def test_tables_answer_as_they_will_when_deployed(samples: Samples, cuts: Cuts) -> None:
    fold, stages = cuts.screening[0], (2, 6)
    fit = fit_of(samples, cuts, stages)
    X, kept = samples.kept(COLUMNS), len(COLUMNS)
    bits, codes = X[:, :kept].astype(bool), X[:, kept:]
    for stage, row in zip(stages, fit.deployed, strict=True):
        stumps, _ = boost(X[fold.train], samples.labels[fold.train], 4, rounds=stage)
        for shape, correct in zip(SHAPES, row, strict=True):
            scores = collapse(stumps, kept)
            scorer = Scorer(quantise(scores, bits[fold.train], codes[fold.train], shape.width, shape.table_bits))
            lanes = [scorer.lanes(bits[test], codes[test]) for test in fold.test]
            answers = [lane.index(max(lane)) for lane in lanes]
            assert correct == np.count_nonzero(answers == samples.labels[fold.test])


def test_without_an_input_that_varies_the_most_frequent_type_is_answered(grasp_set: GraspSet, cuts: Cuts) -> None:
    samples, fold = Samples.of(grasp_set, "switches"), cuts.screening[0]
    fit = fit_of(samples, cuts, (1, 3), columns=())
    most = np.bincount(samples.labels[fold.train]).argmax()
    same = int(np.count_nonzero(samples.labels[fold.test] == most))
    assert fit.correct == (same, same)
    assert fit.deployed == ((same,) * len(SHAPES),) * 2


def test_a_path_holds_the_placement_of_every_parameter(samples: Samples, cuts: Cuts) -> None:
    rows, prunes = cuts.screening[0].train, (0.0, 10.0, 40.0)
    path = choose_path(samples, rows, "id3", prunes, None)
    X, y = samples.switches[rows], samples.labels[rows]
    assert path.columns == tuple(grow_id3(X, y, min_samples=int(prune)).inputs for prune in prunes)


def test_folds_and_costs_of_ports_are_told_apart(samples: Samples, cuts: Cuts) -> None:
    one, two = (0,) * 13 + (1,), (0,) * 12 + (1, 1)
    several = (((0,) * 14, (1.0,)), ((0,) * 14, (2.0,)), (one, (1.0, 1.0)), (two, (1.0, 1.0)))
    costs = [None, *(PortCosts(*each) for each in several)]
    folds = [*cuts.screening, *cuts.others, cuts.everything]
    asked = {choose_path.call(1.0, samples, folds[0].train, "id3", (0.0,), ports).question({}) for ports in costs}
    asked |= {fit_stages.call(1.0, samples, fold, (0,), (1,), (), (), SEARCH.training).question({}) for fold in folds}
    assert len(asked) == len(costs) + len(folds)


def test_the_same_set_is_cut_alike(make_set: Callable[..., GraspSet]) -> None:
    first, again = cuts_of(make_set(rows=97)), cuts_of(make_set(rows=97))
    assert first.subjects == ()
    for one, other in zip((*first.screening, *first.others), (*again.screening, *again.others), strict=True):
        assert np.array_equal(one.train, other.train)
        assert np.array_equal(one.test, other.test)


def test_nobody_left_out_is_trained_on(make_set: Callable[..., GraspSet]) -> None:
    grasp_set = make_set(subjects=3)
    cuts = cuts_of(grasp_set)
    assert len(cuts.subjects) == 3
    for fold in cuts.subjects:
        assert set(grasp_set.subjects[fold.train]).isdisjoint(grasp_set.subjects[fold.test])


def test_every_fold_tests_rows_that_it_does_not_train_on(make_set: Callable[..., GraspSet]) -> None:
    grasp_set = make_set(subjects=2)
    cuts = cuts_of(grasp_set)
    assert len((*cuts.screening, *cuts.others)) == 2 * SEARCH.folds + 2
    for fold in (*cuts.screening, *cuts.others):
        assert np.array_equal(np.sort(np.concatenate([fold.train, fold.test])), np.arange(len(grasp_set)))


def test_a_shape_names_width_and_entries() -> None:
    assert Shape(16) == Shape(16, 16)
    assert {shape.width for shape in SHAPES} >= {4, 16}
