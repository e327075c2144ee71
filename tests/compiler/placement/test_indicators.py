import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.placement import indicators
from thenar.compiler.placement.indicators import BINS, sampled, thermometer
from thenar.compiler.samples import Samples


@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.integers(1, 9))
def test_a_joint_becomes_bits_that_rise_one_after_another(seed: int, n: int, highest: int) -> None:
    codes = np.random.default_rng(seed).integers(0, highest + 1, (n, 2)).astype(np.uint16)
    for column in codes.T:
        bits = thermometer(column[:, np.newaxis])
        assert len(bits) < BINS
        assert (bits.any(axis=1) & ~bits.all(axis=1)).all()
        assert len(np.unique(bits, axis=0)) == len(bits)
        higher = column[:, np.newaxis] >= column
        assert (bits[:, :, np.newaxis] >= bits[:, np.newaxis, :])[:, higher].all()


def test_bins_hold_rows_as_evenly_as_can_be() -> None:
    bits = thermometer(np.arange(80, dtype=np.uint16)[:, np.newaxis])
    assert np.diff(bits.sum(axis=1)).tolist() == [-10] * (BINS - 2)


def test_no_joints_give_no_bits() -> None:
    assert thermometer(np.zeros((5, 0), np.uint16)).shape == (0, 5)


def test_a_sample_keeps_the_shares_of_the_classes_and_the_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(indicators, "MOST_ROWS", 30)
    labels = np.array([0] * 100 + [1] * 200)[np.random.default_rng(0).permutation(300)]
    codes = np.arange(300, dtype=np.uint16)[:, np.newaxis]
    few = sampled(Samples(np.zeros((300, 1), np.bool_), codes, labels, tuple("01")))
    assert np.bincount(few.labels).tolist() == [10, 20]
    assert (np.diff(few.codes[:, 0].astype(int)) > 0).all()
    assert (labels[few.codes[:, 0]] == few.labels).all()


def test_a_small_set_is_taken_whole() -> None:
    learning = Samples(np.zeros((3, 1), np.bool_), np.zeros((3, 0), np.uint16), np.zeros(3, np.intp), tuple("0"))
    assert sampled(learning) is learning
