"""When the loss falls, and that a tolerance ends training when it should, on sets that hypothesis makes."""

from itertools import pairwise, permutations, product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from thenar.compiler.boosting.boost import boost
from thenar.compiler.tables.collapse import collapse
from thenar.compiler.tables.quantise import quantise
from thenar.stability.checks.integer_sums import largest_sum
from thenar.stability.checks.rounds import loss_rounding, moments, rise_rounding
from thenar.stability.inputs.hard_data import HardSet, intervals, separable, words
from thenar.stability.inputs.hard_tables import rows_of
from thenar.stability.reference import boosting as ensembles
from thenar.stability.reference.boosting import mean_loss
from thenar.stability.reference.numbers import distance


@st.composite
def hard_sets(draw: st.DrawFn, classes: st.SearchStrategy[int]) -> HardSet:
    """Any rows: few or many values a column, contradictions, ties, weights up to a million apart."""
    n, k = draw(st.integers(2, 20)), draw(classes)
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    X = rng.integers(0, draw(st.sampled_from([2, 3, 9])), (n, draw(st.integers(1, 4))))
    assume(bool((X[:1] != X).any()))
    weights = 10.0 ** rng.uniform(0, draw(st.sampled_from([0, 2, 6])), n)
    return HardSet("drawn", X, rng.integers(0, k, n).astype(np.intp), k, 0, weights)


def largest_rise(hard: HardSet, rounds: int, shrinkage: float = 1.0) -> float:
    """Return the largest rise of the loss in a round, as a share of what rounding allows."""
    stumps, _ = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds, shrinkage=shrinkage, weights=hard.weights)
    pairs = pairwise(moments(hard, stumps))
    return max((b.loss - a.loss) / rise_rounding(hard.n_classes, a, b) for a, b in pairs)


@given(hard_sets(st.just(2)))
@settings(max_examples=25, deadline=None)
def test_the_loss_of_two_classes_never_rises_whatever_the_rows(hard: HardSet) -> None:
    assert largest_rise(hard, 40) <= 1


@given(hard_sets(st.integers(3, 33)))
@settings(max_examples=25, deadline=None)
def test_the_loss_never_rises_under_a_shrinkage_of_one_by_the_other_classes(hard: HardSet) -> None:
    assert largest_rise(hard, 25, shrinkage=1 / (hard.n_classes - 1)) <= 1


@given(st.integers(2, 33), st.integers(1, 4))
@settings(max_examples=20, deadline=None)
def test_the_loss_never_rises_where_each_class_has_a_switch_of_its_own(classes: int, rows: int) -> None:
    assert largest_rise(separable(classes, rows), 60) <= 1


def newton_bounds(step: float, z_max: float) -> tuple[float, float]:
    """Return (low, high): a Newton step of size `step` under the clamp raises no loss, on any rows, if low <= high.

    Rows of P = p add log(1 - p + p e^s) or lose -log(p + (1 - p) e^-s), and the step is s = C/W. So with a multiplier m
    of C - s W = 0 the loss falls if every row's part does: rise <= m p (1 + s max(1 - p, 1/z_max)) for those of the
    other class, fall >= m (1 - p) (1 - s max(p, 1/z_max)) for members. low and high are what m must lie between.
    """
    p = np.unique(np.concatenate([np.geomspace(1e-12, 0.5, 4000), 1 - np.geomspace(1e-9, 0.5, 4000), [1 / z_max]]))
    rise, fall = np.log1p(p * np.expm1(step)), -np.log(p + (1 - p) * np.exp(-step))
    pull = (1 - p) * (1 - step * np.maximum(p, 1 / z_max))
    low = (rise / (p * (1 + step * np.maximum(1 - p, 1 / z_max)))).max()
    return float(low), float((fall[pull > 0] / pull[pull > 0]).min(initial=np.inf))


