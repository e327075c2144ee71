from collections import Counter
from itertools import islice

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from thenar.compiler.placement.exact import Counts
from thenar.compiler.placement.gain import best_position, compare_scores, gain_bits
from thenar.compiler.placement.id3 import grow_id3
from thenar.compiler.placement.methods.filters import cmim, most_informative
from thenar.stability.cases.columns import hard_columns, large_tables, small_tables, table_of
from thenar.stability.inputs.hard_data import node_of
from thenar.stability.inputs.small_sets import parity
from thenar.stability.reference.information import compare_gains

seeds = st.integers(0, 10_000)
# Three classes at up to four values: two tables with the same classes are columns of one node.
classes_of = st.lists(st.integers(1, 6), min_size=2, max_size=3)


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


def test_among_small_tables_are_gains_that_are_equal_and_float_otherwise() -> None:
    """Were there none, the exact comparison would not be put to the test."""
    apart = 0
    for tables in small_tables(8).values():
        for number, one in enumerate(tables):
            equal = [other for other in tables[number + 1 :] if compare_gains(one.tolist(), other.tolist()) == 0]
            apart += sum(naive_gain(one) != naive_gain(other) for other in equal)
    assert apart > 20


def naive_gain(table: Counts) -> float:
    """Return the gain as anyone would write it down, in doubles."""
    p = table / table.sum()
    sides = p.sum(axis=1, keepdims=True) * p.sum(axis=0, keepdims=True)
    return float(sum(p[cell] * np.log2(p[cell] / sides[cell]) for cell in zip(*np.nonzero(p), strict=True)))


def test_large_tables_differ_by_one_row_and_doubles_cannot_tell_most_of_them_apart() -> None:
    pairs = list(large_tables(20))
    assert all(np.array_equal(one.sum(axis=1), other.sum(axis=1)) for one, other in pairs)
    # One row moved, or the same row to either side.
    assert {int(np.abs(one - other).sum()) for one, other in pairs} == {2, 4}
    blind = sum(abs(naive_gain(one) - naive_gain(other)) < 1e-15 for one, other in pairs)
    assert blind > len(pairs) / 2


@given(st.lists(st.integers(1, 10**6), min_size=2, max_size=4), st.lists(st.integers(1, 1000), min_size=2, max_size=3))
def test_no_gain_is_exactly_zero_and_the_least_there_is_is_not(classes: list[int], values: list[int]) -> None:
    table = np.outer(classes, values)
    assert gain_bits(table) == 0.0
    assume(table.sum() < 2**53)
    table[0] += [1, *[0] * (len(values) - 1)]
    assert gain_bits(table) > 0.0


@settings(deadline=None, max_examples=30)
@given(seeds)
@example(0)
def test_a_tree_asks_for_no_constant_and_no_second_of_equals_or_complements(seed: int) -> None:
    X, labels = hard_columns(seed)
    chosen = grow_id3(X, labels).inputs
    for number in chosen:
        assert 0 < X[:, number].sum() < len(X)
        for before in range(number):
            assert not np.array_equal(X[:, before], X[:, number])
            assert not np.array_equal(X[:, before], ~X[:, number])


@settings(deadline=None, max_examples=30)
@given(seeds, st.integers(1, 6))
def test_baseline_placements_pass_over_constants_and_second_equals_too(seed: int, size: int) -> None:
    X, labels = hard_columns(seed)
    useless = np.hstack([X, ~X, X, np.ones((len(X), 2), bool)])
    assert list(islice(cmim(useless, labels), size)) == list(islice(cmim(X, labels), size))
    best = most_informative(X, labels)[:1]
    assert most_informative(useless, labels)[:1] == best


def test_the_hard_columns_hold_what_they_promise() -> None:
    X, labels = hard_columns(0)
    sums = X.sum(axis=0)
    assert X.shape[1] == 14
    assert (sums == len(X)).sum() == 1
    assert {1, len(X) - 1} <= set(sums.tolist())
    pairs = [(a, b) for a in range(14) for b in range(a)]
    assert any(np.array_equal(X[:, a], X[:, b]) for a, b in pairs)
    assert sum(np.array_equal(X[:, a], ~X[:, b]) for a, b in pairs) >= 3
    assert len(table_of(X[:, 0], labels)) == 4


@pytest.mark.parametrize("k", [2, 3, 4])
def test_the_other_columns_do_not_help_an_exclusive_or_and_do_not_stop_it(k: int) -> None:
    grasp_set = parity(k)
    # Columns behind that vary, and are equal to what is asked for first, or its complement.
    X = np.hstack([grasp_set.switches, ~grasp_set.switches, grasp_set.switches])
    tree = grow_id3(X, grasp_set.grasps)
    assert tree.inputs == tuple(range(k))
    assert tree.n_zero_gain == 2 ** (k - 1) - 1
    assert (tree.predict(X) == grasp_set.grasps).all()
