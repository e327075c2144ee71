from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from thenar.compiler import LogitBoostClassifier, grow_id3
from thenar.compiler.evaluation.choosing import InputChoices
from thenar.compiler.evaluation.folds import PROTOCOLS, Fold, ProtocolName, populations_of, weka_folds
from thenar.compiler.evaluation.plan import (
    COMPOSITIONS,
    DRAWS,
    Composition,
    FoldFit,
    Planner,
    RowPlan,
    available,
    predictions,
)
from thenar.compiler.placement.elements import Element, columns_of
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.compiler.trainers.base import Training
from thenar.runtime.recipe import Recipe

from .conftest import make_grasps

OF_THE_PAPER = {
    "I": ("Angle + All-Co", True, (0, 1, 2, 3)),
    "II": ("Angle + Sel-Co", True, (1, 3)),
    "III": ("Angle + NoSel-Co", True, (0, 2)),
    "IV": ("Angle", True, ()),
    "V": ("All-Co", False, (0, 1, 2, 3)),
    "VI": ("Sel-Co", False, (1, 3)),
    "VII": ("NoSel-Co", False, (0, 2)),
}
FOUR = tuple(map(Element, range(4)))


@pytest.mark.parametrize("composition", COMPOSITIONS, ids=lambda c: c.name)
def test_compositions_are_the_papers(composition: Composition) -> None:
    # Four switches, of which 3 and 1 are selected.
    found = columns_of(composition.elements((Element(3), Element(1)), FOUR))
    assert (composition.what, composition.angle, found) == OF_THE_PAPER[composition.name]


@pytest.mark.parametrize(
    ("n_switches", "n_joints", "names"),
    [(0, 6, ["IV"]), (60, 0, ["V", "VI", "VII"]), (60, 9, list(OF_THE_PAPER))],
)
def test_a_set_gets_the_compositions_it_has_inputs_for(n_switches: int, n_joints: int, names: list[str]) -> None:
    assert [composition.name for composition in available(n_switches, n_joints)] == names


both_protocols = pytest.mark.parametrize("protocol", PROTOCOLS)


def planner_of(grasps: GraspSet, prune: int = 0, repeats: int = 2) -> Planner:
    populations = populations_of(grasps, "trial", 4, repeats, 1)
    return Planner(populations, InputChoices(Samples.of(grasps)), Recipe(prune=prune), (0, 30))


@pytest.fixture(scope="module")
def planner() -> Planner:
    return planner_of(make_grasps(noise=0.25))


def row(table: list[RowPlan], name: str) -> RowPlan:
    (found,) = (candidate for candidate in table if candidate.name == name)
    return found


@both_protocols
def test_every_cell_tests_each_row_of_its_subject_once_a_repeat(planner: Planner, protocol: ProtocolName) -> None:
    for name in ("compositions", "generality", "pruning"):
        for line in planner.table(name, protocol):
            for cell in line.cells:
                for run in cell.runs:
                    assert np.array_equal(np.sort(np.concatenate([fit.fold.test for fit in run])), cell.population.rows)


def test_the_papers_placement_is_per_subject_the_nested_one_per_fold(planner: Planner) -> None:
    for cell in row(planner.table("compositions", "paper"), "VI").cells:
        assert len({fit.elements for fit in cell.fits}) == 1
    columns = [{fit.elements for fit in cell.fits} for cell in row(planner.table("compositions", "nested"), "VI").cells]
    assert max(map(len, columns)) > 1


@both_protocols
def test_the_diagonal_of_generality_is_composition_six(planner: Planner, protocol: ProtocolName) -> None:
    six = row(planner.table("compositions", protocol), "VI")
    for i, line in enumerate(planner.table("generality", protocol)):
        assert line.cells[i] == six.cells[i]


def test_off_the_diagonal_both_protocols_take_the_others_placement(planner: Planner) -> None:
    paper, nested = (planner.table("generality", protocol) for protocol in PROTOCOLS)
    for i, line in enumerate(paper):
        giver = planner.populations[i]
        given = tuple(sorted(planner.chosen(giver.rows)))
        for j, cell in enumerate(line.cells):
            if i != j:
                assert cell == nested[i].cells[j]
                assert {fit.elements for fit in cell.fits} == {given}


@both_protocols
def test_pruning_starts_from_all_switches_and_takes_one_placement_for_all_subjects(
    planner: Planner, protocol: ProtocolName
) -> None:
    table = planner.table("pruning", protocol)
    assert [line.name for line in table] == ["all", "0", "30"]
    assert {fit.elements for cell in table[0].cells for fit in cell.fits} == {tuple(map(Element, range(12)))}
    everyone = np.concatenate([population.rows for population in planner.populations])
    for line, least in zip(table[1:], (0, 30), strict=True):
        for cell in line.cells:
            for fit in cell.fits:
                seen = everyone if protocol == "paper" else np.setdiff1d(everyone, fit.fold.test)
                assert fit.elements == tuple(sorted(planner.chosen(seen, prune=least)))


@both_protocols
def test_baselines_have_as_many_switches_as_id3_in_every_fold(planner: Planner, protocol: ProtocolName) -> None:
    table = planner.table("baselines", protocol)
    id3 = row(table, "ID3")
    assert [line.name for line in table] == ["ID3", "CMIM", "top-k", "random"]
    for line in table:
        for cell, reference in zip(line.cells, id3.cells, strict=True):
            draws = DRAWS if line.name == "random" else 1
            assert len(cell.runs) == draws * len(reference.runs)
            sizes = [len(fit.elements) for fit in reference.fits] * draws
            assert [len(fit.elements) for fit in cell.fits] == sizes


