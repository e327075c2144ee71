"""The reference itself, against closed forms, whole numbers, fractions and scipy."""

import math
from fractions import Fraction
from itertools import combinations, pairwise, product
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mpf
from scipy import special, stats

from thenar.stability.reference.boosting import (
    best_splits,
    exp,
    explained,
    log,
    mean_loss,
    softmax,
)
from thenar.stability.reference.information import (
    compare_gains,
    conditional_gain_bits,
    entropy_bits,
    gain_bits,
    sign_of_log_sum,
)
from thenar.stability.reference.intervals import normal_quantile, student, student_quantile, wilson
from thenar.stability.reference.logit import ReferenceColumn, largest_derivative
from thenar.stability.reference.numbers import DIGITS, cos, precisely, sin, turn
from thenar.stability.reference.standing_in import Kind, stand_ins

HAIR = mpf(10) ** (8 - DIGITS)  # a few roundings of 60 digits

COUNTS = st.integers(0, 12)
TABLES = st.lists(st.tuples(COUNTS, COUNTS, COUNTS), min_size=1, max_size=4).filter(lambda t: any(map(any, t)))


@precisely()
def near(got: mpf, truth: mpf) -> bool:
    return bool(abs(got - truth) <= HAIR * max(abs(mpf(truth)), 1))


@given(TABLES)
def test_the_gain_is_the_entropy_that_falls(table: list[list[int]]) -> None:
    n, columns = sum(map(sum, table)), list(zip(*table, strict=True))
    with precisely():
        left = mpmath.fsum(mpf(sum(column)) / n * entropy_bits(column) for column in columns if any(column))
        assert near(gain_bits(table), entropy_bits([sum(row) for row in table]) - left)


@given(TABLES, TABLES)
def test_information_given_something_obeys_the_chain_rule(one: list[list[int]], other: list[list[int]]) -> None:
    other = (other * len(one))[: len(one)]
    if not any(map(any, other)):
        return
    both = [[*a, *b] for a, b in zip(one, other, strict=True)]
    parts = [[sum(a), sum(b)] for a, b in zip(one, other, strict=True)]
    with precisely():
        assert near(gain_bits(both), gain_bits(parts) + conditional_gain_bits([one, other]))


@given(TABLES, TABLES)
def test_gains_compare_as_products_of_whole_numbers_do(one: list[list[int]], other: list[list[int]]) -> None:
    def power(table: list[list[int]], times: int) -> Fraction:
        """Return e to the power of n * gain * times, a rational number."""
        total = Fraction(1)
        for sign, m in [
            (1, sum(map(sum, table))),
            *((1, m) for row in table for m in row),
            *((-1, sum(row)) for row in table),
            *((-1, sum(column)) for column in zip(*table, strict=True)),
        ]:
            total *= Fraction(m**m) ** (sign * times)
        return total

    sizes = sum(map(sum, one)), sum(map(sum, other))
    first, second = power(one, sizes[1]), power(other, sizes[0])
    assert compare_gains(one, other) == (first > second) - (first < second)


def test_one_row_in_a_billion_decides_and_equal_gains_tie() -> None:
    m = 10**9
    nothing, least = [[m, m], [m, m]], [[m + 1, m - 1], [m, m]]
    assert compare_gains(least, nothing) == 1
    assert compare_gains(nothing, [[m, m], [2 * m, 2 * m]]) == 0
    assert compare_gains([[8, 0], [4, 4]], [[7, 1], [2, 6]]) == 0
    assert sign_of_log_sum({4: 1, 2: -2}) == 0


def test_elementary_functions_have_sixty_digits() -> None:
    e = "2.71828182845904523536028747135266249775724709369995957496697"
    assert near(exp(1), _of(e))
    with precisely():
        assert near(log(exp(2)), mpf(2))
        assert near(sin(1000.0) ** 2 + cos(1000.0) ** 2, mpf(1))
        assert near(sin(mpmath.pi / 6), mpf(1) / 2)


@precisely()
def _of(digits: str) -> mpf:
    return mpf(digits)


