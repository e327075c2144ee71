"""Sums left of every split, against a plain loop over rows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.boosting import binning
from thenar.compiler.boosting.binning import bin_columns, midpoints

NUMBERS = st.sampled_from([0.0, 1.0, 2.0, 5.0, -3.0, np.nan]) | st.floats(-10, 10)
MATRICES = arrays(np.float64, st.tuples(st.integers(1, 12), st.integers(1, 5)), elements=NUMBERS)


def check_all_sums(X: np.ndarray) -> None:
    summands = np.arange(1.0, 1 + 2 * len(X)).reshape(2, len(X))
    seen = []
    for group in bin_columns(X).groups:
        for sums in group.sums(summands):
            for at, column in enumerate(sums.columns):
                numbers = X[:, column]
                edges = midpoints(np.unique(numbers[~np.isnan(numbers)]))
                seen.append(int(column))
                for split, edge in enumerate(edges):
                    expected = summands[:, numbers <= edge].sum(axis=1)
                    assert np.array_equal(sums.left[split, at], expected)
                    position = int(np.flatnonzero(group.columns == column)[0])
                    assert group.threshold(position, split) == edge
                    assert np.array_equal(group.goes_left(position, split), numbers <= edge)
                if sums.missing is not None:
                    assert np.array_equal(sums.missing[at], summands[:, np.isnan(numbers)].sum(axis=1))
                if sums.valid is not None:
                    assert sums.valid[:, at].sum() == len(edges)
                    assert sums.valid[: len(edges), at].all()
    varying = [c for c in range(X.shape[1]) if len(np.unique(X[~np.isnan(X[:, c]), c])) > 1]
    assert sorted(seen) == varying


@given(MATRICES)
def test_every_split_of_every_varying_column_is_summed(X: np.ndarray) -> None:
    check_all_sums(X)


def test_batches_of_columns_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(binning, "_BATCH_ELEMENTS", 30)
    check_all_sums(np.random.default_rng(7).integers(0, 9, size=(40, 11)).astype(np.float64))


def test_bits_and_codes_need_no_floats() -> None:
    bits = np.array([[True, False], [False, False], [True, True]])
    assert [group.columns.tolist() for group in bin_columns(bits).groups] == [[0, 1]]


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=8, unique=True))
def test_a_threshold_parts_its_neighbours_however_close_or_large(values: list[float]) -> None:
    ordered = np.unique(np.array(values))
    edges = midpoints(ordered)
    assert np.isfinite(edges).all()
    assert (ordered[:-1] <= edges).all()
    assert (edges < ordered[1:]).all()
