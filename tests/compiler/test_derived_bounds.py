"""Bounds that say how far floating point may be off are what their docstrings count: no wider, and no narrower.

A narrower one would let rounding decide, which hardly any data shows; a wider one only costs time. So both are held
here, beside the counts written out in exact arithmetic.
"""

from fractions import Fraction
from math import log

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.model.collapse import collapse
from thenar.compiler.model.compare import COLLAPSE_TOLERANCE, compare, float_slack
from thenar.compiler.placement.gain import Cooccurrence, NodeCounts, _log_sum, _score_bound, error_bound
from thenar.compiler.trainers.stumps import Stumps, Targets, _tie_bound
from thenar.runtime.model.quantise import quantise, rounding_error
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.line import Line

UNIT = 2.0**-53


@given(st.integers(1, 60), st.integers(1, 6), st.integers(1, 4))
def test_information_of_pairs_counts_four_sums_of_six_terms_a_class(n: int, classes: int, d: int) -> None:
    counts = Cooccurrence(np.zeros((n, d), bool), np.arange(n) % classes, classes)
    rows = max(n, 2)
    assert counts.error_bound == pytest.approx(4 * rows * log(rows) * (6 * (classes + 1) + 16) * UNIT, rel=1e-12, abs=0)


@given(st.integers(1, 60), st.integers(1, 40), st.integers(1, 4))
def test_a_sum_of_counts_times_their_logarithms_counts_its_terms_and_sixteen(n: int, terms: int, times: int) -> None:
    rows = max(n, 2)
    assert error_bound(n, terms, times) == pytest.approx(times * rows * log(rows) * (terms + 16) * UNIT, rel=1e-12)


@given(st.integers(1, 50), st.integers(1, 5), st.lists(st.integers(1, 4), min_size=1, max_size=4))
def test_a_score_of_gain_counts_a_term_a_class_and_value(n: int, classes: int, cells: list[int]) -> None:
    totals = np.bincount(np.arange(n) % classes, minlength=classes)
    starts = np.append(0, np.cumsum(cells))[:-1]
    node = NodeCounts(totals, np.zeros((classes, sum(cells)), np.int64), starts)
    # An input of all cells but one for each other input; and its first value, which has no cell.
    values = sum(cells) - (len(cells) - 1) + 1
    terms, rows = (classes + 1) * values, max(n, 2)
    assert _score_bound(node) == pytest.approx(2 * rows * log(rows) * (terms + 16) * UNIT, rel=1e-12, abs=0)


@given(st.integers(1, 40), st.floats(1.5, 10.0), st.floats(1e-3, 1.0))
def test_explained_parts_tie_within_half_a_unit_a_row_on_both_sums(n: int, z_max: float, weight: float) -> None:
    weights = np.full((2, n), weight) * [[1.0], [1e-3]]
    targets = Targets(weights, weights * z_max)
    for k, bound in enumerate(_tie_bound(targets, z_max).tolist()):
        # A unit of responses, in units of weights.
        unit = Fraction(2) ** int(targets.responses.exponents[k] - targets.weights.exponents[k])
        assert bound == pytest.approx(
            float(n * (2 * z_max * unit + (Fraction(z_max) * unit) ** 2) + 64), rel=1e-12, abs=0
        )


@given(st.dictionaries(st.integers(2, 10**6), st.integers(1, 10**6), min_size=1, max_size=6), st.integers(20, 60))
def test_a_sum_of_logarithms_counts_two_errors_a_term_and_four(terms: dict[int, int], digits: int) -> None:
    _, bound = _log_sum(terms, digits)
    size = sum(times * log(m) for m, times in terms.items())
    assert float(bound.scaleb(digits)) == pytest.approx(10 * 2 * (len(terms) + 2) * size, rel=1e-9, abs=0)


def test_rounding_error_is_half_a_step_for_bias_and_inputs() -> None:
    def of(switches: int, *lines: Line) -> ScoreTables:
        no, row = np.array([], np.uint16), np.zeros((1, 2))
        return ScoreTables.of(row[0], np.zeros((switches, 2)), (no,) * len(lines), (row,) * len(lines), lines)

    assert [rounding_error(of(n), 9.0) for n in (0, 1, 48)] == [0.5, 1.0, 24.5]
    assert rounding_error(of(3), 9.0, 256) == 0.5 + 3 * 128
    # Half a step for its row, and for each of at most 50 distances; codes that become one are 1.5 from their middle.
    row = np.array([0.0, -2.0])
    assert rounding_error(of(0, Line(0, 3, 103, row)), 9.0) == 0.5 + 0.5 + 25
    assert rounding_error(of(0, Line(0, 0, 1000, row)), 0.5) == 0.5 + 0.5 + 62.5 + 1.5 * 2.0 * 0.5


def test_the_float_slack_counts_a_unit_per_input_and_eight() -> None:
    rows = (np.array([[1.0, -3.0], [2.0, 0.5]]), np.array([[0.25, 0.0]]))
    none = np.array([], np.uint16)
    tables = ScoreTables.of(np.array([-5.0, 4.0]), np.array([[-7.0, 6.0]]), (np.array([3], np.uint16), none), rows)
    assert float_slack(tables, 64.0) == (3 + 2 + 8) * UNIT * (5 + 7 + 3 + 0.25) * 64


@pytest.mark.parametrize("shrinkage", [1.0, 0.25])
def test_the_collapse_bound_is_twice_the_largest_answers_tolerance(shrinkage: float) -> None:
    # What a missing input answers is in no table.
    values = np.array([[[0.5, -2.0, 99.0], [0.25, 0.75, 99.0]], [[0.125, 0.0, 99.0], [-0.25, 0.5, 99.0]]])
    stumps = Stumps(2, np.array([[0, 1], [1, 0]], np.int32), np.array([[0.5, 7.0], [9.0, 0.5]]), values, shrinkage)
    bits, codes = np.array([[True], [False]]), np.array([[3], [8]], np.uint16)
    found = compare(stumps, quantise(collapse(stumps, 1), bits, codes), bits, codes)
    assert found.collapse_bound == COLLAPSE_TOLERANCE * 2 * shrinkage * (2.0 + 0.5)
