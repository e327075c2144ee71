"""One training serves all numbers of rounds, one path all parameters: each answer is that of doing it alone."""

from collections.abc import Callable

import numpy as np
import pytest

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import winners
from thenar.compiler.frontier.learnt import FitKey, FitTask, PathKey, PathTask, choose_path, fit_stages
from thenar.compiler.frontier.material import Cuts, Material
from thenar.compiler.frontier.settings import SHAPES, Search, Shape
from thenar.compiler.placement.id3 import grow_id3
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.tables.collapse import collapse
from thenar.compiler.tables.quantise import quantise
from thenar.runtime.scores import Scorer

COLUMNS = (3, 0, 7, 9)


@pytest.fixture(scope="module")
def material(grasp_set: GraspSet) -> Material:
    return Material.of(grasp_set, None)


@pytest.fixture(scope="module")
def cuts(material: Material) -> Cuts:
    return Cuts.of(material, Search(methods=("id3",), rivals=(), repeats=1))


def _key(cuts: Cuts, stages: tuple[int, ...], joints: bool = True, columns: tuple[int, ...] = COLUMNS) -> FitKey:
    return FitKey(columns, joints, cuts.names[cuts.screening[0]], stages, stages, SHAPES, None)


@pytest.mark.parametrize("joints", [True, False])
def test_every_stage_is_as_if_trained_for_it_alone(material: Material, cuts: Cuts, joints: bool) -> None:
    fold, stages = cuts.screening[0], (1, 4, 9)
    fit = fit_stages(FitTask(_key(cuts, stages, joints), material, fold, 1.0))
    X = material.inputs(COLUMNS, joints)
    for stage, correct in zip(stages, fit.correct, strict=True):
        stumps, _ = boost(X[fold.train], material.labels[fold.train], 4, rounds=stage)
        answers = winners(stumps.scores(X[fold.test]))
        assert correct == np.count_nonzero(answers == material.labels[fold.test])
    assert fit.total == len(fold.test)


def test_tables_answer_as_they_will_when_deployed(material: Material, cuts: Cuts) -> None:
    fold, stages = cuts.screening[0], (2, 6)
    fit = fit_stages(FitTask(_key(cuts, stages), material, fold, 1.0))
    X, kept = material.inputs(COLUMNS, True), len(COLUMNS)
    bits, codes = X[:, :kept].astype(bool), X[:, kept:]
    for stage, row in zip(stages, fit.deployed, strict=True):
        stumps, _ = boost(X[fold.train], material.labels[fold.train], 4, rounds=stage)
        for shape, correct in zip(SHAPES, row, strict=True):
            scores = collapse(stumps, kept)
            scorer = Scorer(quantise(scores, bits[fold.train], codes[fold.train], shape.width, shape.table_bits))
            lanes = [scorer.lanes(bits[test], codes[test]) for test in fold.test]
            answers = [lane.index(max(lane)) for lane in lanes]
            assert correct == np.count_nonzero(answers == material.labels[fold.test])


def test_without_an_input_that_varies_the_most_frequent_type_is_answered(material: Material, cuts: Cuts) -> None:
    fold = cuts.screening[0]
    fit = fit_stages(FitTask(_key(cuts, (1, 3), joints=False, columns=()), material, fold, 1.0))
    most = np.bincount(material.labels[fold.train]).argmax()
    same = int(np.count_nonzero(material.labels[fold.test] == most))
    assert fit.correct == (same, same)
    assert fit.deployed == ((same,) * len(SHAPES),) * 2


def test_a_path_holds_the_placement_of_every_parameter(material: Material, cuts: Cuts) -> None:
    fold, prunes = cuts.screening[0], (0.0, 10.0, 40.0)
    path = choose_path(PathTask(PathKey("id3", prunes, False, "name"), material, fold, 1.0))
    X, y = material.switches[fold.train], material.labels[fold.train]
    assert path.columns == tuple(grow_id3(X, y, min_samples=int(prune)).inputs for prune in prunes)


def test_folds_are_told_apart_by_their_rows(make_set: Callable[..., GraspSet]) -> None:
    several = Material.of(make_set(rows=97), None)
    found = Cuts.of(several, Search(methods=("id3",), rivals=(), repeats=3))
    assert len(set(found.names.values())) == len(found.all) + 1
    assert found.subjects == ()
    again = Cuts.of(several, Search(methods=("id3",), rivals=(), repeats=3))
    assert list(found.names.values()) == list(again.names.values())


def test_a_shape_names_width_and_entries() -> None:
    assert Shape(16) == Shape(16, 16)
    assert {shape.width for shape in SHAPES} >= {4, 16}
