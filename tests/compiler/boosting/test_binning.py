"""Sums left of every split, against a plain loop over rows."""

from collections.abc import Iterator
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.trainers import binning
from thenar.compiler.trainers.binning import Binned, ManyValued, TwoValued, bin_columns, midpoints

NUMBERS = st.sampled_from([0.0, 1.0, 2.0, 5.0, -3.0, np.nan]) | st.floats(-10, 10)
MATRICES = arrays(np.float64, st.tuples(st.integers(1, 12), st.integers(1, 5)), elements=NUMBERS)


def check_all_sums(X: np.ndarray) -> None:
    summands = np.arange(1.0, 1 + 2 * len(X)).reshape(len(X), 2)
    seen = []
    for group in bin_columns(X).groups:
        for position, column, left, missing in sums_of(group, summands):
            numbers = X[:, column]
            edges = midpoints(np.unique(numbers[~np.isnan(numbers)]))
            seen.append(column)
            assert len(left) == len(edges)
            for split, edge in enumerate(edges):
                assert np.array_equal(left[split], summands[numbers <= edge].sum(axis=0))
                assert group.threshold(position, split) == edge
                assert np.array_equal(group.goes_left(position, split), numbers <= edge)
            assert np.array_equal(missing, summands[np.isnan(numbers)].sum(axis=0))
    varying = [c for c in range(X.shape[1]) if len(np.unique(X[~np.isnan(X[:, c]), c])) > 1]
    assert sorted(seen) == varying


def sums_of(group: TwoValued | ManyValued, summands: np.ndarray) -> Iterator[tuple[int, int, np.ndarray, np.ndarray]]:
    """Yield the position of every column, its number, the sums (splits, R) left of its splits and (R,) missing."""
    positions = {column: position for position, column in enumerate(group.columns.tolist())}
    if isinstance(group, TwoValued):
        for column, sums in zip(group.columns.tolist(), group.sums(summands), strict=True):
            yield positions[column], column, sums[np.newaxis], np.zeros(summands.shape[1])
        return
    for batch in group.sums(summands):
        for at, column in enumerate(batch.columns.tolist()):
            yield positions[column], column, batch.left[at].T[batch.is_split[at]], batch.missing[at]


@given(MATRICES)
def test_every_split_of_every_varying_column_is_summed(X: np.ndarray) -> None:
    check_all_sums(X)


def test_batches_of_columns_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(binning, "_BATCH_ELEMENTS", 30)
    check_all_sums(np.random.default_rng(7).integers(0, 9, size=(40, 11)).astype(np.float64))
    check_all_sums(np.random.default_rng(7).integers(0, 2, size=(40, 11)).astype(np.float64))


@pytest.mark.parametrize("columns", [1, 7, 8, 9, 21])
@pytest.mark.parametrize("rows", [3, 40, 700])
def test_columns_of_two_values_that_share_cells_are_summed_apart(rows: int, columns: int) -> None:
    X = np.random.default_rng(columns).integers(0, 2, size=(rows, columns))
    X[:2] = [[0], [1]]
    check_all_sums(X.astype(np.float64))


DOUBLES = st.floats(allow_nan=False, allow_infinity=False)
LARGE, SMALL = st.floats(1e308, 1.7e308), st.integers(-9, 9).map(lambda units: units * 5e-324)


@given(st.tuples(DOUBLES, DOUBLES) | st.tuples(LARGE, LARGE) | st.tuples(SMALL, SMALL))
def test_a_threshold_is_the_midpoint_correctly_rounded_below_the_upper(pair: tuple[float, float]) -> None:
    lower, upper = sorted(pair)
    if lower == upper:
        return
    middle = float((Fraction(lower) + Fraction(upper)) / 2)
    assert midpoints(np.array([lower, upper]))[0] == (middle if middle < upper else lower)


@given(MATRICES, st.integers(2, 6))
def test_limited_bins_use_a_subset_of_all_edges(X: np.ndarray, most: int) -> None:
    whole, few = bin_columns(X), bin_columns(X, most)
    assert sorted(few.home) == sorted(whole.home)
    for column in few.home:
        every, kept = edges_of(whole, column, X), edges_of(few, column, X)
        assert set(kept) <= set(every)
        assert len(kept) <= most - 1
        if len(every) <= most - 1:
            assert kept == every
        group, position = few.home[column]
        for split, edge in enumerate(kept):
            assert np.array_equal(group.goes_left(position, split), X[:, column] <= edge)
        missing = group.is_missing(position)
        assert np.array_equal(np.isnan(X[:, column]), np.zeros(len(X), bool) if missing is None else missing)


def edges_of(binned: Binned, column: int, X: np.ndarray) -> list[float]:
    """Return the thresholds of a column, as many as part its values."""
    group, position = binned.home[column]
    numbers = X[~np.isnan(X[:, column]), column]
    lefts: list[float] = []
    for split in range(len(np.unique(numbers)) - 1):
        try:
            lefts.append(group.threshold(position, split))
        except IndexError:
            break
    return lefts[:1] if isinstance(group, TwoValued) else lefts


@given(st.lists(st.integers(1, 50), min_size=4, max_size=30), st.integers(2, 8))
def test_bins_hold_rows_as_evenly_as_values_allow(counts: list[int], most: int) -> None:
    X = np.repeat(np.arange(float(len(counts))), counts)[:, np.newaxis]
    group, position = bin_columns(X, most).home[0]
    edges = edges_of(bin_columns(X, most), 0, X)
    if len(counts) <= most:
        return
    column = X[:, 0]
    shares = [float(np.count_nonzero(column <= edge)) for edge in edges]
    for part in range(1, most):
        wanted = part * len(X) / most
        nearest = min(abs(np.cumsum(counts)[:-1] - wanted))
        assert min(abs(share - wanted) for share in shares) == nearest
    assert group.is_missing(position) is None or not np.any(group.is_missing(position))