@both_protocols
def test_baselines_choose_from_the_rows_that_id3_may_choose_from(planner: Planner, protocol: ProtocolName) -> None:
    table = planner.table("baselines", protocol)
    for name, method in (("CMIM", "cmim"), ("top-k", "mutual-information")):
        for cell in row(table, name).cells:
            for fit in cell.fits:
                seen = cell.population.rows if protocol == "paper" else fit.fold.train
                assert fit.elements == tuple(sorted(planner.chosen(seen, placement=method, keep=len(fit.elements))))


def test_every_method_sees_exactly_the_rows_given_in_whatever_order() -> None:
    grasps, rows = make_grasps(noise=0.3), np.arange(5, 40)
    used, fresh = planner_of(grasps), planner_of(grasps)
    seen = Samples.of(grasps, "switches").rows(rows)
    assert columns_of(used.chosen(rows, prune=4)) == grow_id3(seen.switches, seen.labels, min_samples=4).inputs
    assert used.chosen(rows, prune=20) == fresh.chosen(rows[::-1], prune=20) != used.chosen(rows)
    assert used.chosen(rows[:20]) == fresh.chosen(rows[:20])
    for name in ("cmim", "mutual-information"):
        assert used.chosen(rows, placement=name, keep=3) == fresh.chosen(rows, placement=name, keep=3)
        assert columns_of(used.chosen(rows, placement=name, keep=3)) == METHODS[name].chooser(seen)(3)


def test_any_method_can_be_a_baseline() -> None:
    table = replace(planner_of(make_grasps()), baselines=("id3-cost",)).table("baselines", "nested")
    assert [line.name for line in table] == ["ID3", "id3-cost", "random"]


def test_what_differs_in_its_number_alone_is_chosen_together_and_once() -> None:
    asked: list[tuple[float, ...]] = []

    def ask(function: Callable[..., Any], calls: Sequence[tuple[Any, ...]]) -> list[Any]:
        asked.extend(call[3] for call in calls)
        return [function(*call) for call in calls]

    samples, rows = Samples.of(make_grasps(noise=0.3)), np.arange(5, 40)
    recipes = [Recipe(placement=name, keep=keep) for name in ("cmim", "mutual-information") for keep in (2, 5)]
    choices = InputChoices(samples, ask=ask)
    choices.choose(recipes, [rows])
    assert asked == [(2.0, 5.0), (2.0, 5.0)]
    for recipe in recipes:
        assert choices.elements(recipe, rows) == InputChoices(samples).elements(recipe, rows)
    assert len(asked) == 2


QUICK = {"": (Training("logitboost", {"rounds": 5}),)}


@pytest.fixture
def fits() -> tuple[GraspSet, list[FoldFit]]:
    grasps = make_grasps(noise=0.3)
    folds = weka_folds(grasps.labels, 4, 1)
    inputs = [(tuple(map(Element, columns)), joints) for columns, joints in [((0, 1, 2), ()), ((3, 4), (0,))]]
    return grasps, [FoldFit(fold, *each, (0, 1, 2, 3)) for fold in folds for each in inputs]


def test_a_fit_answers_as_the_classifier_does(fits: tuple[GraspSet, list[FoldFit]]) -> None:
    grasps, todo = fits
    samples = Samples.of(grasps)
    training = Training("logitboost", {"rounds": 5, "shrinkage": 0.5})
    for fit, found in zip(todo, predictions(samples, todo, {"": (training,)}), strict=True):
        columns = [*(element.column for element in fit.elements), *(12 + joint for joint in fit.joints)]
        part = samples.inputs[:, columns]
        classifier = LogitBoostClassifier(rounds=5, shrinkage=0.5)
        classifier.fit(part[fit.fold.train], grasps.labels[fit.fold.train])
        assert np.array_equal(found, classifier.predict(part[fit.fold.test]))


def test_labels_keep_their_numbers_where_some_do_not_occur() -> None:
    grasps = make_grasps(noise=0.0)
    rows = np.flatnonzero(np.isin(grasps.labels, (1, 3)))
    fold = Fold(rows[::2], rows[1::2], "1")
    fit = FoldFit(fold, tuple(map(Element, range(12))), (), (1, 3))
    (found,) = predictions(Samples.of(grasps), [fit], QUICK)
    assert np.array_equal(found, grasps.labels[fold.test])


def test_where_no_input_varies_the_most_frequent_training_label_is_answered() -> None:
    grasps = make_grasps()
    rows = np.concatenate([np.flatnonzero(grasps.labels == 2)[:5], np.flatnonzero(grasps.labels == 1)[:4]])
    codes = grasps.codes.copy()
    codes[rows, :2] = 7, 65535
    samples = Samples.of(replace(grasps, codes=codes))
    fit = FoldFit(Fold(rows, np.arange(6), "1"), (), (0, 1), (0, 1, 2, 3))
    assert fit.is_blind(samples)
    (found,) = predictions(samples, [fit], QUICK)
    assert found.tolist() == [2] * 6
    codes[rows[-1], 1] = 0
    assert not fit.is_blind(Samples.of(replace(grasps, codes=codes)))