@pytest.mark.parametrize("z_max", [1.01, 2.0, 3.0, 4.0])
def test_a_newton_step_under_the_clamp_never_overshoots(z_max: float) -> None:
    for step in np.linspace(0.01, z_max, 200).tolist():
        low, high = newton_bounds(step, z_max)
        assert low <= high


def test_under_a_wider_clamp_it_can() -> None:
    low, high = newton_bounds(4.0, 5.0)
    assert low > high


def test_logitboost_itself_can_raise_the_loss_of_two_classes_of_many_and_60_digits_agree() -> None:
    X = [[0, 1], [1, 1], [2, 0], [2, 2], [3, 3], [4, 3], [4, 4], [5, 1], [5, 3], [5, 6], [6, 2], [7, 3]]
    labels = [1, 1, 1, 0, 1, 0, 0, 1, 1, 0, 1, 0]
    _, losses = boost(np.array(X), np.array(labels), 12, rounds=6)
    start = ensembles.mean_loss([[0.0] * 12] * len(X), labels)
    truth = [start, *(each.loss for each in ensembles.boost_rounds(X, labels, 12, 6))]
    assert max(np.diff(losses)) > 0.05
    assert losses == pytest.approx([float(loss) for loss in truth], rel=1e-12)


@given(hard_sets(st.integers(2, 6)))
@settings(max_examples=25, deadline=None)
def test_the_loss_that_is_told_is_that_of_the_scores(hard: HardSet) -> None:
    stumps, losses = boost(hard.X, hard.labels, hard.n_classes, rounds=10, weights=hard.weights)
    weights = hard.scaled_weights.tolist()
    for moment, told in zip(moments(hard, stumps), losses, strict=True):
        truth = mean_loss(moment.scores.T.tolist(), hard.labels.tolist(), weights)
        assert told == moment.loss
        assert distance(told, truth) <= loss_rounding(hard.n_classes, float(truth))


@given(
    st.sampled_from([separable(3), separable(14), intervals(5), words(6)]),
    st.floats(-16, 1).map(lambda power: 10.0**power),
)
@settings(max_examples=30, deadline=None)
def test_a_tolerance_ends_training_with_the_first_round_that_changes_less(hard: HardSet, tolerance: float) -> None:
    _, without = boost(hard.X, hard.labels, hard.n_classes, rounds=60)
    stumps, losses = boost(hard.X, hard.labels, hard.n_classes, rounds=60, tolerance=tolerance)
    changes = np.abs(np.diff(without))
    assert losses == without[: stumps.n_rounds + 1]
    assert (changes[: stumps.n_rounds - 1] >= tolerance).all()
    assert stumps.stopped_early == (changes[stumps.n_rounds - 1] < tolerance)
    assert stumps.stopped_early or stumps.n_rounds == 60


def test_no_tolerance_and_a_tolerance_of_0_never_end_training_though_nothing_changes_any_more() -> None:
    hard = separable(3)
    for tolerance in (None, 0.0):
        stumps, losses = boost(hard.X, hard.labels, 3, rounds=200, tolerance=tolerance)
        assert stumps.n_rounds == 200
        assert not stumps.stopped_early
        assert losses[-1] == losses[-2]


def test_the_largest_sum_is_that_of_all_frames_in_all_orders_of_adding() -> None:
    hard = intervals(3)
    X = np.column_stack([hard.X % 2, hard.X])
    stumps, _ = boost(X, hard.labels, 3, rounds=20)
    tables = quantise(collapse(stumps, 1), X[:, :1].astype(bool), X[:, 1:].astype(np.uint16), width=8)
    reached = 0
    for bit, row in product((0, 1), tables.joint_rows[0].astype(int)):
        for order in permutations([tables.bias.astype(int), bit * tables.switch_rows[0].astype(int), row]):
            reached = max(reached, int(np.abs(np.cumsum(order, axis=0)).max()))
    assert largest_sum(rows_of(tables)) == reached
