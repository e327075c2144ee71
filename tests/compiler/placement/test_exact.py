from fractions import Fraction
from math import prod

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.placement.gain import compare, first_best, sign_of_log_sum


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
