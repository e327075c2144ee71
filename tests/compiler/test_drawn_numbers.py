"""Numbers that hypothesis draws, against the truth at 60 digits: through the checks of thenar.stability's cases."""

from dataclasses import replace

import numpy as np
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.trainers.logitboost import boost
from thenar.stability.cases import elementary, information, scoretables, stumpfits, targets
from thenar.stability.cases.statistics import WILSON_BOUND
from thenar.stability.cases.stumpfits import Problem
from thenar.stability.checks.rounds import moments, see_round
from thenar.stability.finding import Finding
from thenar.stability.inputs.hard_data import noisy
from thenar.stability.reference.intervals import wilson
from thenar.stability.reference.numbers import distance

FAR = st.floats(-1e4, 1e4) | st.sampled_from([0.0, 1e4, -1e4, 5e-324, 1.0 + 2.0**-52, 36.7, 745.0])
SCORES = arrays(np.float64, st.tuples(st.integers(2, 6), st.integers(1, 3)), elements=FAR)
COUNTS = st.integers(0, 30) | st.integers(0, 10**9) | st.sampled_from([10**9 - 1, 10**9])
TABLES = arrays(np.int64, st.tuples(st.integers(1, 6), st.integers(2, 4)), elements=COUNTS).filter(np.any)
PAIRS = st.tuples(
    arrays(np.int64, (3, 2), elements=st.integers(1, 10**9)), arrays(np.int64, (3, 1), elements=st.integers(-1, 1))
)
P = st.floats(0.0, 1.0) | st.sampled_from([0.0, 5e-324, 2.0**-53, 1 - 2.0**-53, 1.0, 1 / 3, 1 - 1 / 3])
SIZES = st.floats(-1e300, 1e300) | st.floats(-1e-300, 1e-300) | st.floats(-1.0, 1.0) | st.just(0.0)
CELLS = st.sampled_from([0.0, 1.0, 1.0 + 2.0**-52, 5.0, -3.0, np.nan])
WEIGHTS = st.floats(0.0, 1.0) | st.floats(1e-300, 1e-290) | st.sampled_from([0.0, 5e-324, 2.0**-52, 2.0**-38, 1.0])
RATIOS = st.floats(1.0, 3.0) | st.floats(-3.0, -1.0) | st.sampled_from([-3.0, -1.0, 1.0, 3.0])
SEEDS = st.integers(0, 2**32)
ROW_WEIGHTS = st.one_of(
    st.floats(1.0, 1e7), st.floats(5e-324, 1e308), st.sampled_from([5e-324, 2.0**-1022, 1e-300, 1.0, 1e300, 1.7e308])
)


@given(SCORES)
def test_shares_are_within_what_rounding_allows(scores: np.ndarray) -> None:
    assert elementary.shares_of([scores]).holds


@given(SCORES, st.data())
def test_losses_are_within_what_rounding_allows_however_they_are_weighted(
    scores: np.ndarray, data: st.DataObject
) -> None:
    n = scores.shape[1]
    labels = data.draw(arrays(np.intp, n, elements=st.integers(0, len(scores) - 1)))
    weights = data.draw(st.none() | arrays(np.float64, n, elements=st.floats(2.0**-900, 2.0**900)))
    assert elementary.losses_of([(scores, labels, weights)]).holds


@given(
    st.floats(690.0, 770.0),
    st.lists(st.tuples(st.floats(0.0, 800.0), st.booleans(), st.integers(-1080, 0)), min_size=1, max_size=5),
    st.integers(-1000, 1000),
)
@example(740.0, [(760.0, False, -1073)], 200)  # just heavy enough for a double
@example(740.0, [(760.0, False, -1074)], 200)
@example(700.0, [(700.0, True, 0)], -900)
def test_losses_next_to_the_smallest_double_are_within_what_underflow_allows(
    sure: float, light: list[tuple[float, bool, int]], heaviest: int
) -> None:
    """One heavy row that is next to certain, and rows so light that weight, product or mean underflows."""
    gaps = [sure, *(gap if right else -gap for gap, right, _ in light)]
    weights = np.ldexp(1.0, [heaviest, *(max(heaviest + power, -1074) for _, _, power in light)])
    scores = np.array([gaps, np.zeros(len(gaps))])
    assert elementary.losses_of([(scores, np.zeros(len(gaps), np.intp), weights)]).holds


@given(arrays(np.float64, st.tuples(st.integers(2, 33), st.just(1)), elements=st.floats(-1e300, 1e300)))
def test_sums_over_classes_are_within_a_rounding_an_addition(column: np.ndarray) -> None:
    assert elementary.sums_of([column]).holds


@given(arrays(np.float64, st.integers(1, 300), elements=st.floats(1e-3, 1e3)))
def test_sums_over_rounds_round_once(terms: np.ndarray) -> None:
    assert elementary.long_sums_of([("drawn", terms)]).holds


