from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from thenar.compiler import (
    TRAINERS,
    GraspSet,
    LogitBoostClassifier,
    Recipe,
    Samples,
    ScoreTables,
    Setting,
    Trainer,
    compile_build,
)
from thenar.compiler.trainers.base import Training
from thenar.compiler.trainers.logitboost import SMALLEST_SHRINKAGE
from thenar.compiler.trainers.stumps import Stumps
from thenar.runtime.errors import ThenarError
from thenar.runtime.recipe import changed


class Constant(Trainer):
    """Answers with tables that say nothing, of so many classes too many."""

    name = "constant"
    what = "no recogniser at all"
    settings = (
        Setting("excess", "Classes too many.", int, 0),
        Setting("weight", "Of nothing.", float, None, least=0.5),
    )

    def train(self, samples: Samples, settings: Mapping[str, Any], report: Any = None) -> ScoreTables:
        k, s, j = samples.n_classes + settings["excess"], samples.n_switches, samples.codes.shape[1]
        return ScoreTables.of(np.zeros(k), np.zeros((s, k)), (np.array([], np.uint16),) * j, (np.zeros((1, k)),) * j)


@pytest.fixture
def constant(monkeypatch: pytest.MonkeyPatch) -> Constant:
    member = Constant()
    monkeypatch.setitem(TRAINERS.__dict__, "_members", MappingProxyType({**TRAINERS, "constant": member}))
    return member


def test_options_give_a_trainer_all_its_settings(constant: Constant) -> None:
    given = {"rounds": 7, "shrinkage": 1.0, "tolerance": None, "max_bins": 3}
    assert Training.of(Recipe(rounds=7, max_bins=3)) == Training("logitboost", given)
    asked = changed(Recipe(), {"trainer": "constant", "excess": 2, "prune": 4})
    assert (asked.prune, asked.settings) == (4, {"excess": 2})
    assert Training.of(asked) == Training("constant", {"excess": 2, "weight": None})


@pytest.mark.parametrize(
    ("changes", "because"),
    [
        (
            {"trainer": "oracle"},
            "there is no trainer 'oracle': choose one of logitboost, linear, logit, discriminant, pairs, constant",
        ),
        ({"round": 3}, "no trainer has the setting 'round'"),
        ({"rounds": 0}, "rounds=0 must be at least 1"),
        ({"shrinkage": SMALLEST_SHRINKAGE / 2}, "shrinkage=5e-07 must be at least 1e-06"),
        ({"shrinkage": 1.5}, "shrinkage=1.5 must be at most 1"),
        ({"trainer": "constant", "weight": "much"}, "weight='much' must be a number"),
        ({"tolerance": -1e-9}, "tolerance=-1e-09 must be at least 0"),
        ({"trainer": "constant", "weight": 0.4}, "weight=0.4 must be at least 0.5"),
        ({"trainer": "constant", "weight": float("nan")}, "weight=nan must be at least"),
    ],
)
def test_what_a_trainer_does_not_take_is_refused(
    constant: Constant, grasp_set: GraspSet, tmp_path: Path, changes: dict[str, Any], because: str
) -> None:
    with pytest.raises(ThenarError, match=because):
        compile_build(grasp_set, tmp_path / "build", **changes)
    assert not (tmp_path / "build").exists()


def test_a_trainer_that_makes_a_model_of_something_else_is_at_fault(
    constant: Constant, grasp_set: GraspSet, tmp_path: Path
) -> None:
    with pytest.raises(ThenarError, match="returned an invalid model that has tables whose shapes do not fit"):
        compile_build(grasp_set, tmp_path / "build", trainer="constant", excess=1, folds=0)
    manifest = compile_build(grasp_set, tmp_path / "build", trainer="constant", folds=0).manifest
    assert manifest.options.settings == {"excess": 0.0}


def test_logitboost_is_the_classifier(grasp_set: GraspSet) -> None:
    samples = Samples.of(grasp_set)
    seen: list[tuple[int, int]] = []
    model = Training.of(Recipe(rounds=3, shrinkage=0.5)).train(samples, lambda *done: seen.append(done))
    classifier = LogitBoostClassifier(rounds=3, shrinkage=0.5).fit(samples.inputs, samples.labels)
    assert isinstance(model, Stumps)
    assert model.values.tobytes() == classifier.stumps_.values.tobytes()
    assert seen == [(1, 3), (2, 3), (3, 3)]


def test_stages_are_models_of_fewer_rounds_where_rounds_exist(constant: Constant, grasp_set: GraspSet) -> None:
    samples, rounds = Samples.of(grasp_set), (2, 7, 3)
    for number, stage in zip(rounds, Training.of(Recipe(max_bins=5)).stages(samples, rounds), strict=True):
        alone = Training.of(Recipe(max_bins=5, rounds=number)).train(samples)
        assert isinstance(stage, Stumps)
        assert isinstance(alone, Stumps)
        assert [stage.columns.tolist(), stage.thresholds.tolist(), stage.values.tolist()] == [
            alone.columns.tolist(),
            alone.thresholds.tolist(),
            alone.values.tolist(),
        ]
    first, *others = Training.of(Recipe(trainer="constant")).stages(samples, rounds)
    assert len(others) == 2
    assert all(other is first for other in others)
