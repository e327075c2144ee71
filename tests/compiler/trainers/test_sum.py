"""The trainer `sum`: one table that adds what both of its trainers add."""

from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import GraspSet, Options, Samples, compile_build, verify
from thenar.compiler.tables.collapse import ScoreTables, collapse
from thenar.compiler.trainers.base import Training


@pytest.mark.parametrize("max_bins", [None, 5])
def test_its_scores_are_the_sums_of_both_scores(grasp_set: GraspSet, max_bins: int | None) -> None:
    samples = Samples.of(grasp_set)

    def scores(trainer: str, **own: float | str) -> np.ndarray:
        options = Options(trainer=trainer, max_bins=max_bins, settings=own)
        model = collapse(Training.of(options).train(samples), samples.n_switches)
        return model.scores(samples.switches, samples.codes)

    both = scores("sum", rounds=7, penalty=2.0)
    np.testing.assert_allclose(both, scores("logitboost", rounds=7) + scores("logit", penalty=2.0), atol=1e-12)


def test_its_stages_are_the_models_of_fewer_rounds(grasp_set: GraspSet) -> None:
    samples = Samples.of(grasp_set)
    for rounds, stage in zip((2, 6, 4), Training.of(Options(trainer="sum")).stages(samples, (2, 6, 4)), strict=True):
        alone = Training.of(Options(trainer="sum", rounds=rounds)).train(samples)
        assert isinstance(alone, ScoreTables)
        assert isinstance(stage, ScoreTables)
        assert np.array_equal(stage.switch_rows, alone.switch_rows)
        assert all(map(np.array_equal, stage.joint_rows, alone.joint_rows))


@pytest.mark.parametrize("trainer", ["logit", "sum"])
def test_a_build_of_it_holds(grasp_set: GraspSet, tmp_path: Path, trainer: str) -> None:
    made = compile_build(grasp_set, tmp_path / "build", trainer=trainer, folds=2, smoothness=3.0)
    assert made.manifest.options.settings["smoothness"] == 3.0
    assert verify(tmp_path / "build", grasp_set).holds
