"""Recognition at initial contact, by the force on the taxel that is pressed hardest."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler.evaluation.folds import EvaluationError
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.runtime.recipe import Recipe

from .sets import grasp_set_of

NEWTONS = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
FAST = Recipe(trainer="logitboost", rounds=10)


@pytest.fixture
def onset(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """Return the benchmarks' function of a set, forces and options."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "benchmarks"))
    made: Callable[..., Any] = import_module("onset").onset
    return made


def pressed(trials: int = 24, joints: int = 0, unit: str = "N") -> GraspSet:
    """Return trials of two types on two taxels, frames of 0 to 1.2 N: from 0.4 N on, each type presses its own."""
    random = np.random.default_rng(3)
    force = np.tile(np.linspace(0.0, 1.2, 7), trials)
    kind = np.repeat(np.arange(trials) % 2, 7)
    # Below, which is pressed is by chance.
    which = np.where(force < 0.3, np.repeat(random.integers(0, 2, trials), 7), kind)
    codes = np.zeros((len(force), 2))
    codes[np.arange(len(force)), which] = np.rint(force * 1000)
    return grasp_set_of(
        ["hook", "pinch"],
        kind,
        codes=np.repeat(random.integers(0, 9, (trials, joints)), 7, axis=0),
        joints=tuple(Joint(f"j{n}", "deg", 0, 0.0, 100, 90.0) for n in range(joints)),
        objects=np.full(len(force), "pen"),
        trials=np.repeat(np.arange(trials), 7),
        taxels=codes.astype(np.uint16),
        taxel_columns=tuple(Joint(f"pad{n}", unit, 0, 0.0, 1000, 1.0) for n in range(2)),
    )


def test_the_curves_are_drawn_with_named_axes_and_bands(onset: Callable[..., Any], tmp_path: Path) -> None:
    module = import_module("onset")
    found = onset(pressed(12, joints=2), NEWTONS, n_folds=2, jobs=1, options=FAST)
    module.draw(found, tmp_path / "onset.svg")
    drawn = (tmp_path / "onset.svg").read_text()
    for words in ("force on the taxel pressed hardest, N", "accuracy of single frames", "levels and joints"):
        assert f"<!-- {words}" in drawn
    assert drawn.count('id="FillBetweenPolyCollection_') == len(found.curves) == 7
    module.draw(found, tmp_path / "again.svg")
    assert (tmp_path / "again.svg").read_text() == drawn


def test_levels_and_codes_tell_what_switches_do_not_before_their_force(onset: Callable[..., Any]) -> None:
    found = onset(pressed(), NEWTONS, jobs=1, options=FAST)
    curves = {curve.title: [rate.mean for rate in curve.rates if rate is not None] for curve in found.curves}
    assert list(curves) == ["switches", "levels", "codes"]
    assert curves["levels"][1:] == curves["codes"][1:] == [1.0] * 5
    assert max(curves["switches"][:5]) < 0.8
    assert curves["switches"][5] == 1.0
    assert curves["levels"][0] < 0.8


def test_every_trial_counts_once_and_rates_have_wilsons_interval(onset: Callable[..., Any]) -> None:
    found = onset(pressed(24), NEWTONS, jobs=1, options=FAST)
    for curve in found.curves:
        for rate in curve.rates:
            assert rate is not None
            assert (rate.total, rate.over, rate.unit) == (24, 24, "trials")
            assert rate.low < 1.0
    assert found.curves[1].rates[1].low == pytest.approx(24 / (24 + 1.959964**2), abs=1e-4)


def test_joints_are_read_alone_and_with_each(onset: Callable[..., Any]) -> None:
    titles = [curve.title for curve in onset(pressed(joints=1), NEWTONS, jobs=1, options=FAST).curves]
    assert titles[3:] == ["joints", "switches and joints", "levels and joints", "codes and joints"]


def test_a_force_without_trials_has_no_rate(onset: Callable[..., Any]) -> None:
    found = onset(pressed(), (1.0, 1.2, 1.4), jobs=1, options=FAST)
    assert [rate is None for rate in found.curves[0].rates] == [False, False, True]
    with pytest.raises(EvaluationError, match="no trial has a frame"):
        onset(pressed(), (5.0, 6.0), jobs=1, options=FAST)


def test_taxels_in_counts_are_no_forces(onset: Callable[..., Any]) -> None:
    with pytest.raises(EvaluationError, match="calibrate them to N"):
        onset(pressed(unit="counts"), NEWTONS, jobs=1, options=FAST)
