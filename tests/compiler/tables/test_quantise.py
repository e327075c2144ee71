import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.boosting.stumps import Stumps
from thenar.compiler.tables.balance import balance
from thenar.compiler.tables.collapse import ScoreTables, collapse
from thenar.compiler.tables.compare import compare
from thenar.compiler.tables.quantise import quantise
from thenar.compiler.tables.scales import reach
from thenar.runtime.tables import FINEST_SCALE, tables_to_bytes

MakeStumps = Callable[..., Stumps]
MakeRows = Callable[..., tuple[np.ndarray, np.ndarray]]

widths = st.sampled_from([4, 8, 12, 16])

FLOATS = 8 * 32767 * 2.0**-53  # eight roundings, at most, of numbers within int16


@given(seed=st.integers(0, 10_000), width=widths)
def test_the_scale_is_the_finest_that_fits(make_stumps: MakeStumps, make_rows: MakeRows, seed: int, width: int) -> None:
    tables = collapse(make_stumps(seed), 6)
    integers = quantise(tables, *make_rows(seed), width)
    limit = 2 ** (width - 1) - 1
    assert integers.bound <= limit
    assert reach(balance(tables), float(np.nextafter(integers.scale, np.inf))) > limit


@given(seed=st.integers(0, 10_000), width=widths)
def test_no_score_is_off_by_more_than_the_guarantee(
    make_stumps: MakeStumps, make_rows: MakeRows, seed: int, width: int
) -> None:
    stumps, (bits, codes) = make_stumps(seed), make_rows(seed)
    found = compare(stumps, quantise(collapse(stumps, 6), bits, codes, width), bits, codes)
    assert found.integer_bound == 5.0
    assert found.integer_difference <= found.integer_bound + found.slack
    assert found.holds


@given(seed=st.integers(0, 10_000))
def test_rows_beyond_the_safe_margin_keep_their_class_and_some_others_do_not(
    make_stumps: MakeStumps, make_rows: MakeRows, seed: int
) -> None:
    stumps, (bits, codes) = make_stumps(seed), make_rows(seed, n=200)
    found = compare(stumps, quantise(collapse(stumps, 6), bits, codes, 6), bits, codes)
    assert not np.isin(found.changed, np.flatnonzero(found.covered)).any()
    assert np.array_equal(found.covered, found.margins > found.safe_margin + 2 * found.slack)


def test_coarse_integers_do_change_classes(make_stumps: MakeStumps, make_rows: MakeRows) -> None:
    stumps, (bits, codes) = make_stumps(1), make_rows(1, n=200)
    found = compare(stumps, quantise(collapse(stumps, 6), bits, codes, 4), bits, codes)
    assert len(found.changed) > 0
    assert found.holds


def test_a_broken_table_does_not_hold(make_stumps: MakeStumps, make_rows: MakeRows) -> None:
    stumps, (bits, codes) = make_stumps(1), make_rows(1)
    integers = quantise(collapse(stumps, 6), bits, codes, 12)
    integers.bias[0] += 20
    assert not compare(stumps, integers, bits, codes).holds


def test_tables_of_zeros_stay_zeros(make_stumps: MakeStumps, make_rows: MakeRows) -> None:
    integers = quantise(collapse(make_stumps(rounds=0), 6), *make_rows())
    assert integers.scale == 1.0
    assert integers.bound == 0


def test_a_threshold_that_rounding_makes_meaningless_is_dropped(make_rows: MakeRows) -> None:
    rows = np.array([[0.0, 0.0], [1e-9, -1e-9], [1.0, -1.0]])
    tables = ScoreTables(np.zeros(2), np.zeros((6, 2)), (np.array([3, 9], np.uint16),), (rows,))
    integers = quantise(tables, *make_rows(joints=1))
    assert integers.thresholds[0].tolist() == [9]
    assert len(integers.joint_rows[0]) == 2


def test_a_nearly_empty_ensemble_has_a_finite_scale(make_rows: MakeRows) -> None:
    tables = ScoreTables(np.array([1e-300, -1e-300]), np.zeros((6, 2)), (), ())
    assert quantise(tables, *make_rows(joints=0)).scale <= FINEST_SCALE


@given(seed=st.integers(0, 10_000))
def test_means_stand_for_the_rows_trained_on(make_stumps: MakeStumps, make_rows: MakeRows, seed: int) -> None:
    tables, (bits, codes) = collapse(make_stumps(seed), 6), make_rows(seed)
    integers = quantise(tables, bits, codes)
    expected = integers.switch_rows * bits.mean(axis=0)[:, np.newaxis]
    assert np.abs(integers.switch_means - expected).max() <= 1.0 + FLOATS
    for joint, mean in enumerate(integers.joint_means):
        rows = integers.joint_rows[joint][np.searchsorted(integers.thresholds[joint], codes[:, joint])]
        assert np.abs(mean - rows.mean(axis=0)).max() <= 1.0 + FLOATS


