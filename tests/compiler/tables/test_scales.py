from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.boosting.stumps import Stumps, winners
from thenar.compiler.tables.balance import balance
from thenar.compiler.tables.collapse import ScoreTables, collapse
from thenar.compiler.tables.compare import compare
from thenar.compiler.tables.quantise import quantise
from thenar.compiler.tables.scales import GROUP_SIZE, TRIED, finest_scale, kindest_scale, reach, span
from thenar.compiler.tables.worstcase import Rounding
from thenar.runtime.tables import FINEST_SCALE, IntegerTables, tables_to_bytes

MakeStumps = Callable[..., Stumps]
MakeRows = Callable[..., tuple[np.ndarray, np.ndarray]]

seeds = st.integers(0, 10_000)
shapes = st.tuples(st.integers(0, 14), st.integers(0, 4)).filter(any)


def spans_by_counting(integers: IntegerTables, group_size: int) -> list[int]:
    """How far apart what a look-up adds can be, for groups of up to `group_size` switches that begin anywhere."""
    spans = [int(np.ptp(rows.astype(int), axis=0).max()) for rows in integers.joint_rows]
    rows = integers.switch_rows.astype(int)
    for first in range(len(rows)):
        group = rows[first : first + group_size]
        subsets = [list(some) for n in range(len(group) + 1) for some in combinations(range(len(group)), n)]
        spans.append(int(np.ptp([group[some].sum(axis=0) for some in subsets], axis=0).max()))
    return spans


@given(seed=seeds, shape=shapes)
def test_every_look_up_of_up_to_five_switches_or_of_a_joint_fits_a_byte(
    make_stumps: MakeStumps, make_rows: MakeRows, seed: int, shape: tuple[int, int]
) -> None:
    switches, joints = shape
    tables = collapse(make_stumps(seed, switches=switches, joints=joints), switches)
    integers = quantise(tables, *make_rows(seed, switches=switches, joints=joints), entry_bits=8)
    for group_size in (GROUP_SIZE, 2):
        assert max(spans_by_counting(integers, group_size)) <= 255
    assert integers.bound <= 32767


@given(seed=seeds, shape=shapes, entry_bits=st.sampled_from([4, 8, 16]))
def test_the_next_finer_scale_would_not_do(
    make_stumps: MakeStumps, seed: int, shape: tuple[int, int], entry_bits: int
) -> None:
    switches, joints = shape
    tables = balance(collapse(make_stumps(seed, switches=switches, joints=joints), switches))
    scale = finest_scale(tables, 32767, 2**entry_bits - 1)
    finer = float(np.nextafter(scale, np.inf))
    assert reach(tables, scale) <= 32767
    assert span(tables, scale) <= 2**entry_bits - 1
    assert reach(tables, finer) > 32767 or span(tables, finer) > 2**entry_bits - 1 or finer >= FINEST_SCALE


@given(seed=seeds, shape=shapes)
def test_coarse_steps_are_those_that_change_the_fewest_rows(
    make_stumps: MakeStumps, make_rows: MakeRows, seed: int, shape: tuple[int, int]
) -> None:
    switches, joints = shape
    stumps = make_stumps(seed, switches=switches, joints=joints)
    rows = make_rows(seed, n=60, switches=switches, joints=joints)
    unbalanced = collapse(stumps, switches)
    tables = balance(unbalanced)
    finest = finest_scale(tables, 32767, 31)

    def changed(scale: float) -> int:
        steps = [np.rint(tables.switch_rows * scale), *(np.rint(joint * scale) for joint in tables.joint_rows)]
        bins = [np.searchsorted(*pair) for pair in zip(tables.thresholds, rows[1].T, strict=True)]
        scores = np.rint(tables.bias * scale) + rows[0].astype(float) @ steps[0]
        scores += sum((joint[bin_] for joint, bin_ in zip(steps[1:], bins, strict=True)), np.zeros_like(scores))
        return int(np.count_nonzero(scores.argmax(axis=1) != winners(stumps.scores(np.hstack(rows)))))

    counts = [changed(finest * (1 - i / 160)) for i in range(TRIED)]
    assert kindest_scale(tables, finest, *rows) == finest * (1 - counts.index(min(counts)) / 160)
    assert quantise(unbalanced, *rows, entry_bits=5).scale == kindest_scale(tables, finest, *rows)


@given(seed=seeds)
def test_the_guarantee_is_the_same_in_coarser_steps(make_stumps: MakeStumps, make_rows: MakeRows, seed: int) -> None:
    stumps, (bits, codes) = make_stumps(seed), make_rows(seed, n=100)
    tables = collapse(stumps, 6)
    integers = quantise(tables, bits, codes, entry_bits=8)
    found = compare(stumps, integers, bits, codes)
    assert (found.integer_bound, found.safe_margin) == (5.0, 10.0)
    assert found.holds
    assert not np.isin(found.changed, np.flatnonzero(found.covered)).any()
    assert Rounding(tables, integers).worst_of_all().loss <= found.safe_margin + 2 * found.slack


@given(seed=seeds, shape=shapes, width=st.sampled_from([4, 16]))
def test_entries_of_16_bits_limit_nothing(
    make_stumps: MakeStumps, make_rows: MakeRows, seed: int, shape: tuple[int, int], width: int
) -> None:
    switches, joints = shape
    tables = collapse(make_stumps(seed, switches=switches, joints=joints), switches)
    rows = make_rows(seed, switches=switches, joints=joints)
    assert tables_to_bytes(quantise(tables, *rows, width)) == tables_to_bytes(quantise(tables, *rows, width, 32))


@given(seed=seeds, shape=shapes, scale=st.floats(0.01, 1e4), factor=st.floats(1.0, 3.0))
def test_the_span_never_falls_as_the_scale_grows(
    make_stumps: MakeStumps, seed: int, shape: tuple[int, int], scale: float, factor: float
) -> None:
    switches, joints = shape
    tables = balance(collapse(make_stumps(seed, switches=switches, joints=joints), switches))
    assert span(tables, scale) <= span(tables, scale * factor)


@pytest.mark.parametrize(("apart", "together"), [(1, 2), (4, 2), (5, 1), (50, 1)])
def test_switches_count_together_only_within_five(apart: int, together: int) -> None:
    rows = np.zeros((60, 2))
    rows[[5, 5 + apart]] = [5.0, -5.0]
    assert span(ScoreTables(np.zeros(2), rows, (), ()), 3.0) == 15 * together


def test_a_joint_spans_from_its_least_row_to_its_greatest_and_zero() -> None:
    rows = np.array([[-2.0, 1.0], [1.0, 2.0], [0.0, 6.5]])
    tables = ScoreTables(np.array([9.0, -9.0]), np.zeros((0, 2)), (np.array([3, 9], np.uint16),), (rows,))
    assert span(tables, 1.0) == 6
    assert span(tables, 2.0) == 13


def test_tables_of_zeros_and_of_no_joint_stay_so(make_stumps: MakeStumps, make_rows: MakeRows) -> None:
    integers = quantise(collapse(make_stumps(rounds=0), 6), *make_rows(), entry_bits=8)
    assert (integers.scale, integers.bound) == (1.0, 0)
    bias_alone = ScoreTables(np.array([3.0, -3.0]), np.zeros((6, 2)), (), ())
    assert quantise(bias_alone, *make_rows(joints=0), entry_bits=8).bias.tolist() == [32767, -32767]
    assert span(ScoreTables(np.ones(2), np.zeros((0, 2)), (), ()), 1.0) == 0
