import math
from random import Random

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.placement.sums import Floats, dot, exact_sum, sums_of_logs

NUMBERS = arrays(np.float64, st.integers(0, 60), elements=st.floats(-1e9, 1e9))


@given(NUMBERS, st.randoms(use_true_random=False))
def test_a_sum_is_the_same_in_every_order(values: Floats, random: Random) -> None:
    shuffled = values.tolist()
    random.shuffle(shuffled)
    assert exact_sum(np.array(shuffled)) == exact_sum(values)


@given(NUMBERS)
def test_a_sum_is_right_but_for_the_grid(values: Floats) -> None:
    bound = np.abs(values).max(initial=0.0) * len(values) ** 2 * 2.0**-51 + len(values) * 2.0**-1000
    assert abs(exact_sum(values) - math.fsum(values)) <= bound


@given(arrays(np.float64, (3, 4), elements=st.floats(-1e-160, 1e-160)))
def test_products_next_to_the_smallest_doubles_do_no_harm(values: Floats) -> None:
    assert abs(dot(values, values)) <= 1e-300


@given(st.integers(0, 2**32 - 1), st.integers(1, 1500))
def test_logarithms_of_products_are_sums_of_logarithms(seed: int, n: int) -> None:
    factors = np.exp(np.random.default_rng(seed).normal(0, 20, (n, 3)))
    expected = [math.fsum(map(math.log, column)) for column in factors.T]
    np.testing.assert_allclose(sums_of_logs(factors), expected, rtol=1e-12, atol=1e-9)
