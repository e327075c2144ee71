"""The bound of integer tables: the furthest sum of all of their states."""

from itertools import product

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.terms.base import HIGHEST_CODE


def whole_numbers(seed: int, classes: int, switches: int, bins: tuple[int, ...], most: int) -> IntegerTables:
    """Return integer tables of random numbers up to `most`, in which a mean may lie outside its rows."""
    random = np.random.default_rng(seed)

    def rows(*shape: int) -> NDArray[np.int16]:
        return random.integers(-most, most + 1, shape).astype(np.int16)

    thresholds = [np.sort(random.choice(HIGHEST_CODE, n - 1, replace=False)).astype(np.uint16) for n in bins]
    joints = tuple(rows(n, classes) for n in bins)
    means = rows(switches, classes), rows(len(bins), classes)
    return IntegerTables.of(rows(classes), rows(switches, classes), tuple(thresholds), joints, *means, 1.0)


tables = st.builds(
    whole_numbers,
    st.integers(0, 10_000),
    st.integers(2, 5),
    st.integers(0, 5),
    st.lists(st.integers(1, 4), max_size=2).map(tuple),
    st.sampled_from([1, 10, 1000]),
)


@settings(deadline=None, max_examples=40)
@given(tables)
def test_no_partial_sum_of_any_state_gets_further_and_one_gets_as_far(tables: IntegerTables) -> None:
    switches = zip(0 * tables.switch_rows, tables.switch_rows, tables.switch_means, strict=True)
    joints = ((*rows, mean) for rows, mean in zip(tables.joint_rows, tables.joint_means, strict=True))
    reached = 0
    for terms in product([tables.bias], *switches, *joints):
        rows = np.array(terms, int)
        reached = max(reached, *np.maximum(rows, 0).sum(axis=0), *np.maximum(-rows, 0).sum(axis=0))
    assert tables.bound == reached