SCORES = st.lists(st.floats(-1e4, 1e4), min_size=2, max_size=5).map(tuple)


@given(SCORES)
def test_softmax_sums_to_one_and_agrees_with_scipy(row: tuple[float, ...]) -> None:
    with precisely():
        assert near(mpmath.fsum(softmax(row)), mpf(1))
    np.testing.assert_allclose([float(p) for p in softmax(row)], special.softmax(row), rtol=1e-11, atol=5e-324)


SHARES = st.integers(0, 8).map(lambda n: n / 8)
CELLS = st.sampled_from([0.0, 1.0, 2.0, 5.0, math.nan])
PROBLEMS = st.integers(2, 7).flatmap(
    lambda n: st.tuples(
        st.lists(st.lists(CELLS, min_size=n, max_size=n), min_size=1, max_size=3),
        st.lists(SHARES, min_size=n, max_size=n),
        st.lists(st.sampled_from([-3.0, -1.5, -1.0, 1.0, 1.5, 3.0]), min_size=n, max_size=n),
    )
)


def residual(x: list[float], w: list[float], z: list[float], threshold: float) -> Fraction:
    """The weighted sum of squares about the branches' means, which the best stump has least of."""
    total = Fraction(0)
    for branch in (lambda v: v <= threshold, lambda v: v > threshold, math.isnan):
        rows = [(Fraction(a), Fraction(b)) for v, a, b in zip(x, w, z, strict=True) if branch(v)]
        weight = sum(a for a, _ in rows)
        mean = sum(a * b for a, b in rows) / weight if weight else Fraction(0)
        total += sum((a * (b - mean) ** 2 for a, b in rows), Fraction(0))
    return total


@given(PROBLEMS)
def test_the_best_split_leaves_the_least_residual(
    problem: tuple[list[list[float]], list[float], list[float]],
) -> None:
    columns, w, z = problem
    r = [a * b for a, b in zip(w, z, strict=True)]
    every = [
        (residual(columns[c], w, z, low), c, low, high)
        for c in range(len(columns))
        for low, high in _neighbours(columns[c])
    ]
    assert [split[1:] for split in best_splits(columns, w, r)] == [split[1:] for split in sorted(every)]
    whole = sum((Fraction(a) * Fraction(b) ** 2 for a, b in zip(w, z, strict=True)), Fraction(0))
    for part, column, low, _ in best_splits(columns, w, r):
        truth = whole - residual(columns[column], w, z, low)
        with precisely():
            assert near(part, mpf(truth.numerator) / truth.denominator)
        assert near(part, explained(columns[column], w, r, low))


def _neighbours(x: list[float]) -> list[tuple[float, float]]:
    values = sorted({v for v in x if not math.isnan(v)})
    return list(pairwise(values))


@pytest.mark.parametrize("counts", [(30, 10), (5, 12, 40), (1, 1, 1, 97)])
def test_uninformative_inputs_are_substituted_by_class_frequencies(counts: tuple[int, ...]) -> None:
    labels = [label for label, count in enumerate(counts) for _ in range(count)]
    rows = [[0] * len(counts)] * len(labels)
    ends = ((-9000,) * len(counts), (9000,) * len(counts))
    for start in ([0.0] * len(counts), [500.0, *[-300.0] * (len(counts) - 1)]):
        (found,) = stand_ins(Kind([rows], labels, [ends], 1000.0), [start])
        for one, other in combinations(range(len(counts)), 2):
            assert found[one] - found[other] == pytest.approx(1000 * math.log(counts[one] / counts[other]), abs=2)


def test_the_sum_of_a_kind_compensates_redundant_inputs() -> None:
    # Each of two equal inputs is said by the other already, so nothing stands in for one alone; both are lost at once.
    labels = [0] * 30 + [1] * 10
    known, nothing = [[549, -549]] * 40, [[0, 0]] * 40
    ends = [((-9000, -9000), (9000, 9000))] * 2
    none = [[0.0, 0.0]] * 2
    alone, _ = stand_ins(Kind([known, known], labels, ends, 1000.0), none)
    one, other = stand_ins(Kind([known, known, nothing], labels, ends, 1000.0), none)
    assert max(map(abs, alone)) <= 1
    assert one == other
    assert 100 < one[0] < 549