@given(seed=st.integers(0, 100))
def test_the_order_of_the_rows_changes_no_byte(make_stumps: MakeStumps, make_rows: MakeRows, seed: int) -> None:
    tables, (bits, codes) = collapse(make_stumps(seed), 6), make_rows(seed)
    order = np.random.default_rng(seed).permutation(len(bits))
    shuffled = quantise(tables, bits[order], codes[order])
    assert tables_to_bytes(shuffled) == tables_to_bytes(quantise(tables, bits, codes))


@pytest.mark.parametrize("width", [16, 8])
def test_no_frame_at_all_overflows(make_stumps: MakeStumps, make_rows: MakeRows, width: int) -> None:
    integers = quantise(collapse(make_stumps(3, switches=4, joints=2), 4), *make_rows(switches=4, joints=2), width)
    limit, partial = 2 ** (width - 1) - 1, {tuple(integers.bias.tolist())}
    terms = [[row, 0 * row] for row in integers.switch_rows.astype(int)]
    terms += [list(rows.astype(int)) for rows in integers.joint_rows]
    for choices in terms:
        partial = {tuple(np.add(sum_, choice).tolist()) for sum_ in partial for choice in choices}
        assert max(abs(lane) for sum_ in partial for lane in sum_) <= limit


@given(seed=st.integers(0, 1000), shrinkage=st.sampled_from([1e-5, 1e-8, 1e-10, 1e-12, 1e-200]))
def test_scores_next_to_the_ensembles_ties_do_not_break_the_guarantee(
    make_stumps: MakeStumps, make_rows: MakeRows, seed: int, shrinkage: float
) -> None:
    stumps, (bits, codes) = make_stumps(seed, shrinkage=shrinkage), make_rows(seed)
    found = compare(stumps, quantise(collapse(stumps, 6), bits, codes), bits, codes)
    assert not found.covered[found.changed].any()
    assert found.holds


@pytest.mark.parametrize("joints", [2, 4])
def test_rows_of_other_joints_have_no_means(make_stumps: MakeStumps, make_rows: MakeRows, joints: int) -> None:
    with pytest.raises(ValueError, match="zip"):
        quantise(collapse(make_stumps(), 6), *make_rows(joints=joints))


@pytest.mark.parametrize(("rows", "kept"), [("aab", [9]), ("abb", [3]), ("aba", [3, 9]), ("abc", [3, 9]), ("aaa", [])])
def test_a_threshold_is_dropped_only_between_equal_rows(make_rows: MakeRows, rows: str, kept: list[int]) -> None:
    values = {"a": [-1.0, 1.0], "b": [1.0, -1.0], "c": [0.5, 0.25]}
    joint = np.array([values[row] for row in rows])
    tables = ScoreTables(np.zeros(2), np.zeros((6, 2)), (np.array([3, 9], np.uint16),), (joint,))
    assert quantise(tables, *make_rows(joints=1)).thresholds[0].tolist() == kept


@pytest.mark.parametrize("sign", [1, -1])
def test_a_mean_of_equal_rows_is_that_row_though_floating_point_rounds_it_past_the_limit(sign: int) -> None:
    random = np.random.default_rng(4)
    tried = 0
    for n, row in zip(random.integers(3, 60, 500).tolist(), random.uniform(0.5, 4.0, 500).tolist(), strict=True):
        if math.fsum([row] * n) / n <= row:
            continue
        joint = np.array([[0.0, 0.0], [sign * row, -sign * row]])
        tables = ScoreTables(np.zeros(2), np.zeros((0, 2)), (np.array([5], np.uint16),), (joint,))
        integers = quantise(tables, np.zeros((n, 0), bool), np.full((n, 1), 9, np.uint16))
        assert integers.joint_rows[0].tolist() == [[0, 0], [sign * 32767, -sign * 32767]]
        assert integers.joint_means.tolist() == integers.joint_rows[0][1:].tolist()
        tried += 1
    assert tried > 20


def test_reach_before_rounding_grows_with_the_scale(make_stumps: MakeStumps) -> None:
    tables = collapse(make_stumps(), 6)
    assert reach(tables, 4.0, rounded=False) == 4.0 * reach(tables, 1.0, rounded=False)
