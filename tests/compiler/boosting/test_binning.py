"""Sums left of every split, against a plain loop over rows."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.trainers import binning
from thenar.compiler.trainers.binning import Binned, bin_columns, midpoints

NUMBERS = st.sampled_from([0.0, 1.0, 2.0, 5.0, -3.0, np.nan]) | st.floats(-10, 10)
MATRICES = arrays(np.float64, st.tuples(st.integers(1, 12), st.integers(1, 5)), elements=NUMBERS)


def check_all_sums(X: np.ndarray) -> None:
    summands = np.arange(1.0, 1 + 2 * len(X)).reshape(len(X), 2)
    seen = []
    binned = bin_columns(X)
    for column, left, missing in sums_of(binned, summands):
        numbers = X[:, column]
        edges = midpoints(np.unique(numbers[~np.isnan(numbers)]))
        seen.append(column)
        assert len(left) == len(edges)
        assert np.array_equal(binned.columns[column].edges, edges)
        for split, edge in enumerate(edges):
            assert np.array_equal(left[split], summands[numbers <= edge].sum(axis=0))
            assert np.array_equal(binned.columns[column].bins <= split, numbers <= edge)
        assert np.array_equal(missing, summands[np.isnan(numbers)].sum(axis=0))
    varying = [c for c in range(X.shape[1]) if len(np.unique(X[~np.isnan(X[:, c]), c])) > 1]
    assert sorted(seen) == sorted(binned.columns) == varying


def sums_of(binned: Binned, summands: np.ndarray) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Yield the number of every column, the sums (splits, R) left of its splits and (R,) missing."""
    if len(binned.two.columns):
        for column, sums in zip(binned.two.columns.tolist(), binned.two.sums(summands), strict=True):
            yield column, sums[np.newaxis], np.zeros(summands.shape[1])
    for batch in binned.many.sums(summands):
        for at, column in enumerate(batch.columns.tolist()):
            missing = np.zeros(summands.shape[1]) if batch.missing is None else batch.missing[at]
            yield column, batch.left[at].T[batch.is_split[at]], missing


@given(MATRICES)
def test_every_split_of_every_varying_column_is_summed(X: np.ndarray) -> None:
    check_all_sums(X)


def test_batches_of_columns_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(binning, "_BATCH_ELEMENTS", 30)
    monkeypatch.setattr(binning, "_DENSE_PRODUCTS", 300)
    check_all_sums(np.random.default_rng(7).integers(0, 9, size=(40, 11)).astype(np.float64))
    check_all_sums(np.random.default_rng(7).integers(0, 2, size=(40, 11)).astype(np.float64))
    monkeypatch.setattr(binning, "_DENSE_ROWS", 0)
    check_all_sums(np.random.default_rng(7).integers(0, 2, size=(40, 11)).astype(np.float64))


@pytest.mark.parametrize("columns", [1, 7, 8, 9, 21])
@pytest.mark.parametrize("rows", [3, 40, 700])
@pytest.mark.parametrize("dense", [0, 700])
def test_columns_of_two_values_that_share_cells_are_summed_apart(
    rows: int, columns: int, dense: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(binning, "_DENSE_ROWS", dense)
    X = np.random.default_rng(columns).integers(0, 2, size=(rows, columns))
    X[:2] = [[0], [1]]
    check_all_sums(X.astype(np.float64))


LARGE, SMALL = st.floats(1e308, 1.7e308), st.integers(-9, 9).map(lambda units: units * 5e-324)


@given(MATRICES, st.integers(2, 6))
def test_limited_bins_use_a_subset_of_all_edges(X: np.ndarray, most: int) -> None:
    whole, few = bin_columns(X), bin_columns(X, most)
    assert sorted(few.columns) == sorted(whole.columns)
    for number, column in few.columns.items():
        every, kept = whole.columns[number].edges.tolist(), column.edges.tolist()
        assert set(kept) <= set(every)
        assert len(kept) <= most - 1
        if len(every) <= most - 1:
            assert kept == every
        for split, edge in enumerate(kept):
            assert np.array_equal(column.bins <= split, X[:, number] <= edge)
        assert np.array_equal(column.missing, np.isnan(X[:, number]))


@given(st.lists(st.integers(1, 50), min_size=4, max_size=30), st.integers(2, 8))
def test_bins_hold_rows_as_evenly_as_values_allow(counts: list[int], most: int) -> None:
    X = np.repeat(np.arange(float(len(counts))), counts)[:, np.newaxis]
    binned = bin_columns(X, most).columns[0]
    if len(counts) <= most:
        return
    column = X[:, 0]
    shares = [float(np.count_nonzero(column <= edge)) for edge in binned.edges]
    for part in range(1, most):
        wanted = part * len(X) / most
        nearest = min(abs(np.cumsum(counts)[:-1] - wanted))
        assert min(abs(share - wanted) for share in shares) == nearest
    assert not binned.missing.any()
