"""exp, log, softmax and loss against 50-digit arithmetic."""

import mpmath
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.elementary import add_up, exp, log, softmax, softmax_and_loss

mpmath.mp.dps = 50


def ulps(got: float, truth: mpmath.mpf) -> float:
    return float(abs(mpmath.mpf(got) - truth) / mpmath.mpf(float(np.spacing(abs(float(truth))))))


@given(st.floats(-708.0, 709.0))
def test_exp_is_within_one_ulp(x: float) -> None:
    assert ulps(float(exp(np.array([x]))[0]), mpmath.exp(mpmath.mpf(x))) <= 1.0


@given(st.floats(-1e308, -708.0))
def test_exp_underflows_gradually_to_nothing(x: float) -> None:
    got = float(exp(np.array([x]))[0])
    assert abs(mpmath.mpf(got) - mpmath.exp(mpmath.mpf(x))) <= mpmath.mpf(5e-324)


@given(st.floats(5e-324, 1e308))
def test_log_is_within_two_ulp(x: float) -> None:
    truth = mpmath.log(mpmath.mpf(x))
    got = float(log(np.array([x]))[0])
    assert got == 0.0 if x == 1.0 else ulps(got, truth) <= 2.0


def test_exp_and_log_are_exact_at_nought_and_one() -> None:
    assert exp(np.array([0.0, -0.0]))[0] == 1.0
    assert log(np.array([1.0]))[0] == 0.0


SCORES = arrays(np.float64, (5, 3), elements=st.floats(-800, 800))


@given(SCORES)
def test_softmax_is_the_definition_at_every_distance(scores: np.ndarray) -> None:
    got = softmax(scores)
    for column in range(scores.shape[1]):
        powers = [
            mpmath.exp(mpmath.mpf(float(s)) - mpmath.mpf(float(scores[:, column].max()))) for s in scores[:, column]
        ]
        truth = [power / mpmath.fsum(powers) for power in powers]
        # F_k - max F is rounded once: with |F_k - max F| <= 1600 that is 2^-43 absolute, a relative 2^-43 of e^x; exp,
        # sum of 5 and quotient add a few 2^-53. What underflows may lose one subnormal.
        for p, t in zip(got[:, column], truth, strict=True):
            assert abs(mpmath.mpf(float(p)) - t) <= t * mpmath.mpf(2) ** -42 + mpmath.mpf(5e-324)


@given(SCORES, st.lists(st.integers(0, 4), min_size=3, max_size=3))
def test_loss_is_the_mean_of_minus_log_p(scores: np.ndarray, labels: list[int]) -> None:
    _, loss = softmax_and_loss(scores, np.array(labels), None)
    truth = mpmath.mpf(0)
    for column, label in enumerate(labels):
        own = mpmath.mpf(float(scores[label, column]))
        truth += mpmath.log(mpmath.fsum(mpmath.exp(mpmath.mpf(float(s)) - own) for s in scores[:, column]))
    assert abs(loss - truth / 3) <= 1e-15 * abs(truth) + 1e-15


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
