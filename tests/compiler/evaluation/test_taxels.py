"""Evaluation of analog pads: their thresholds, like their placement, are learnt inside each fold."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler import GraspSet, compile_build, evaluate
from thenar.compiler.evaluation.choosing import InputChoices
from thenar.compiler.evaluation.folds import populations_of
from thenar.compiler.evaluation.plan import FoldFit, predictions
from thenar.compiler.placement.elements import Element, Elements, bits_of, elements_of, names_of
from thenar.compiler.placement.placement import select
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.samples import Samples
from thenar.compiler.trainers.base import Training
from thenar.runtime.recipe import Recipe

from ..conftest import make_set

TRAINING = {"": (Training("logitboost", {"rounds": 6}),)}


@pytest.fixture(scope="module")
def padded() -> GraspSet:
    plain = make_set(joints=1)
    pads = np.where(plain.switches[:, 3:9], 900, 100) + np.random.default_rng(4).integers(-150, 400, (96, 6))
    return replace(
        plain,
        switches=plain.switches[:, :3],
        switch_names=plain.switch_names[:3],
        taxels=np.maximum(pads, 0).astype(np.uint16),
        taxel_columns=tuple(Joint(f"pad{number}", "N", 0, 0.0, 4095, 20.0) for number in range(6)),
    )


def plain_by(grasp_set: GraspSet, elements: Elements) -> GraspSet:
    switches = bits_of(Samples.of(grasp_set), elements).switches
    names, none = names_of(grasp_set, elements), np.empty(0, np.uint16)
    return replace(grasp_set, switches=switches, switch_names=names, taxels=none, taxel_columns=())


@pytest.mark.parametrize("columns", [range(9), (0, 2, 4, 8), (3, 5), (1,), ()])
def test_a_fold_is_predicted_by_the_levels_of_its_training_rows(padded: GraspSet, columns: Sequence[int]) -> None:
    (population,) = populations_of(padded, "trial", 4, 1, 1)
    for fold in population.folds:
        every = elements_of(Samples.of(padded.rows(fold.train)), 2)
        assert len(every) > 9
        elements = tuple(element for element in every if element.column in columns)
        same = tuple(map(Element, range(len(elements))))
        found = predictions(Samples.of(padded), [FoldFit(fold, elements, (0,), population.grasps)], TRAINING)
        plain = Samples.of(plain_by(padded, elements))
        assert np.array_equal(found, predictions(plain, [FoldFit(fold, same, (0,), population.grasps)], TRAINING))


def test_choices_made_together_are_those_of_each_recipe_alone(padded: GraspSet) -> None:
    samples = Samples.of(padded)
    recipes = [
        Recipe(placement=placement, levels=levels, inputs=inputs, keep=keep, prune=prune)
        for placement, keep, prune in (("id3", None, 0), ("id3", None, 6), ("elimination", 3, 0), ("elimination", 5, 0))
        for levels in (1, 3)
        for inputs in ("switches", "both")
    ]
    several = [np.arange(96), np.arange(0, 96, 2)]
    together = InputChoices(samples)
    together.choose(recipes, several)
    chosen = [together.elements(recipe, rows) for recipe in recipes for rows in several]
    given = {"both": samples, "switches": samples.with_joints(())}
    alone = [select(given[recipe.inputs].rows(rows), recipe).kept for recipe in recipes for rows in several]
    assert chosen == alone
    assert len(set(chosen)) > 12


def test_evaluate_and_compile_agree_on_the_selected_switches_and_joints(padded: GraspSet, tmp_path: Path) -> None:
    study = evaluate(padded, jobs=1, repeats=1, rounds=6, tables=("compositions",), protocols=("nested",))
    rates = compile_build(padded, tmp_path / "build", rounds=6).manifest.rates
    row = {row.name: row for row in study.tables[0].rows}["II"]
    # The build's rate is of integers, which may part ways with the ensemble near a tie.
    assert abs(row.rate.correct[0] - rates[1].correct) <= 1
    assert row.rate.total == rates[1].total == 96


def test_thresholds_of_all_rows_would_have_been_optimistic() -> None:
    """Pads of noise tell nothing, if nobody looks at the rows that are tested."""
    random, noise = np.random.default_rng(2), make_set(joints=0)
    pads = random.integers(0, 4096, (96, 40)).astype(np.uint16)
    columns = tuple(Joint(f"pad{number}", "N", 0, 0.0, 4095, 20.0) for number in range(40))
    padded = replace(noise, switches=noise.switches[:, :0], switch_names=(), taxels=pads, taxel_columns=columns)
    leaking = plain_by(padded, elements_of(Samples.of(padded)))
    asked: dict[str, Any] = {
        "jobs": 1,
        "repeats": 2,
        "rounds": 10,
        "tables": ("compositions",),
        "protocols": ("nested",),
    }
    rates = [{row.name: row.rate for row in evaluate(each, **asked).tables[0].rows}["V"] for each in (padded, leaking)]
    assert rates[0].low <= 0.25 <= rates[0].high
    assert rates[1].mean > rates[0].mean + 0.1
