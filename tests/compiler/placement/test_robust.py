"""Placement and training for the worst single lost input."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler import compile_build, verify_faults
from thenar.compiler.placement.placement import choose, most_robust, spread
from thenar.compiler.samples import MASKED, Samples
from thenar.compiler.trainers.base import Training
from thenar.runtime.recipe import Recipe
from thenar.simulator import load_scene, simulate


def backed_up(seed: int = 1, n: int = 400) -> Samples:
    """Return rows of four types by two bits: switch 0 and 1 alone tell them; 2 and 3, 4 and 5 are wrong in a row or two
    and stand in for them.
    """
    random = np.random.default_rng(seed)
    labels = np.arange(n) % 4
    truth = np.stack([labels & 1, labels >> 1], axis=1).astype(bool)
    copies = [truth ^ (np.arange(n)[:, None] % n < wrong) for wrong in range(3)]
    noise = random.random((n, 3)) < 0.5
    return Samples(np.hstack([*copies, noise]), np.zeros((n, 0), np.uint16), labels, ("a", "b", "c", "d"))


def test_every_input_is_lost_in_equally_many_copies() -> None:
    random = np.random.default_rng(2)
    switches, codes = np.zeros((30, 4), bool), np.full((30, 2), 7, np.uint16)
    switches[:3], codes[:3] = True, 9
    samples = Samples(switches, codes, random.integers(0, 3, 30), ("a", "b", "c"), np.arange(30) // 2)
    rows = samples.masked()
    assert len(rows.labels) == 30 * (1 + MASKED)
    assert (rows.inputs[:30] == samples.inputs).all()
    for copy in range(1, 1 + MASKED):
        part = rows.rows(np.arange(30 * copy, 30 * (copy + 1)))
        assert (part.labels == samples.labels).all()
        assert (part.trials == samples.trials).all()
        assert ((part.inputs != samples.inputs).sum(axis=1) <= 1).all()
    assert (rows.masked().inputs[: len(rows.labels)] == rows.inputs).all()
    assert (samples.masked().inputs == rows.inputs).all()


def test_masked_training_loses_a_share_and_fills_recorded_values() -> None:
    samples = backed_up()
    lost = spread(samples, 0.2)
    assert 0.02 < (lost.switches != samples.switches).mean() < 0.2
    assert (spread(samples, 0.2).switches == lost.switches).all()
    constant = Samples(np.ones((9, 2), bool), np.zeros((9, 0), np.uint16), np.arange(9) % 2, ("a", "b"))
    assert spread(constant, 0.5).switches.all()


def test_the_placement_is_taken_whose_worst_lost_switch_costs_least() -> None:
    samples = backed_up()
    # On the rows as they are, noise beside the two that tell all; on rows with lost switches, those that stand in.
    picked = {True: (0, 1, 6, 7), False: (0, 1, 2, 3)}
    found = most_robust(samples, lambda rows: picked[rows is samples])
    assert found == picked[False]
    assert most_robust(samples, lambda _: picked[True]) == picked[True]
    # One that costs more than a point without a fault is not taken.
    worse = {True: (0, 1, 6, 7), False: (6, 7, 8, 2)}
    assert most_robust(samples, lambda rows: worse[rows is samples]) == worse[True]
    assert set(choose(samples, "elimination", 4, robust=True)[0]) <= set(range(6))


def test_options_say_that_training_is_masked() -> None:
    assert all(each.masked for each in Training.candidates(Recipe(robust=True)))
    assert not any(each.masked for each in Training.candidates(Recipe()))
    samples, training = backed_up(), Training.of(replace(Recipe(rounds=3), robust=True))
    plain = Training(training.trainer, training.settings)
    assert (training.train(samples).values == plain.train(samples.masked()).values).all()  # type: ignore[union-attr]
    (stage,) = training.stages(samples, [3])
    assert (stage.values == plain.train(samples.masked()).values).all()  # type: ignore[union-attr]


@pytest.mark.slow
def test_robust_placement_bounds_what_the_worst_lost_switch_costs(
    tmp_path: Path,
) -> None:
    """The table of docs/how-to/choose-switches.md with fewer repetitions: every fault on every row of unseen men."""
    learnt, judged = (simulate(load_scene(name).varied(20), 1).grasp_set for name in ("kamakura", "kamakura-def"))
    usual: dict[str, Any] = {"inputs": "switches", "folds": 0, "rounds": 60}
    compile_build(learnt, tmp_path / "paper", prune=62, **usual)
    compile_build(learnt, tmp_path / "robust", placement="elimination", keep=39, robust=True, **usual)
    paper, robust = (verify_faults(tmp_path / name, judged).worst for name in ("paper", "robust"))
    assert paper.lost is not None
    assert robust.lost is not None
    assert 100 * (robust.correct - robust.lost.correct) / robust.total <= 5.0
    assert 100 * (paper.correct - robust.correct) / paper.total <= 1.0
    assert robust.lost.correct > paper.lost.correct
