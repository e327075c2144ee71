"""Elementary functions as properties; their errors are bounded by the case "elementary" of thenar.stability."""

import hashlib

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import solve_triangular

from thenar.compiler.elementary import (
    add_up,
    backward,
    cholesky,
    exp,
    forward,
    log,
    sincos,
    softmax_and_loss,
    softmax_and_losses,
)
from thenar.stability.reference import boosting as logistic
from thenar.stability.reference.numbers import exact, precisely, ulps


@given(st.floats(-1e308, 709.0) | st.floats(-746.0, 709.0))
def test_exp_is_within_one_ulp(x: float) -> None:
    assert ulps(float(exp(np.array([x]))[0]), logistic.exp(x)) <= 1.0


def test_exp_and_log_are_exact_at_nought_and_one() -> None:
    assert exp(np.array([0.0, -0.0]))[0] == 1.0
    assert log(np.array([1.0]))[0] == 0.0


SCORES = arrays(np.float64, (5, 3), elements=st.floats(-800, 800))


@given(SCORES)
def test_repeating_a_row_and_weighting_it_give_one_loss(scores: np.ndarray) -> None:
    labels = np.array([0, 1, 2])
    repeats = np.array([1, 3, 2])
    _, weighted = softmax_and_loss(scores, labels, repeats.astype(np.float64))
    _, repeated = softmax_and_loss(scores.repeat(repeats, axis=1), labels.repeat(repeats), None)
    np.testing.assert_allclose(weighted, repeated, rtol=1e-15)


@given(arrays(np.float64, (7, 2), elements=st.floats(-1e9, 1e9)))
def test_add_up_adds_in_the_order_of_the_rows(rows: np.ndarray) -> None:
    total = rows[0]
    for row in rows[1:]:
        total = total + row
    assert add_up(rows).tobytes() == total.tobytes()


@given(st.integers(0, 7_000).map(lambda sevenths: sevenths / -7) | st.floats(-1e3, 0.0) | st.floats(-1e-12, 0.0))
def test_the_loss_of_the_likeliest_class_is_within_five_ulp_however_small(score: float) -> None:
    loss = softmax_and_losses(np.array([[0.0], [score]]), np.array([0]))[1][0]
    with precisely():
        truth = mpmath.log1p(mpmath.exp(exact(score)))
    # The odds' one, the logarithm's two, and the correction's quotient and sum. Below 2^-1022 numbers are coarser.
    assert ulps(float(loss), truth) <= 5.0


SIXTY_FOURTHS = np.arange(-45_000, 45_000) / 64.0  # exact
GOLDEN = {
    "exp": "991b45aa694c571cdedb46b63ca4c9742351ba59a400466ea50a2d21d1efe9e9",
    "log": "57ffe75b34a13577e4020bd13166c162592bd435dc55080ee1d30e72281c786c",
    "sincos": "176d49af55f53f524c805114d8e4bb9d7220889c0e0b99d2786da11944fba0b3",
}


@pytest.mark.parametrize("name", GOLDEN)
def test_every_bit_is_what_it_is_on_every_machine(name: str) -> None:
    answers = {
        "exp": lambda: exp(SIXTY_FOURTHS),
        # The mantissa is halved from this root on; a double next to it is not.
        "log": lambda: log(np.append(SIXTY_FOURTHS[SIXTY_FOURTHS > 0], 0.7071067811865476)),
        "sincos": lambda: np.stack(sincos(SIXTY_FOURTHS)),
    }
    assert hashlib.sha256(answers[name]().tobytes()).hexdigest() == GOLDEN[name]


FURTHEST = 1000.0


@given(arrays(np.float64, (3, 2), elements=st.floats(-FURTHEST, FURTHEST)))
def test_sine_and_cosine_are_elementwise_and_sine_is_odd(x: np.ndarray) -> None:
    sine, cosine = sincos(x)
    assert sine.shape == cosine.shape == x.shape
    for row, column in np.ndindex(*x.shape):
        alone = sincos(x[row, column : column + 1])
        assert (alone[0][0], alone[1][0]) == (sine[row, column], cosine[row, column])
    turned = sincos(-x)
    np.testing.assert_array_equal(turned[0], -sine)
    np.testing.assert_array_equal(turned[1], cosine)


@given(st.integers(0, 2**32 - 1), st.integers(1, 20), st.integers(1, 3))
def test_equations_are_solved_as_by_lapack(seed: int, n: int, columns: int) -> None:
    random = np.random.default_rng(seed)
    root, right = random.normal(size=(n, n)), random.normal(size=(n, columns))
    matrix = root @ root.T + np.eye(n)
    lower = cholesky(matrix)
    np.testing.assert_allclose(lower, np.linalg.cholesky(matrix), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(forward(lower, right), solve_triangular(lower, right, lower=True), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(backward(lower, right), np.linalg.solve(lower.T, right), rtol=1e-9, atol=1e-9)
