"""Rounds under any row weights are those of 60 digits; what is settled weighs nothing; scores keep zero mean."""

from dataclasses import replace

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import centred
from thenar.stability.cases.weights import drift, true_sums, worst_share
from thenar.stability.checks.class_rounds import see_round
from thenar.stability.checks.rounds import mean_score, moments
from thenar.stability.finding import Worst
from thenar.stability.inputs.hard_data import contradictory, noisy, separable

WEIGHTS = st.one_of(
    st.floats(1.0, 1e7), st.floats(5e-324, 1e308), st.sampled_from([5e-324, 2.0**-1022, 1e-300, 1.0, 1e300, 1.7e308])
)


@given(st.lists(WEIGHTS, min_size=12, max_size=12), st.integers(0, 2**32))
@settings(max_examples=20, deadline=None)
def test_every_round_is_that_of_60_digits_whatever_the_rows_weigh(weights: list[float], seed: int) -> None:
    hard = replace(noisy(3, 12, 0.3, seed), weights=np.array(weights))
    chosen, answers = Worst("stumps", "", 1.0, ""), Worst("answers", "", 1.0, "")
    stumps, losses = boost(hard.X, hard.labels, 3, rounds=6, weights=hard.weights)
    assert np.isfinite(losses).all()
    for number, moment in enumerate(moments(hard, stumps)):
        assert np.isfinite(moment.scores).all()
        if number < stumps.n_rounds:
            see_round(hard, stumps, number, moment.scores, 3.0, chosen, answers)
    assert chosen.finding().holds
    assert answers.finding().holds


def test_a_round_that_is_off_is_found() -> None:
    hard = noisy(3, 12, 0.3, seed=1)
    stumps, _ = boost(hard.X, hard.labels, 3, rounds=1)
    chosen, answers = Worst("stumps", "", 1.0, ""), Worst("answers", "", 1.0, "")
    off = replace(stumps, values=stumps.values * (1 + 2.0**-47), columns=stumps.columns * 0)
    see_round(hard, off, 0, np.zeros((3, 12)), 3.0, chosen, answers)
    assert not chosen.finding().holds
    assert not answers.finding().holds


@given(st.integers(2, 8), st.integers(1, 3))
@settings(max_examples=15, deadline=None)
def test_a_row_whose_probability_is_1_weighs_exactly_nothing_with_its_class(classes: int, rows: int) -> None:
    hard = separable(classes, rows)
    stumps, _ = boost(hard.X, hard.labels, classes, rounds=60)
    *_, last = moments(hard, stumps)
    settled = hard.member & (last.shares == 1.0)
    assert settled.any(axis=0).all()
    assert not last.weights[settled].any()
    assert not last.responses[settled].any()


def test_an_empty_class_sinks_through_the_smallest_doubles_and_then_answers_0() -> None:
    hard = contradictory([[2, 1, 0], [1, 1, 0]])
    stumps, _ = boost(hard.X, hard.labels, 3, rounds=1200, weights=hard.weights)
    lightest = [float(moment.weights[2].max()) for moment in moments(hard, stumps)]
    gone = lightest.index(0.0)
    assert 0 < lightest[gone - 1] < 1e-320
    assert not stumps.values[gone:, 2].any()
    assert stumps.values[gone - 1, 2, 0] == -1.0


@given(st.integers(2, 33), st.floats(0.01, 0.99))
@settings(max_examples=20, deadline=None)
def test_a_clamp_below_every_response_is_what_every_branch_answers(classes: int, share: float) -> None:
    z_max = 1 + share / (classes - 1)
    assume(1 < z_max < classes / (classes - 1))
    hard = separable(classes)
    stumps, _ = boost(hard.X, hard.labels, classes, rounds=1, z_max=z_max)
    np.testing.assert_allclose(np.abs(stumps.values[0, :, :2]), z_max, rtol=2.0**-51)


@given(st.integers(2, 33), st.floats(0.01, 1.0), st.integers(0, 2**32))
def test_a_step_has_zero_mean_within_the_roundings_that_its_docstring_counts(k: int, nu: float, seed: int) -> None:
    answers = np.random.default_rng(seed).uniform(-3, 3, (k, 5))
    assert mean_score(centred(answers, nu)) <= (k + 6) * 2.0**-53 * 3


def test_scores_hold_over_300_rounds_that_never_settle() -> None:
    assert all(finding.holds for finding in drift(300))


def test_a_plain_sum_of_the_steps_would_drift_and_be_found() -> None:
    steps = np.random.default_rng(1).normal(0, 1, (5000, 4))
    truth, allowed = true_sums(steps)
    assert worst_share(np.cumsum(steps, axis=0)[-1].tolist(), truth, allowed) > 1
