"""Boosting comes to rest on the shares of the counts, however the rows say them, and never below the entropy left."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import entropy

from thenar.compiler.boosting.boost import boost
from thenar.stability.checks.rounds import counted, entropy_left, loss_rounding, moments, resting_error
from thenar.stability.inputs.hard_data import contradictory, imbalanced, noisy, repeated

COUNT = st.integers(1, 9) | st.integers(1, 10**7)


@given(st.lists(st.lists(COUNT, min_size=2, max_size=2), min_size=2, max_size=2))
@settings(max_examples=20, deadline=None)
def test_two_contradictory_frames_come_to_rest_on_the_shares_of_their_counts(counts: list[list[int]]) -> None:
    hard = contradictory(counts)
    stumps, _ = boost(hard.X, hard.labels, 2, rounds=80, weights=hard.weights)
    *_, last = moments(hard, stumps)
    assert resting_error(hard, last) <= 1


@given(st.lists(st.lists(st.integers(1, 40), min_size=3, max_size=3), min_size=2, max_size=2))
@settings(max_examples=12, deadline=None)
def test_rows_that_are_really_there_and_weights_come_to_rest_on_the_same(counts: list[list[int]]) -> None:
    frames = contradictory(counts)
    for hard in (frames, repeated(frames)):
        stumps, _ = boost(hard.X, hard.labels, 3, rounds=150, weights=hard.weights)
        *_, last = moments(frames, stumps)
        assert resting_error(frames, last) <= 1


@given(st.integers(2, 6), st.integers(0, 60), st.integers(0, 2**32), st.sampled_from([0.1, 0.5, 1.0]))
@settings(max_examples=30, deadline=None)
def test_no_round_brings_the_loss_below_the_entropy_left(
    classes: int, percent: int, seed: int, shrinkage: float
) -> None:
    hard = noisy(classes, 50, percent / 100, seed)
    hard = replace(hard, X=hard.X[:, :3], n_switches=3)
    _, losses = boost(hard.X, hard.labels, classes, rounds=40, shrinkage=shrinkage)
    least = float(entropy_left(hard))
    assert min(losses) >= least - loss_rounding(classes, least)


@given(st.lists(st.lists(COUNT, min_size=3, max_size=3), min_size=1, max_size=5))
def test_the_entropy_left_is_scipys(counts: list[list[int]]) -> None:
    table = np.array(counts)
    expected = sum(row.sum() / table.sum() * entropy(row) for row in table)
    assert float(entropy_left(contradictory(counts))) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_a_repeated_set_has_every_row_as_often_as_it_weighs() -> None:
    frames = contradictory([[3, 1], [0, 2]])
    rows = repeated(frames)
    assert rows.weights is None
    assert rows.X.ravel().tolist() == [0, 0, 0, 0, 1, 1]
    assert rows.labels.tolist() == [0, 0, 0, 1, 1, 1]
    assert counted(rows) == counted(frames) == {(0,): [3, 1], (1,): [0, 2]}


def test_resting_error_finds_a_share_that_is_off_by_thirty_roundings() -> None:
    hard = imbalanced(10)
    stumps, _ = boost(hard.X, hard.labels, 2, rounds=80, weights=hard.weights)
    *_, last = moments(hard, stumps)
    off = replace(last, shares=last.shares + 30 * 2.0**-53)
    assert resting_error(hard, last) <= 1 < resting_error(hard, off)
