"""Thresholds of taxels: the split of most information, held against scikit-learn and against every split there is."""

from itertools import pairwise
from math import log2

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from sklearn.tree import DecisionTreeClassifier

from thenar.compiler.placement.thresholds import made_plain, taxel_thresholds, with_switches
from thenar.compiler.samples import Samples, SamplesError


def samples_of(codes: list[int], labels: list[int]) -> Samples:
    none = np.zeros((len(codes), 0))
    taxels = np.array(codes, np.uint16)[:, np.newaxis]
    return Samples(none.astype(bool), none.astype(np.uint16), np.array(labels), tuple("012"), taxels=taxels)


def entropy(labels: list[int]) -> float:
    shares = [labels.count(label) / len(labels) for label in set(labels)]
    return -sum(share * log2(share) for share in shares)


def remaining(codes: list[int], labels: list[int], threshold: int) -> float:
    sides = [[label for code, label in zip(codes, labels, strict=True) if (code > threshold) is up] for up in (0, 1)]
    return sum(len(side) * entropy(side) for side in sides if side)


ROWS = st.lists(st.tuples(st.sampled_from([0, 1, 2, 7, 8, 300, 65535]), st.integers(0, 2)), min_size=1, max_size=14)


@given(ROWS)
def test_no_threshold_tells_more_and_of_equal_ones_it_is_the_lowest(rows: list[tuple[int, int]]) -> None:
    codes, labels = map(list, zip(*rows, strict=True))
    (found,) = taxel_thresholds(samples_of(codes, labels))
    values = sorted(set(codes))
    if len(values) == 1:
        assert found == values[0]
        return
    middles = [(low + high) // 2 for low, high in pairwise(values)]
    assert found in middles
    left = [remaining(codes, labels, middle) for middle in middles]
    mine = left[middles.index(found)]
    assert mine <= min(left) + 1e-9
    assert all(other > mine - 1e-9 for other in left[: middles.index(found)])


@pytest.mark.parametrize("seed", range(20))
def test_scikit_learn_splits_a_taxel_at_the_same_place(seed: int) -> None:
    random = np.random.default_rng(seed)
    labels = random.integers(0, 3, 200)
    codes = np.clip(400 * labels + random.normal(300, 250, 200), 0, 4095).astype(np.uint16)
    (found,) = taxel_thresholds(samples_of(codes.tolist(), labels.tolist()))
    stump = DecisionTreeClassifier(criterion="entropy", max_depth=1, random_state=0).fit(codes[:, None], labels)
    assert found == int(stump.tree_.threshold[0])


def test_of_exact_ties_the_lowest_is_taken_where_floating_point_sees_none() -> None:
    """Splits of mirrored counts tell equally much."""
    codes, labels = [0, 10, 20, 30], [0, 1, 1, 0]
    assert taxel_thresholds(samples_of(codes, labels)) == (5,)


def test_thresholds_of_the_training_rows_make_switches_of_all_rows() -> None:
    whole = samples_of([0, 4, 10, 20, 7, 8], [0, 0, 1, 1, 0, 1])
    thresholds = taxel_thresholds(whole.rows(np.arange(4)))
    assert thresholds == (7,)
    plain = with_switches(whole, thresholds)
    assert plain.switches[:, 0].tolist() == [False, False, True, True, False, True]
    assert plain.inputs.shape == (6, 1)
    assert made_plain(plain) is plain
    with pytest.raises(SamplesError, match="taxels are no inputs"):
        _ = whole.inputs
