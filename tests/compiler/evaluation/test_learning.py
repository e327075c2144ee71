from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import nnls

from thenar.compiler.evaluation.choosing import InputChoices
from thenar.compiler.evaluation.folds import EvaluationError
from thenar.compiler.evaluation.learning import LEAST, expected, plan_learning, power_law
from thenar.compiler.evaluation.plan import Planner, learners
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.evaluation.study import LEARNING_NAME, StudyDesign, draw, evaluate
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.runtime.recipe import Recipe

from .conftest import make_grasps

N = np.array([2.0, 4.0, 8.0, 16.0])
QUICK = StudyDesign(Recipe(trainer="logitboost", rounds=3), repeats=1, tables=(), protocols=("nested",), learning=True)


def planned(grasps: GraspSet) -> Planner:
    return Planner((), InputChoices(Samples.of(grasps)), Recipe(seed=3))


@given(st.floats(0, 0.5), st.floats(0, 0.5), st.integers(1, 60))
def test_a_law_is_found_again(a: float, b: float, exponent: int) -> None:
    def law(n: np.ndarray) -> np.ndarray:
        return a + b * n ** (-exponent / 30)

    (found,) = power_law(N, law(N)[np.newaxis], np.ones(4), np.array([32.0, 64.0]))
    assert found == pytest.approx(law(np.array([32.0, 64.0])), abs=1e-6)


@given(st.lists(st.floats(0, 1), min_size=4, max_size=4), st.lists(st.floats(0.1, 100), min_size=4, max_size=4))
def test_no_law_with_parts_of_at_least_0_has_smaller_squares(errors: list[float], weights: list[float]) -> None:
    scale = np.sqrt(weights)
    best = min(
        nnls(scale[:, None] * np.column_stack([np.ones(4), (N / 2) ** (-step / 30)]), scale * errors)[1]
        for step in range(1, 61)
    )
    (fitted,) = power_law(N, np.array([errors]), np.array(weights), N)
    assert np.linalg.norm(scale * (fitted - errors)) == pytest.approx(best, rel=1e-6, abs=1e-9)


@pytest.mark.slow
def test_what_is_expected_holds_the_truth_about_as_often_as_it_says() -> None:
    random, held = np.random.default_rng(5), []
    for case in range(60):
        a, b, c = random.uniform(0, 0.1), random.uniform(0.1, 0.6), random.uniform(0.3, 1.5)
        hardness = random.random(150)
        errors = np.append(a + b * N**-c, a + b * np.array([32.0, 64.0]) ** -c)
        # A trial is recognised as soon as the error falls below its rank, give or take another training.
        noisy = hardness + random.normal(0, 0.05, (4, 2, 150))
        hits = noisy > errors[:4, None, None]
        rates = [Rate.counted(tuple(each.sum(axis=1).tolist()), 150, of="pooled") for each in hits]
        found = expected((2, 4, 8, 16), rates, hits, np.arange(150), case)
        assert [each.repetitions for each in found] == [32, 64]
        held += [each.low <= 1 - error <= each.high for each, error in zip(found, errors[4:], strict=True)]
    assert np.mean(held) >= 0.93


def test_where_nothing_is_missed_nothing_is_promised() -> None:
    hits = np.ones((4, 1, 40), bool)
    rates = [Rate.counted((40,), 40, of="pooled")] * 4
    for each in expected((2, 4, 8, 16), rates, hits, np.arange(40), 1):
        assert (each.mean, each.high) == pytest.approx((1.0, 1.0))
        assert each.low <= rates[-1].low < 0.92


@pytest.mark.parametrize("scheme", ["trial", "subject"])
def test_so_many_trials_of_each_type_and_person_are_trained_on(scheme: str) -> None:
    grasps = make_grasps(per_type=16)
    frames = grasps.rows(np.repeat(np.arange(len(grasps)), 3))
    planner = planned(frames)
    data, plan = planner.samples, plan_learning(planner, frames.subjects, scheme, 2)  # type: ignore[arg-type]
    last = 12 if scheme == "trial" else 16
    assert plan.repetitions == (2, 4, 8, last)
    assert plan.of == ("pooled" if scheme == "trial" else "new subject")
    assert tuple(plan.cells) == learners()
    cells = plan.cells["logitboost"]
    for run in range(2):
        tested = np.concatenate([fit.fold.test for fit in cells[0].runs[run]])
        assert sorted(tested.tolist()) == list(range(len(frames)))
        for smaller, larger in pairwise(cells):
            for few, many in zip(smaller.runs[run], larger.runs[run], strict=True):
                assert set(few.fold.train) < set(many.fold.train)
        for cell, size in zip(cells, plan.repetitions, strict=True):
            for fit in cell.runs[run]:
                rows = fit.fold.train
                assert not np.isin(data.trials[rows], data.trials[fit.fold.test]).any()
                kinds = np.stack([data.labels[rows], frames.subjects[rows] == "A", data.trials[rows]])
                counts = np.unique(np.unique(kinds, axis=1)[:2], axis=1, return_counts=True)[1]
                # Whole trials of three frames each. Folds are stratified by types: of all, a person has some more.
                assert len(rows) == 3 * counts.sum()
                assert set(counts) == {size} if size < last else counts.mean() == last


def test_curves_rise_and_say_what_to_expect(tmp_path: Path) -> None:
    study = evaluate(make_grasps(noise=0.2, per_type=16), QUICK, jobs=1)
    learning = study.learning
    assert learning is not None
    assert study.tables == ()
    assert (learning.repetitions, learning.further, learning.note) == ((2, 4, 8, 12), (24, 48), "")
    for curve in learning.curves:
        assert curve.rates[-1].mean >= curve.rates[0].mean
        assert all(rate.total == 128 for rate in curve.rates)
        assert all(each.low <= min(each.mean, curve.rates[-1].mean) <= each.high <= 1 for each in curve.expected)
    assert [path.name for path in draw(study, tmp_path)] == [LEARNING_NAME]
    assert (tmp_path / LEARNING_NAME).read_bytes().startswith(b"<?xml")


def test_other_cuts_and_single_repetitions_have_no_curve() -> None:
    with pytest.raises(EvaluationError, match="not objects left out"):
        evaluate(make_grasps(), QUICK.changed(scheme="object"), jobs=1)
    with pytest.raises(EvaluationError, match="needs more than 2 repetitions to train on, and there are 2"):
        evaluate(make_grasps(per_type=3), QUICK.changed(folds=3), jobs=1)
    study = evaluate(make_grasps(per_type=8), QUICK, jobs=1)
    assert study.learning is not None
    assert len(study.learning.repetitions) < LEAST
    assert study.learning.further == ()
    assert study.learning.note.startswith("The effect of more repetitions is not extrapolated")
