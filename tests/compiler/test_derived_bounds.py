"""Bounds that say how far floating point may be off are what their docstrings count: no wider, and no narrower.

A narrower one would let rounding decide, which hardly any data shows; a wider one only costs time. So both are held
here, beside the counts written out in exact arithmetic.
"""

import numpy as np
import pytest

from thenar.compiler.boosting.stumps import Stumps
from thenar.compiler.tables.collapse import Line, ScoreTables, collapse
from thenar.compiler.tables.compare import COLLAPSE_TOLERANCE, compare, float_slack
from thenar.compiler.tables.quantise import quantise, rounding_error

UNIT = 2.0**-53


def test_rounding_error_is_half_a_step_for_bias_and_inputs() -> None:
    def of(switches: int, *lines: Line) -> ScoreTables:
        no, row = np.array([], np.uint16), np.zeros((1, 2))
        return ScoreTables(row[0], np.zeros((switches, 2)), (no,) * len(lines), (row,) * len(lines), lines)

    assert [rounding_error(of(n), 9.0) for n in (0, 1, 48)] == [0.5, 1.0, 24.5]
    assert rounding_error(of(3), 9.0, 256) == 0.5 + 3 * 128
    # Half a step for its row, and for each of at most 50 distances; codes that become one are 1.5 from their middle.
    row = np.array([0.0, -2.0])
    assert rounding_error(of(0, Line(0, 3, 103, row)), 9.0) == 0.5 + 0.5 + 25
    assert rounding_error(of(0, Line(0, 0, 1000, row)), 0.5) == 0.5 + 0.5 + 62.5 + 1.5 * 2.0 * 0.5


def test_the_float_slack_counts_a_unit_per_input_and_eight() -> None:
    rows = (np.array([[1.0, -3.0], [2.0, 0.5]]), np.array([[0.25, 0.0]]))
    none = np.array([], np.uint16)
    tables = ScoreTables(np.array([-5.0, 4.0]), np.array([[-7.0, 6.0]]), (np.array([3], np.uint16), none), rows)
    assert float_slack(tables, 64.0) == (3 + 2 + 8) * UNIT * (5 + 7 + 3 + 0.25) * 64


@pytest.mark.parametrize("shrinkage", [1.0, 0.25])
def test_the_collapse_bound_is_twice_the_largest_answers_tolerance(shrinkage: float) -> None:
    # What a missing input answers is in no table.
    values = np.array([[[0.5, -2.0, 99.0], [0.25, 0.75, 99.0]], [[0.125, 0.0, 99.0], [-0.25, 0.5, 99.0]]])
    stumps = Stumps(2, np.array([[0, 1], [1, 0]], np.int32), np.array([[0.5, 7.0], [9.0, 0.5]]), values, shrinkage)
    bits, codes = np.array([[True], [False]]), np.array([[3], [8]], np.uint16)
    found = compare(stumps, quantise(collapse(stumps, 1), bits, codes), bits, codes)
    assert found.collapse_bound == COLLAPSE_TOLERANCE * 2 * shrinkage * (2.0 + 0.5)