@given(st.integers(1, 10**6).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilsons_interval_is_that_of_scipy(pair: tuple[int, int]) -> None:
    interval = stats.binomtest(*pair).proportion_ci(method="wilson")
    low, high = wilson(*pair)
    np.testing.assert_allclose([float(low), float(high)], [interval.low, interval.high], rtol=1e-9, atol=1e-15)
    assert 0 <= low <= mpf(pair[0]) / pair[1] <= high <= 1


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(0, 1), min_size=2, max_size=9))
def test_students_interval_is_that_of_scipy(rates: list[float]) -> None:
    reach = stats.t.ppf(0.975, len(rates) - 1) * stats.sem(rates) if len(set(rates)) > 1 else 0.0
    np.testing.assert_allclose(
        [float(bound) for bound in student(rates)], [np.mean(rates) - reach, np.mean(rates) + reach], atol=1e-12
    )


def test_quantiles_in_closed_form() -> None:
    with precisely():
        tail = mpf(1) / 40
        # One degree of freedom is Cauchy's distribution, two have (2p - 1) / sqrt(2 p (1 - p)).
        assert near(student_quantile(1, 1 - tail), mpmath.tan(mpmath.pi * (mpf(1) / 2 - tail)))
        assert near(student_quantile(2, 1 - tail), (1 - 2 * tail) / mpmath.sqrt(2 * tail * (1 - tail)))
        assert near(mpmath.ncdf(normal_quantile(mpf(1) / 1000)), mpf(1) / 1000)
    assert normal_quantile(0.5) == 0


@given(st.lists(st.floats(0.1, 9), min_size=3, max_size=3), st.floats(-7, 7))
def test_a_turn_keeps_its_axis_and_all_lengths(axis: list[float], angle: float) -> None:
    rows = turn(axis, angle)
    with precisely():
        for i, j in product(range(3), repeat=2):
            assert near(mpmath.fsum(rows[i][m] * rows[j][m] for m in range(3)), mpf(int(i == j)))
        for i in range(3):
            assert near(mpmath.fsum(rows[i][m] * axis[m] for m in range(3)), mpf(axis[i]))
        assert near(rows[0][0] + rows[1][1] + rows[2][2], 1 + 2 * mpmath.cos(angle))
    quarter = turn((0, 0, 2), float(mpmath.pi / 2))
    assert [round(float(x)) for row in quarter for x in row] == [0, -1, 0, 1, 0, 0, 0, 0, 1]


@precisely()
def test_the_derivative_is_that_of_the_loss() -> None:
    rng = np.random.default_rng(1)
    rows, labels = rng.normal(size=(4, 3)), [0, 1, 2, 1, 0, 2]
    added, pulls, smoothness = [0, 1, -1, 2, 3, 3], [0.5, 1.0, 2.0, 0.1], [(0, 1, 3.0), (0, 3, 0.5), (2, 3, 1.5)]

    def loss(entries: Any) -> Any:
        scores = [[mpf(0)] * 3 if row < 0 else list(entries[row]) for row in added]
        total = mean_loss(scores, labels) * 6
        total += sum(pull * sum(each**2 for each in row) for pull, row in zip(pulls, entries, strict=True)) / 2
        pairs = [(s, entries[one], entries[other]) for one, other, s in smoothness]
        return total + sum(s * sum((b - a) ** 2 for a, b in zip(one, two, strict=True)) for s, one, two in pairs) / 2

    def slope(row: int, k: int) -> Any:
        def moved(by: Any) -> Any:
            entries = [[mpf(each) for each in own] for own in rows.tolist()]
            entries[row][k] += by
            return loss(entries)

        step = mpf(10) ** -20
        return (moved(step) - moved(-step)) / (2 * step)

    true = max(abs(slope(row, k)) for row in range(4) for k in range(3))
    found = largest_derivative([ReferenceColumn(added, rows.tolist(), pulls, smoothness)], labels)
    assert abs(found - true) < mpf(10) ** -30
