"""Numbers that hypothesis draws, against the truth at 60 digits: through the checks of thenar.stability's cases."""

import warnings
from collections import Counter
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.boosting.binning import midpoints
from thenar.compiler.boosting.boost import boost
from thenar.compiler.evaluation.folds import block_folds, leave_one_out, weka_folds
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.placement.exact import Counts
from thenar.compiler.placement.gain import best_position, compare_scores
from thenar.compiler.tables.compare import float_slack
from thenar.compiler.tables.worstcase import Rounding
from thenar.stability.cases import elementary, information, scoretables, stumpfits, targets
from thenar.stability.cases.codes import HARD_DOUBLES
from thenar.stability.cases.quantisation import BothWays, lost
from thenar.stability.cases.statistics import WILSON_BOUND
from thenar.stability.cases.stumpfits import Problem
from thenar.stability.checks.class_rounds import see_round
from thenar.stability.checks.rounds import moments
from thenar.stability.finding import Worst
from thenar.stability.inputs.hard_data import bit_set, node_of, noisy
from thenar.stability.inputs.hard_tables import Quantised, drawn, quantised
from thenar.stability.reference.information import compare_gains
from thenar.stability.reference.intervals import wilson
from thenar.stability.reference.numbers import distance, precisely, ratio

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
classes_of = st.lists(st.integers(1, 6), min_size=2, max_size=3)
finite = st.floats(allow_nan=False, allow_infinity=False) | st.sampled_from(HARD_DOUBLES)


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
    drawn = bit_set(rng)
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


@settings(deadline=None)
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
    assert all(finding.holds for finding in scoretables.whole_steps_of(rng, hard))


@given(st.lists(ROW_WEIGHTS, min_size=12, max_size=12), st.integers(0, 2**32))
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


@st.composite
def splits(draw: st.DrawFn, classes: list[int], values: int) -> Counts:
    """Draw a table (K, values) whose rows sum to `classes`."""
    rows = [draw(st.lists(st.integers(0, values - 1), min_size=m, max_size=m)) for m in classes]
    return np.array([[Counter(row)[value] for value in range(values)] for row in rows])


@settings(deadline=None)
@given(st.data())
def test_two_gains_compare_as_the_reference_says_with_any_number_of_values(data: st.DataObject) -> None:
    classes = data.draw(classes_of)
    one, other = (data.draw(splits(classes, data.draw(st.integers(2, 4)))) for _ in range(2))
    assert compare_scores(one, other) == compare_gains(one.tolist(), other.tolist())


@settings(deadline=None)
@given(st.data())
def test_of_many_columns_the_first_of_the_best_is_asked_for_whatever_their_order(data: st.DataObject) -> None:
    classes = data.draw(classes_of)
    tables = [data.draw(splits(classes, data.draw(st.integers(2, 4)))) for _ in range(data.draw(st.integers(2, 5)))]
    varying = [number for number, table in enumerate(tables) if np.count_nonzero(table.any(axis=0)) > 1]
    numbers = np.array(data.draw(st.permutations(range(len(tables)))))
    found = best_position(node_of(*tables), numbers)
    if not varying:
        assert found is None
        return
    assert found in varying
    others = [(compare_gains(tables[n].tolist(), tables[found].tolist()), numbers[n]) for n in varying]
    assert all(sign < 0 or (sign == 0 and number >= numbers[found]) for sign, number in others)


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


@settings(deadline=None)
@given(st.lists(st.integers(0, 4), min_size=2, max_size=40), st.integers(2, 12), st.integers(0, 100))
@example([0, 0, 0, 0, 1], 4, 1)
@example([0, 1, 2, 3], 4, 1)
def test_classes_smaller_than_the_folds_are_tested_once_a_row_and_spread(
    labels: list[int], n_folds: int, seed: int
) -> None:
    if n_folds > len(labels):
        with pytest.raises(ValueError, match="cannot be cut into"):
            weka_folds(labels, n_folds, seed)
        return
    folds = weka_folds(labels, n_folds, seed)
    assert sorted(row for fold in folds for row in fold.test.tolist()) == list(range(len(labels)))
    for fold in folds:
        assert sorted([*fold.test.tolist(), *fold.train.tolist()]) == list(range(len(labels)))
        assert len(fold.train)
    for label in set(labels):
        tested = [sum(labels[row] == label for row in fold.test) for fold in folds]
        assert max(tested) - min(tested) <= 1
    sizes = [len(fold.test) for fold in folds]
    assert max(sizes) - min(sizes) <= 1


@given(st.lists(st.sampled_from("ABC"), min_size=2, max_size=20), st.lists(st.integers(0, 6), min_size=2, max_size=20))
def test_groups_and_blocks_are_whole_on_one_side(names: list[str], trials: list[int]) -> None:
    if len(set(names)) > 1:
        groups = np.array(names)
        for fold in leave_one_out(groups, "subject"):
            assert not set(groups[fold.train]) & set(groups[fold.test])
            assert len(fold.train) + len(fold.test) == len(names)
    if len(set(trials)) > 2:
        numbers = np.array(trials)
        for fold in block_folds(numbers, 3):
            assert not set(numbers[fold.train]) & set(numbers[fold.test])
            assert len(fold.train)
            assert len(fold.test)


@given(st.lists(finite, min_size=2, max_size=30))
def test_a_threshold_lies_where_it_parts_two_neighbours(values: list[float]) -> None:
    distinct = np.unique(values)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = midpoints(distinct)
    for low, high, threshold in zip(distinct[:-1].tolist(), distinct[1:].tolist(), found.tolist(), strict=True):
        assert low <= threshold < high
        middle = (Fraction(low) + Fraction(high)) / 2
        # No double between the two lies closer to the middle.
        for near in np.nextafter(threshold, [-np.inf, np.inf]).tolist():
            if low <= near < high:
                assert abs(Fraction(near) - middle) >= abs(Fraction(threshold) - middle)


@settings(deadline=None, max_examples=30)
@given(
    seed=st.integers(0, 10_000),
    classes=st.integers(2, 8),
    switches=st.integers(0, 20),
    bins=st.lists(st.integers(1, 12), max_size=4).map(tuple),
    decades=st.sampled_from([0.0, 1.0, 3.0]),
    width=st.integers(4, 16),
)
def test_the_worst_frame_run_through_scorer_and_reference_loses_exactly_what_was_computed(
    seed: int, classes: int, switches: int, bins: tuple[int, ...], decades: float, width: int
) -> None:
    case = quantised("", drawn(seed, classes, switches, bins, decades), width, seed)
    rounding, both = Rounding(case.tables, case.integers), BothWays(case.tables, case.integers)
    frame = rounding.worst_of_all()
    most = ratio(frame.loss)
    with precisely():
        assert lost(*both.run(frame.bits.tolist(), frame.codes.tolist()), frame.leader, frame.competitor) == most
        assert most <= switches + len(bins) + 1 + 2 * float_slack(case.tables, case.integers.scale)
        for bits, codes in _drawn_frames(case, seed):
            assert lost(*both.run(bits, codes), frame.leader, frame.competitor) <= most


def _drawn_frames(case: Quantised, seed: int) -> list[tuple[list[bool], list[int]]]:
    random = np.random.default_rng(seed)
    bits = random.random((30, case.integers.n_switches)) < 0.5
    codes = random.integers(0, 257, (30, case.integers.n_joints))
    return list(zip(bits.tolist(), codes.tolist(), strict=True))
