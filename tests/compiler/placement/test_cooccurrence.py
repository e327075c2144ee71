"""Counts of pairs of bits; what they tell is held against the reference in tests/stability and test_baselines.py."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.placement.cooccurrence import Cooccurrence


@given(st.integers(0, 1000), st.integers(1, 3))
def test_a_class_without_rows_changes_nothing(seed: int, classes: int) -> None:
    random = np.random.default_rng(seed)
    X, labels = random.random((12, 3)) < 0.5, random.integers(0, classes, 12)
    held, wider = Cooccurrence(X, labels, classes), Cooccurrence(X, labels, classes + 2)
    for given_bit in (None, 0, 2):
        assert wider.information(given_bit).tobytes() == held.information(given_bit).tobytes()
        assert wider.sign((1, given_bit), (2, None)) == held.sign((1, given_bit), (2, None))
    assert wider.error_bound > held.error_bound
