"""The fit beside scikit-learn's, which minimises the same sum, and beside itself with the rows in another order."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sklearn.linear_model import LogisticRegression

from thenar.compiler.elementary import dot
from thenar.compiler.placement.logistic import RIDGE, Logistic

Bits = npt.NDArray[np.bool_]
Labels = npt.NDArray[np.intp]
Floats = npt.NDArray[np.float64]


def grasps(seed: int, n: int = 200, s: int = 12, classes: int = 4) -> tuple[Bits, Labels]:
    random = np.random.default_rng(seed)
    labels = random.integers(0, classes, n)
    return ((random.random((classes, s)) < 0.4)[labels] ^ (random.random((n, s)) < 0.2)).T, labels


def fitted(bits: Bits, labels: Labels) -> npt.NDArray[np.float64]:
    model = LogisticRegression(C=1 / RIDGE, tol=1e-10, max_iter=5000).fit(bits.T, labels)
    probability: npt.NDArray[np.float64] = model.predict_proba(bits.T).T
    return probability


@pytest.mark.parametrize("seed", range(3))
def test_it_comes_to_scikit_learns_probabilities(seed: int) -> None:
    bits, labels = grasps(seed)
    fit = Logistic(bits, labels, 4)
    fit.improve(300)
    np.testing.assert_allclose(fit.probability, fitted(bits, labels), atol=1e-5)


def test_without_columns_it_goes_on_to_the_fit_of_the_rest() -> None:
    bits, labels = grasps(5)
    fit = Logistic(bits, labels, 4)
    fit.improve(60)
    rest = fit.without([2, 7])
    worse = rest.loss
    rest.improve(300)
    assert fit.loss < rest.loss < worse
    np.testing.assert_allclose(rest.probability, fitted(np.delete(bits, [2, 7], axis=0), labels), atol=1e-5)
    assert fit.rows.shape == (13, 4)


@pytest.mark.parametrize("seed", range(3))
def test_without_columns_the_newest_step_keeps_the_secant_equation(seed: int) -> None:
    """The estimated inverse Hessian turns the change of the gradient into the step (Nocedal and Wright, 6.6)."""
    fit = Logistic(*grasps(seed), 4)
    fit.improve(12)
    for one in (fit, fit.without([2, 7])):
        step, turned, curvature = one._pairs[-1]
        assert curvature > 0
        one._gradient = turned
        np.testing.assert_allclose(-one._direction(), step, rtol=1e-9, atol=1e-12)


def test_the_order_of_the_rows_changes_no_bit() -> None:
    bits, labels = grasps(7)
    order = np.random.default_rng(1).permutation(len(labels))
    one, other = Logistic(bits, labels, 4), Logistic(bits[:, order], labels[order], 4)
    for fit in (one, other):
        fit.improve(40)
    assert np.array_equal(one.rows, other.rows)
    assert np.array_equal(one.without([3]).rows, other.without([3]).rows)


@given(arrays(np.float64, (3, 4), elements=st.floats(-1e-160, 1e-160)))
def test_products_next_to_the_smallest_doubles_do_no_harm(values: Floats) -> None:
    assert abs(dot(values, values)) <= 1e-300
