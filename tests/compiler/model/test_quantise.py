import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.model.collapse import collapse
from thenar.compiler.model.compare import compare
from thenar.runtime.model.integers import FINEST_SCALE
from thenar.runtime.model.proof import Rounding
from thenar.runtime.model.quantise import (
    Extremes,
    balance,
    finest_scale,
    quantise,
)
from thenar.runtime.model.tables import ScoreTables

from .conftest import make_rows, make_stumps


@given(seed=st.integers(0, 10_000), joints=st.integers(0, 3))
def test_balancing_changes_no_score_and_never_coarsens(seed: int, joints: int) -> None:
    tables = collapse(make_stumps(seed, joints=joints), 6)
    balanced = balance(tables)
    bits, codes = make_rows(seed, joints=joints)
    assert np.allclose(balanced.scores(bits, codes), tables.scores(bits, codes), rtol=0, atol=1e-11)
    assert Extremes(balanced).reach(1.0, whole=False) <= Extremes(tables).reach(1.0, whole=False) * (1 + 1e-12)


def test_a_bias_that_the_joints_have_room_for_is_gone() -> None:
    rows = np.array([[-4.0, 1.0], [6.0, 5.0]])
    tables = ScoreTables.of(np.array([3.0, -2.0]), np.zeros((0, 2)), (np.array([9], np.uint16),), (rows,))
    balanced = balance(tables)
    assert balanced.bias.tolist() == [0.0, 0.0]
    assert balanced.joint_rows[0].tolist() == [[-1.0, -1.0], [9.0, 3.0]]


seeds = st.integers(0, 10_000)
shapes = st.tuples(st.integers(0, 14), st.integers(0, 4)).filter(any)


@given(seed=seeds, shape=shapes)
def test_the_next_finer_scale_would_not_do(seed: int, shape: tuple[int, int]) -> None:
    switches, joints = shape
    tables = balance(collapse(make_stumps(seed, switches=switches, joints=joints), switches))
    scale = finest_scale(tables, 32767)
    finer = float(np.nextafter(scale, np.inf))
    assert Extremes(tables).reach(scale) <= 32767
    assert Extremes(tables).reach(finer) > 32767 or finer >= FINEST_SCALE


@given(seed=seeds)
def test_the_guarantee_is_the_same_in_coarser_steps(seed: int) -> None:
    stumps, (bits, codes) = make_stumps(seed), make_rows(seed, n=100)
    tables = collapse(stumps, 6)
    integers = quantise(tables, bits, codes, width=8)
    found = compare(stumps, integers, bits, codes)
    assert (found.integer_bound, found.safe_margin) == (5.0, 10.0)
    assert found.holds
    assert not np.isin(found.changed, np.flatnonzero(found.covered)).any()
    assert Rounding(tables, integers).worst_of_all().loss <= found.safe_margin + 2 * found.slack


def test_tables_of_zeros_and_of_no_joint_stay_so() -> None:
    integers = quantise(collapse(make_stumps(rounds=0), 6), *make_rows())
    assert (integers.scale, integers.bound) == (1.0, 0)
    bias_alone = ScoreTables.of(np.array([3.0, -3.0]), np.zeros((6, 2)), (), ())
    assert quantise(bias_alone, *make_rows(joints=0)).bias.tolist() == [32767, -32767]


widths = st.sampled_from([4, 8, 12, 16])

FLOATS = 8 * 32767 * 2.0**-53  # eight roundings, at most, of numbers within int16


@given(seed=st.integers(0, 10_000), width=widths)
def test_no_score_is_off_by_more_than_the_guarantee(seed: int, width: int) -> None:
    stumps, (bits, codes) = make_stumps(seed), make_rows(seed)
    found = compare(stumps, quantise(collapse(stumps, 6), bits, codes, width), bits, codes)
    assert found.integer_bound == 5.0
    assert found.integer_difference <= found.integer_bound + found.slack
    assert found.holds


@given(seed=st.integers(0, 10_000))
def test_means_stand_for_the_rows_trained_on(seed: int) -> None:
    tables, (bits, codes) = collapse(make_stumps(seed), 6), make_rows(seed)
    integers = quantise(tables, bits, codes)
    expected = integers.switch_rows * bits.mean(axis=0)[:, np.newaxis]
    assert np.abs(integers.switch_means - expected).max() <= 1.0 + FLOATS
    for joint, mean in enumerate(integers.joint_means):
        rows = integers.joint_rows[joint][np.searchsorted(integers.thresholds[joint], codes[:, joint])]
        assert np.abs(mean - rows.mean(axis=0)).max() <= 1.0 + FLOATS


@given(seed=st.integers(0, 1000), shrinkage=st.sampled_from([1e-5, 1e-8, 1e-10, 1e-12, 1e-200]))
def test_scores_next_to_the_ensembles_ties_do_not_break_the_guarantee(seed: int, shrinkage: float) -> None:
    stumps, (bits, codes) = make_stumps(seed, shrinkage=shrinkage), make_rows(seed)
    found = compare(stumps, quantise(collapse(stumps, 6), bits, codes), bits, codes)
    assert not found.covered[found.changed].any()
    assert found.holds


@pytest.mark.parametrize(("rows", "kept"), [("aab", [9]), ("abb", [3]), ("aba", [3, 9]), ("abc", [3, 9]), ("aaa", [])])
def test_a_threshold_is_dropped_only_between_equal_rows(rows: str, kept: list[int]) -> None:
    values = {"a": [-1.0, 1.0], "b": [1.0, -1.0], "c": [0.5, 0.25]}
    joint = np.array([values[row] for row in rows])
    tables = ScoreTables.of(np.zeros(2), np.zeros((6, 2)), (np.array([3, 9], np.uint16),), (joint,))
    assert quantise(tables, *make_rows(joints=1)).thresholds[0].tolist() == kept


@pytest.mark.parametrize("sign", [1, -1])
def test_the_mean_of_equal_rows_is_exactly_that_row(sign: int) -> None:
    random = np.random.default_rng(4)
    tried = 0
    for n, row in zip(random.integers(3, 60, 500).tolist(), random.uniform(0.5, 4.0, 500).tolist(), strict=True):
        if math.fsum([row] * n) / n <= row:
            continue
        joint = np.array([[0.0, 0.0], [sign * row, -sign * row]])
        tables = ScoreTables.of(np.zeros(2), np.zeros((0, 2)), (np.array([5], np.uint16),), (joint,))
        integers = quantise(tables, np.zeros((n, 0), bool), np.full((n, 1), 9, np.uint16))
        assert integers.joint_rows[0].tolist() == [[0, 0], [sign * 32767, -sign * 32767]]
        assert integers.joint_means.tolist() == integers.joint_rows[0][1:].tolist()
        tried += 1
    assert tried > 20
