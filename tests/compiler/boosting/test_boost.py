"""LogitBoost's rounds as properties: what must not change the answer, and what must stay finite."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.elementary import softmax, softmax_and_loss
from thenar.compiler.samples import TrainingError
from thenar.compiler.trainers.logitboost import LARGEST_Z_MAX, SMALLEST_SHRINKAGE, boost, boost_together
from thenar.runtime.model.tables import winners

from ..conftest import grasps


@given(st.integers(0, 2**32))
@settings(max_examples=25, deadline=None)
def test_the_training_loss_never_rises_and_everything_stays_in_range(seed: int) -> None:
    X, labels = grasps(seed)
    stumps, reached = boost(X, labels, 3, rounds=40)
    losses = np.array(reached)
    assert losses[0] == pytest.approx(np.log(3), abs=1e-15)
    assert (np.diff(losses) <= 1e-12).all()
    assert np.isfinite(stumps.values).all()
    assert (np.abs(stumps.values) <= 3.0).all()
    probability = softmax(stumps.scores(X).T)
    np.testing.assert_allclose(probability.sum(axis=0), 1.0, rtol=1e-15)


@given(st.integers(0, 2**32), st.integers(2, 5))
@settings(max_examples=25, deadline=None)
def test_weights_count_as_repetitions(seed: int, times: int) -> None:
    X, labels = grasps(seed)
    repeats = np.random.default_rng(seed).integers(1, times + 1, size=len(X))
    weighted, _ = boost(X, labels, 3, rounds=20, weights=repeats.astype(np.float64))
    repeated, _ = boost(X.repeat(repeats, axis=0), labels.repeat(repeats), 3, rounds=20)
    np.testing.assert_allclose(weighted.scores(X), repeated.scores(X), atol=1e-9)


def test_the_first_rounds_are_the_same_however_many_follow() -> None:
    X, labels = grasps(7)
    long, _ = boost(X, labels, 3, rounds=50)
    short, _ = boost(X, labels, 3, rounds=10)
    assert long.first(10).values.tobytes() == short.values.tobytes()
    stages = list(long.staged_scores(X))
    assert np.array_equal(stages[9], short.scores(X))
    assert np.array_equal(stages[-1], long.scores(X))


def test_without_a_varying_column_all_classes_stay_equal() -> None:
    for X in (np.zeros((4, 2)), np.zeros((4, 0)), np.full((4, 1), np.nan)):
        stumps, losses = boost(X, np.array([0, 1, 2, 1]), 3)
        assert stumps.n_rounds == 0
        assert not stumps.scores(X).any()
        assert winners(stumps.scores(X)).tolist() == [0, 0, 0, 0]
        assert losses == pytest.approx((np.log(3),))


def test_the_tolerance_stops_early_and_says_so() -> None:
    X, labels = grasps(8)
    stumps, losses = boost(X, labels, 3, rounds=500, tolerance=1e-3)
    assert stumps.stopped_early
    assert 1 < stumps.n_rounds < 500
    assert abs(losses[-1] - losses[-2]) < 1e-3 <= abs(losses[-2] - losses[-3])


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"rounds": 0}, "rounds=0"),
        ({"shrinkage": 0.0}, "shrinkage=0.0"),
        ({"shrinkage": 5e-324}, "shrinkage=5e-324"),
        ({"shrinkage": 1.5}, "shrinkage=1.5"),
        ({"z_max": 1.0}, "z_max=1.0"),
        ({"z_max": 100.5}, "z_max=100.5"),
        ({"z_max": float("nan")}, "z_max=nan"),
        ({"tolerance": -1e-3}, "tolerance=-0.001"),
        ({"max_bins": 1}, "max_bins=1 must be at least 2"),
        ({"tolerance": float("nan")}, "tolerance=nan"),
        ({"tolerance": float("inf")}, "tolerance=inf"),
        ({"n_classes": 2}, "labels run from 0 to 2"),
        ({"weights": np.zeros(60)}, "row weights"),
        ({"weights": -np.ones(60)}, "row weights"),
        ({"weights": np.full(60, np.nan)}, "row weights"),
        ({"weights": np.full(60, np.inf)}, "row weights"),
        ({"weights": np.ones(59)}, "row weights"),
        ({"labels": np.zeros(3, dtype=np.intp)}, "must be (n, d) and (n,)"),
    ],
)
def test_options_out_of_range_are_refused_by_name(change: dict[str, Any], word: str) -> None:
    X, labels = grasps(9)
    arguments = {"X": X, "labels": labels, "n_classes": 3, **change}
    with pytest.raises(TrainingError) as refusal:
        boost(**arguments)
    assert word in str(refusal.value)


def test_an_infinite_input_is_refused_with_row_and_column() -> None:
    X = np.zeros((5, 3))
    X[3, 1] = -np.inf
    with pytest.raises(TrainingError, match="row 3, column 1"):
        boost(X, np.array([0, 1, 0, 1, 0]), 2)


def test_a_row_that_weighs_nothing_says_nothing() -> None:
    X, labels = np.array([[0], [1], [0], [1]]), np.array([0, 1, 1, 0])
    stumps, losses = boost(X, labels, 2, rounds=20, weights=np.array([1.0, 1.0, 0.0, 0.0]))
    alone, same = boost(X[:2], labels[:2], 2, rounds=20)
    assert winners(stumps.scores(X)).tolist() == [0, 1, 0, 1]
    assert stumps.values == pytest.approx(alone.values, rel=1e-12, abs=0)
    assert losses == pytest.approx(same, rel=1e-12, abs=0)


@pytest.mark.parametrize("weighted", [False, True])
def test_every_loss_is_the_loss_of_the_scores_after_that_round(weighted: bool) -> None:
    X, labels = grasps(9)
    weights = np.random.default_rng(9).random(len(X)) if weighted else None
    stumps, losses = boost(X, labels, 3, rounds=200, weights=weights)
    stages = [np.zeros((len(X), 3)), *stumps.staged_scores(X)]
    # Bit for bit: what trains and what scores adds the same numbers in the same order.
    assert losses == tuple(softmax_and_loss(scores.T, labels, weights)[1] for scores in stages)


@given(st.integers(0, 2**32))
@settings(max_examples=25, deadline=None)
def test_sets_that_are_trained_together_learn_what_each_learns_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sets = [grasps(seed + number, bits=int(rng.integers(1, 7)), joints=int(rng.integers(0, 3))) for number in range(4)]
    lacking = sets[1][0].astype(np.float64)
    lacking[rng.random(lacking.shape) < 0.2] = np.nan
    sets[1] = lacking, sets[1][1]
    options: dict[str, Any] = {"rounds": 20, "shrinkage": 0.7, "max_bins": 4 if seed % 2 else None}
    for (X, labels), together in zip(sets, boost_together(sets, 3, **options), strict=True):
        alone, _ = boost(X, labels, 3, **options)
        assert np.array_equal(together.columns, alone.columns)
        assert np.array_equal(together.thresholds, alone.thresholds)
        assert np.array_equal(together.values, alone.values)


def test_the_default_is_a_hundred_rounds_each_reported() -> None:
    X, labels = grasps(3)
    told: list[tuple[int, int]] = []
    stumps, _ = boost(X, labels, 3, on_round=lambda *done: told.append(done))
    assert stumps.n_rounds == 100
    assert told == [(done, 100) for done in range(1, 101)]


def test_a_tolerance_of_nothing_never_stops() -> None:
    X, labels = np.array([[0], [1], [0], [1]]), np.array([0, 1, 1, 0])
    stumps, losses = boost(X, labels, 2, rounds=5, tolerance=0.0)
    assert len(set(losses)) == 1
    assert (stumps.n_rounds, stumps.stopped_early) == (5, False)


@pytest.mark.parametrize("options", [{"rounds": 1}, {"shrinkage": SMALLEST_SHRINKAGE}, {"z_max": LARGEST_Z_MAX}])
def test_options_at_the_end_of_their_range_are_taken(options: dict[str, Any]) -> None:
    X, labels = grasps(2)
    assert boost(X, labels, 3, **{"rounds": 2, **options})[0].n_rounds >= 1


@pytest.mark.parametrize("shape", [(6,), (6, 1, 1), (0, 3), (5, 1)])
def test_inputs_that_are_no_table_of_the_labels_rows_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(TrainingError, match="must be"):
        boost(np.zeros(shape), np.zeros(6 if shape[0] else 0, np.intp), 2)
