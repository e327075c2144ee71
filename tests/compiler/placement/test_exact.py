from math import prod

from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.placement.exact import sign_of_f_sum, sign_of_log_sum
from thenar.stability.reference import information

multiples = st.dictionaries(st.integers(1, 60), st.integers(-8, 8), max_size=8)


@given(multiples)
def test_the_sign_is_that_of_the_product_against_one(terms: dict[int, int]) -> None:
    above = prod(m**times for m, times in terms.items() if times > 0)
    below = prod(m**-times for m, times in terms.items() if times < 0)
    assert sign_of_log_sum(terms) == (above > below) - (above < below)


@given(st.dictionaries(st.integers(2, 10**9), st.integers(-(10**9), 10**9), min_size=1, max_size=12))
def test_large_counts_have_the_sign_that_the_reference_gives_them(terms: dict[int, int]) -> None:
    assert sign_of_log_sum(terms) == information.sign_of_log_sum(terms)


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


def test_no_count_and_counts_of_one_add_nothing() -> None:
    assert sign_of_f_sum({0: 5, 1: -7}) == 0
    assert sign_of_f_sum({4: 1, 2: -4}) == 0
    assert sign_of_f_sum({4: 1, 2: -3}) == 1
