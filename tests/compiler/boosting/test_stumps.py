"""The best stump of a round, against every stump written out in exact rational arithmetic; and sums of stumps."""

import numpy as np
import pytest

from thenar.compiler.trainers.binning import bin_columns
from thenar.compiler.trainers.stumps import Stumps, Targets, fit_stumps
from thenar.runtime.model.tables import TIE, winners

Z_MAX = 3.0


def test_a_nearly_weightless_branch_predicts_the_mean() -> None:
    X = np.array([[0.0], [1.0], [1.0]])
    targets = Targets(np.array([[1e-17, 0.5, 0.5]]), np.array([[-3e-17, 0.5, 0.75]]))
    fitted = fit_stumps([bin_columns(X)], targets, Z_MAX)
    np.testing.assert_allclose(fitted.values, [[1.25, 1.25, 1.25]], rtol=1e-12)


def _equal_sums(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights and responses (1, 40): the first row has exactly what the next two have together."""
    rng = np.random.default_rng(seed)
    weights, ratios = rng.random((1, 40)), np.full((1, 40), -1.7)
    weights[0, 1:3] = weights[0, 0] / 2
    ratios[0, :3] = 1.9
    responses = weights * ratios
    responses[0, 1:3] = responses[0, 0] / 2
    first, others = np.arange(40) == 0, np.isin(np.arange(40), (1, 2))
    return np.stack([first, others]).astype(np.float64), weights, responses


def test_columns_of_equal_sums_tie_however_the_grid_rounds_them() -> None:
    for seed in range(40):
        branches, weights, responses = _equal_sums(seed)
        for columns in (branches.T, branches[::-1].T):
            fitted = fit_stumps([bin_columns(columns)], Targets(weights, responses), Z_MAX)
            assert fitted.columns[0] == 0, seed


def test_splits_of_equal_sums_tie_and_the_lowest_wins() -> None:
    for seed in range(40):
        (first, others), weights, responses = _equal_sums(seed)
        for column in (1 + first - others, 1 - first + others):
            fitted = fit_stumps([bin_columns(column[:, np.newaxis])], Targets(weights, responses), Z_MAX)
            assert fitted.thresholds[0] == 0.5, seed


def test_a_light_branch_keeps_the_bits_that_the_coarse_grid_drops() -> None:
    weights = np.array([[1e-9 / 3, 0.7, 0.3]])
    left = np.array([[1.0, 0.0, 0.0]])
    targets = Targets(weights, weights * 1.3)
    weight, response = np.ldexp(targets.branch_sums(left, None), -targets.weights.exponents)
    np.testing.assert_allclose(weight[0], weights[:, 0], rtol=1e-15)
    np.testing.assert_allclose(response[0], weights[:, 0] * 1.3, rtol=1e-15)


@pytest.mark.parametrize("decades", [-323, -320, -308, -300, 300])
def test_branch_values_do_not_depend_on_the_weights_scale(decades: int) -> None:
    left = np.array([[1.0, 1.0, 0.0, 0.0]])
    shares = np.array([[1.0, 3.0, 2.0, 2.0]])
    weights = shares * 10.0**decades
    weight, response = Targets(weights, weights * np.array([1.0, -1.0, 2.0, 3.0])).branch_sums(left, None)
    exact = [(weights[0, 0] - weights[0, 1]) / (weights[0, :2].sum()), 2.5]
    np.testing.assert_allclose(response[:2, 0] / weight[:2, 0], exact, rtol=1e-15)


@pytest.mark.parametrize(("bits", "value"), [(38, 2.0), (39, -1.0)])
def test_a_branch_of_exactly_the_least_share_is_not_empty(bits: int, value: float) -> None:
    share = 2.0**-bits
    weights = np.array([[share, 0.5 - share, 0.5]])
    targets = Targets(weights, weights * [[2.0, -1.0, -1.0]])
    fitted = fit_stumps([bin_columns(np.array([[0.0], [1.0], [1.0]]))], targets, Z_MAX)
    # An empty one answers with the mean of all, which is next to -1.
    assert fitted.values[0, 0] == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize("responses", [0.0, 5e-324])
def test_a_class_without_weight_answers_nothing_and_harms_no_other(responses: float) -> None:
    weights = np.array([[0.25, 0.25, 0.5], [0.0, 0.0, 0.0]])
    targets = Targets(weights, np.array([[0.25, 0.25, -0.5], [responses, 0.0, responses]]))
    fitted = fit_stumps([bin_columns(np.array([[0.0], [0.0], [1.0]]))], targets, Z_MAX)
    assert fitted.values.tolist() == [[1.0, -1.0, 0.0], [0.0, 0.0, 0.0]]


def test_scores_within_a_billionth_are_a_tie_that_the_lowest_number_wins() -> None:
    scores = np.array([[1.0, 1.0 + 5e-10, 0.0], [1.0, 1.0 + 2e-9, 0.0], [0.0, 1.0, 1.0], [-5.0, -7.0, -5.0 + 9e-10]])
    assert winners(scores).tolist() == [0, 1, 1, 0]


def test_scores_exactly_a_billionth_apart_are_still_a_tie() -> None:
    assert winners(np.array([[-TIE, 0.0], [np.nextafter(-TIE, -1.0), 0.0]])).tolist() == [0, 1]


@pytest.mark.parametrize("shape", [(5, 3), (5, 5), (4,), (5, 4, 1)])
def test_inputs_of_another_shape_are_not_scored(shape: tuple[int, ...]) -> None:
    stumps = Stumps(4, np.zeros((1, 2), np.int32), np.zeros((1, 2)), np.zeros((1, 2, 3)), 1.0)
    with pytest.raises(ValueError, match="the ensemble expects"):
        stumps.scores(np.zeros(shape))


@pytest.mark.parametrize("thresholds", [1, 3])
def test_arrays_of_rounds_that_do_not_agree_are_not_scored(thresholds: int) -> None:
    stumps = Stumps(4, np.zeros((2, 2), np.int32), np.zeros((thresholds, 2)), np.zeros((2, 2, 3)), 1.0)
    with pytest.raises(ValueError, match="different numbers of rounds"):
        stumps.scores(np.zeros((5, 4)))
