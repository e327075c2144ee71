from fractions import Fraction
from math import prod

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.placement.gain import (
    Counts,
    NodeCounts,
    best_position,
    compare,
    first_best,
    gain_bits,
    sign_of_log_sum,
)

tables = arrays(np.int64, st.tuples(st.integers(1, 5), st.integers(2, 4)), elements=st.integers(0, 30))


def node_of(*inputs: Counts) -> NodeCounts:
    """Return the node whose inputs have these tables."""
    cells = np.concatenate([table[:, 1:] for table in inputs], axis=1)
    starts = np.cumsum([0] + [table.shape[1] - 1 for table in inputs])[:-1]
    return NodeCounts(inputs[0].sum(axis=1), cells, starts)


@given(st.lists(st.integers(1, 50), min_size=1, max_size=4), st.lists(st.integers(1, 50), min_size=2, max_size=4))
def test_an_independent_input_gains_exactly_nothing(classes: list[int], values: list[int]) -> None:
    table = np.outer(classes, values)
    assert gain_bits(table) == 0.0
    if len(classes) > 1:
        table[0, 0] += 1
        assert gain_bits(table) > 0.0


@pytest.mark.parametrize("m", [10**6, 10**9])
def test_the_smallest_gain_of_all_is_chosen_over_none(m: int) -> None:
    nothing, least = np.full((2, 2), m), np.array([[m + 1, m - 1], [m, m]])
    assert best_position(node_of(nothing, least), np.array([0, 1])) == 1
    assert best_position(node_of(nothing, nothing, least, least), np.array([0, 1, 3, 2])) == 3
    assert gain_bits(least) > 0.0


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ([[8, 0], [4, 4]], [[7, 1], [2, 6]]),
        ([[6, 0], [3, 3], [3, 3]], [[5, 1], [4, 2], [1, 5]]),
        ([[12, 0], [6, 6]], [[12, 0, 0], [6, 6, 0]]),
    ],
)
def test_gains_of_one_value_and_other_terms_go_to_the_lowest_number(
    one: list[list[int]], other: list[list[int]]
) -> None:
    first, second = np.array(one), np.array(other)
    assert compare(first, first.sum(axis=0), second, second.sum(axis=0)) == 0
    for tables in ((first, second), (second, first)):
        assert best_position(node_of(*tables), np.array([0, 1])) == 0
        assert best_position(node_of(*tables), np.array([1, 0])) == 1


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_rows_per_value_distinguish_inputs_of_equal_cells(order: tuple[int, int]) -> None:
    # Classes of 2 b + 1 and 2 d + 1 rows, parted (b + 1, b) by both inputs and (d + 1, d) or (d, d + 1): values of
    # b + d + 2 and b + d rows, or of b + d + 1 both, which says more, by less than a double can tell.
    b, d = 10**9, 7 * 10**8
    cells = np.array([[b, b], [d, d + 1]])[:, list(order)]
    node = NodeCounts(np.array([2 * b + 1, 2 * d + 1]), cells, np.array([0, 1]))
    assert best_position(node, np.array([0, 1])) == order.index(1)


@given(st.integers(2, 10**6), st.integers(2, 10**6), st.integers(1, 10**6))
def test_a_factored_number_cancels_its_factors(a: int, b: int, times: int) -> None:
    terms = {a * b: times}
    for factor in (a, b):
        terms[factor] = terms.get(factor, 0) - times
    assert sign_of_log_sum(terms) == 0
    assert sign_of_log_sum(terms | {a * b: terms[a * b] + 1}) == 1


def test_numbers_that_differ_by_one_in_a_billion_billion_are_told_apart() -> None:
    n = 10**18
    assert sign_of_log_sum({n + 1: 1, n: -2, n - 1: 1}) == -1
    assert sign_of_log_sum({n**2: 1, n - 1: -1, n + 1: -1}) == 1
    assert sign_of_log_sum({n**2 - 1: 1, n - 1: -1, n + 1: -1}) == 0


def test_a_difference_below_forty_digits_takes_more_digits() -> None:
    for n in range(10**30, 3 * 10**31, 10**30):
        assert sign_of_log_sum({n**2: 1, n - 1: -1, n + 1: -1}) == 1
        assert sign_of_log_sum({n**2: -1, n - 1: 1, n + 1: 1}) == -1


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 6))
def test_the_first_of_the_best_is_that_of_products_of_whole_numbers(seed: int, n: int, candidates: int) -> None:
    random = np.random.default_rng(seed)
    closed = np.sort(random.multinomial(n, [1 / 6] * 6, size=candidates).reshape(candidates, 3, 2), axis=2)
    # Gains of two values and three classes: none is negative.
    plus = np.column_stack([closed.reshape(candidates, -1), np.full(candidates, n)])
    minus = np.column_stack([closed.sum(axis=1), closed.sum(axis=2)])
    costs = np.sort(random.integers(1, 4, candidates))
    values = [
        Fraction(prod(m**m for m in more), prod(m**m for m in less))
        for more, less in zip(plus.tolist(), minus.tolist(), strict=True)
    ]
    best = 0
    for one in range(candidates):
        if values[one] ** int(costs[best]) > values[best] ** int(costs[one]):
            best = one
    assert first_best(plus, minus, costs) == best
    assert first_best(plus, minus) == values.index(max(values))
    assert compare(plus[0], minus[0], plus[-1], minus[-1]) == (values[0] > values[-1]) - (values[0] < values[-1])