@given(TABLES)
def test_gain_and_entropy_are_within_what_rounding_allows(table: np.ndarray) -> None:
    assert information.gains_of([table]).holds
    assert information.entropies_of([table]).holds


@given(PAIRS)
def test_one_count_in_a_billion_decides_as_whole_numbers_do(pair: tuple[np.ndarray, np.ndarray]) -> None:
    one, moved = pair
    # Columns change places and a count or none moves: equal gains, or next to equal ones.
    other = np.maximum(one[:, ::-1] + np.hstack([moved, -moved]), 0)
    other[:, 0] += one.sum(axis=1) - other.sum(axis=1)
    assert information.comparisons_of([(one, other)]).holds
    assume(other.sum(axis=0).all())  # an input that does not vary is none to choose
    assert information.choices_of([(one, other)]).holds


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32))
def test_what_a_bit_tells_given_another_is_within_what_rounding_allows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drawn = information.bit_set(rng)
    assert information.given_of([drawn]).holds
    assert information.given_comparisons_of([drawn], rng).holds


@given(st.floats(1.0, 100.0, exclude_min=True), arrays(np.float64, 3, elements=P))
def test_weights_and_responses_given_p_are_within_their_roundings(z_max: float, p: np.ndarray) -> None:
    assert all(finding.holds for finding in targets.given_probabilities([(z_max, p)]))


@given(arrays(np.float64, st.tuples(st.integers(2, 5), st.just(2)), elements=st.floats(-1e3, 1e3)))
def test_weights_and_responses_given_scores_are_within_what_rounding_allows(scores: np.ndarray) -> None:
    assert targets.given_scores([scores]).holds


@given(arrays(np.float64, st.tuples(st.integers(1, 3), st.integers(1, 40)), elements=SIZES))
def test_two_grids_hold_numbers_of_all_sizes(values: np.ndarray) -> None:
    assert all(finding.holds for finding in targets.grids_of([values]))


@st.composite
def problems(draw: st.DrawFn) -> Problem:
    n = draw(st.integers(2, 12))
    X = draw(arrays(np.float64, (n, draw(st.integers(1, 4))), elements=CELLS))
    X[:2, 0] = 0.0, 1.0
    weights, ratios = draw(arrays(np.float64, n, elements=WEIGHTS)), draw(arrays(np.float64, n, elements=RATIOS))
    return Problem("drawn", X, weights, weights * np.where(weights < 1e-300, np.rint(ratios), ratios))


@given(problems())
def test_no_stump_explains_more_and_branches_answer_with_their_means(problem: Problem) -> None:
    fits = [(problem, stumpfits.fit(problem))]
    assert stumpfits.choices_of(fits).holds
    # Not every problem has a branch that is, or is not, next to empty.
    assert all(finding.error <= finding.bound for finding in stumpfits.outputs_of(fits))


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.integers(1, 15))
def test_scores_tables_and_balanced_tables_are_within_what_rounding_allows(seed: int, rounds: int) -> None:
    rng = np.random.default_rng(seed)
    hard = list(scoretables.ensembles(rng, 1, rounds))
    frames = scoretables.frames(rng, 3)
    findings = [*scoretables.scores_of(hard, *frames), *scoretables.tables_of(hard)]
    findings += [scoretables.table_scores_of(hard, *frames), scoretables.balanced_of(hard)]
    assert not [finding for finding in findings if not finding.holds]


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_whole_steps_are_within_half_a_step(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hard = list(scoretables.ensembles(rng, 1, 20))
    assert scoretables.whole_steps_of(rng, hard).holds


@given(st.lists(ROW_WEIGHTS, min_size=12, max_size=12), st.integers(0, 2**32))
@settings(max_examples=20, deadline=None)
def test_every_round_is_that_of_60_digits_whatever_the_rows_weigh(weights: list[float], seed: int) -> None:
    hard = replace(noisy(3, 12, 0.3, seed), weights=np.array(weights))
    chosen, answers = Finding.of("stumps", "", 1.0, ""), Finding.of("answers", "", 1.0, "")
    stumps, losses = boost(hard.X, hard.labels, 3, rounds=6, weights=hard.weights)
    assert np.isfinite(losses).all()
    for number, moment in enumerate(moments(hard, stumps)):
        assert np.isfinite(moment.scores).all()
        if number < stumps.n_rounds:
            see_round(hard, stumps, number, moment.scores, 3.0, chosen, answers)
    assert chosen.holds
    assert answers.holds


@given(st.integers(1, 10**15), st.floats(0, 1))
@example(1, 0.0)
@example(1, 1.0)
@example(10**15, 1.0)
def test_an_interval_is_wilsons_to_the_last_places(total: int, share: float) -> None:
    correct = min(int(share * total), total)
    rate = Rate.counted((correct,), total, of="pooled")
    low, high = wilson(correct, total)
    assert max(distance(rate.low, low), distance(rate.high, high)) <= WILSON_BOUND
    assert 0 <= rate.low <= rate.mean <= rate.high <= 1
    assert rate.low < rate.high
