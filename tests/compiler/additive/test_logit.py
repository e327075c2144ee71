"""The additive logit: scikit-learn's answer on the same design, and what must not change a bit of it."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import minimize
from scipy.special import logsumexp
from sklearn.linear_model import LogisticRegression

from thenar.compiler.elementary import softmax
from thenar.compiler.samples import TrainingError
from thenar.compiler.trainers.logit import ColumnTables, fit_logit
from thenar.compiler.trainers.newton import BIAS_SHARE, BIN_SHARE, MINIMA

from ..conftest import grasps

SEEDS = st.integers(0, 2**32 - 1)


def scores_of(tables: ColumnTables, X: NDArray[np.generic]) -> NDArray[np.float64]:
    """Return the scores (n, K) of rows (n, d) of any numbers, column by column."""
    scores = np.tile(tables.bias, (len(X), 1))
    for column, (edges, rows) in enumerate(zip(tables.edges, tables.rows, strict=True)):
        x = np.asarray(X[:, column], np.float64)
        scores += rows[np.searchsorted(edges, x)]
        if column in tables.lines:
            low, high, row = tables.lines[column]
            scores += (np.clip(x, low, high) - low)[:, np.newaxis] * row
    return scores


def numbers(tables: ColumnTables) -> bytes:
    slopes = (tables.lines[column][2] for column in sorted(tables.lines))
    return b"".join(part.tobytes() for part in (tables.bias, *tables.edges, *tables.rows, *slopes))


@given(SEEDS, st.sampled_from([(0.05, 0.0), (1.0, 10.0), (4.0, 0.5)]))
@settings(max_examples=10, deadline=None)
def test_it_is_scikit_learns_answer_on_the_expanded_design(seed: int, pulls: tuple[float, float]) -> None:
    X, labels = grasps(seed)
    penalty, smoothness = pulls
    tables = fit_logit(X, labels, 3, penalty=penalty, smoothness=smoothness, max_bins=5, tolerance=1e-11)
    parts, penalties = [np.ones((len(X), 1))], [np.array([[BIAS_SHARE * penalty]])]
    for x, edges in zip(X.T, tables.edges, strict=True):
        bins = np.searchsorted(edges, x)
        if bins.max() < 2:
            parts.append((bins == 1)[:, np.newaxis])
            penalties.append(np.array([[penalty]]))
            continue
        parts.append(bins[:, np.newaxis] == np.arange(bins.max() + 1))
        steps = np.diff(np.eye(bins.max() + 1), axis=0)[: len(edges)]
        penalties.append(BIN_SHARE * penalty * np.eye(bins.max() + 1) + smoothness * steps.T @ steps)
    spread = np.linalg.cholesky(np.linalg.inv(block_diag(*penalties)))
    theirs = LogisticRegression(C=1.0, fit_intercept=False, tol=1e-10, solver="newton-cg", max_iter=1000)
    theirs.fit(np.hstack(parts) @ spread, labels)
    found = np.hstack(parts) @ (spread @ theirs.coef_.T)
    np.testing.assert_allclose(scores_of(tables, X), found, atol=1e-5)


@given(SEEDS, st.sampled_from([0.1, 3.0]))
@settings(max_examples=10, deadline=None)
def test_lines_are_scikit_learns_answer_on_scaled_codes(seed: int, smoothness: float) -> None:
    X, labels = grasps(seed)
    X[:, :6] *= 7  # of two values, that need not be 0 and 1
    tables = fit_logit(X, labels, 3, penalty=1.0, smoothness=smoothness, linear=True, tolerance=1e-10)
    pulls = np.r_[BIAS_SHARE, np.ones(6), (BIN_SHARE + smoothness) * X[:, 6:].var(axis=0)]
    design = np.column_stack([np.ones(len(X)), X[:, :6] / 7, X[:, 6:] - X[:, 6:].mean(axis=0)])
    theirs = LogisticRegression(C=1.0, fit_intercept=False, tol=1e-9, solver="newton-cg", max_iter=1000)
    theirs.fit(design / np.sqrt(pulls), labels)
    # A column is centred to the half of a 512th of its range, and so is what pulls its bias.
    np.testing.assert_allclose(scores_of(tables, X), (design / np.sqrt(pulls)) @ theirs.coef_.T, atol=2e-3)
    # Beyond what was trained on a line is flat.
    beyond = np.vstack([X[:1], X[:1]]).astype(float)
    beyond[0, 6:], beyond[1, 6:] = X[:, 6:].max(axis=0), 1e6
    assert np.ptp(scores_of(tables, beyond), axis=0).max() == 0


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_counted_bits_and_frames_known_to_be_held_are_scipys_answer(seed: int) -> None:
    X, labels = grasps(seed, joints=0)
    held = (labels < 2) & (np.random.default_rng(seed).random(len(X)) < 0.7)
    tables = fit_logit(X, labels, 3, penalty=0.5, tolerance=1e-10, counted=6, held=held)
    number = X.sum(axis=1)
    centred = number - number.mean()
    design = np.column_stack([np.ones(len(X)), X, centred])
    pulls = 0.5 * np.r_[BIAS_SHARE, np.ones(6), BIN_SHARE * np.mean(centred**2)]
    never = np.where(held[:, np.newaxis] & (np.arange(3) == 2), -np.inf, 0.0)

    def loss(flat: Any) -> tuple[float, Any]:
        rows = flat.reshape(-1, 3)
        scores = design @ rows + never
        over = np.exp(scores - logsumexp(scores, axis=1, keepdims=True)) - np.eye(3)[labels]
        lost = logsumexp(scores, axis=1) - scores[np.arange(len(X)), labels]
        pulled = pulls[:, np.newaxis] * rows
        return float(lost.sum() + 0.5 * (pulled * rows).sum()), (design.T @ over + pulled).ravel()

    theirs = minimize(loss, np.zeros(design.shape[1] * 3), jac=True, options={"gtol": 1e-9, "maxiter": 2000}).x
    # A count is centred to the half of a 512th of its range, as a line is.
    np.testing.assert_allclose(scores_of(tables, X), design @ theirs.reshape(-1, 3), atol=2e-3)


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_neither_the_order_of_rows_nor_that_of_columns_changes_a_bit(seed: int) -> None:
    X, labels = grasps(seed)
    rng, linear = np.random.default_rng(seed), bool(seed % 2)
    tables = fit_logit(X, labels, 3, linear=linear)
    rows, columns = rng.permutation(len(X)), rng.permutation(X.shape[1])
    assert numbers(fit_logit(X[rows], labels[rows], 3, linear=linear)) == numbers(tables)
    order = columns.tolist()
    edges, kept = (tuple(part[column] for column in order) for part in (tables.edges, tables.rows))
    lines = {place: tables.lines[column] for place, column in enumerate(order) if column in tables.lines}
    expected = ColumnTables(tables.bias, edges, kept, lines)
    assert numbers(fit_logit(X[:, columns], labels, 3, linear=linear)) == numbers(expected)


def test_a_class_without_rows_is_unlikely_and_finite() -> None:
    X, labels = grasps(1)
    probability = softmax(np.ascontiguousarray(scores_of(fit_logit(X, labels, 5), X).T))
    assert probability[3:].max() < 0.01
    assert probability[3:].min() > 0


@pytest.mark.parametrize("linear", [False, True])
def test_score_tables_add_what_the_columns_add(linear: bool) -> None:
    X, labels = grasps(3)
    fitted = fit_logit(X, labels, 3, linear=linear)
    found = fitted.score_tables(6).scores(X[:, :6].astype(bool), X[:, 6:].astype(np.uint16))
    np.testing.assert_allclose(found, scores_of(fitted, X), rtol=0, atol=1e-12)
    # Codes next to each other, at both ends of their range.
    ends = np.array([0, 1, 2, 65533, 65534, 65535] * 3, np.uint16)[:, np.newaxis]
    fitted = fit_logit(ends, np.arange(18) % 3, 3, max_bins=None, linear=linear)
    found = fitted.score_tables(0).scores(np.zeros((18, 0), bool), ends)
    np.testing.assert_allclose(found, scores_of(fitted, ends), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "because"),
    [
        ({"penalty": 0.0}, "penalty=0.0 must be above 0"),
        ({"smoothness": float("inf")}, "smoothness=inf"),
        ({"max_bins": 1}, "max_bins=1 must be at least 2"),
        ({"tolerance": 0.0}, "tolerance=0.0 must be at least 1e-12"),
    ],
)
def test_what_makes_no_sense_is_refused(changes: dict[str, Any], because: str) -> None:
    with pytest.raises(TrainingError, match=because):
        fit_logit(*grasps(0), 3, **changes)


@pytest.mark.parametrize(
    "change",
    [
        {"penalty": 2.0},
        {"smoothness": 1.0},
        {"tolerance": 1e-3},
        {"held": np.arange(60) < 30},
        {"counted": 6},
        {"linear": True},
    ],
    ids=lambda change: "".join(change),
)
def test_a_remembered_minimum_is_that_of_the_same_fit(change: dict[str, Any]) -> None:
    X, labels = grasps(5)
    labels[:30] %= 2  # none of these rows is of the last class
    plain, changed = (numbers(fit_logit(X, labels, 3, max_bins=None, **settings)) for settings in ({}, change))
    MINIMA.clear()
    assert numbers(fit_logit(X, labels, 3, max_bins=None, **change)) == changed != plain
    assert not any(rows.flags.writeable for rows in MINIMA.values())


@given(SEEDS, st.sampled_from([0.3, 0.8, 1.0]))
@settings(max_examples=10, deadline=None)
def test_sparse_lines_are_the_best_of_all_with_these_weights_zero(seed: int, sparsity: float) -> None:
    X, labels = grasps(seed, joints=5)
    own: dict[str, Any] = {"penalty": 1.0, "smoothness": 1.0, "linear": True, "tolerance": 1e-10}
    tables, dense = fit_logit(X, labels, 3, **own, sparsity=sparsity), fit_logit(X, labels, 3, **own)
    found, whole = (np.stack([each.lines[6 + joint][2] for joint in range(5)]) for each in (tables, dense))
    assert not found[:, -1].any()
    assert np.count_nonzero(found == 0) == 5 + round(sparsity * 10)
    sizes = np.abs(whole[:, :-1] - whole[:, -1:]) * X[:, 6:].std(axis=0)[:, np.newaxis]
    assert sizes[found[:, :-1] == 0].max() <= sizes[found[:, :-1] != 0].min(initial=np.inf)
    # No derivative is left: the gradient of the loss, of the penalty, and nothing else, at each weight that is not 0.
    over = softmax(np.ascontiguousarray(scores_of(tables, X).T)).T - (labels[:, np.newaxis] == np.arange(3))
    pull = (1 + BIN_SHARE) / 3  # of the weights that remain, a third of the others'
    slopes = (X[:, 6:] - X[:, 6:].mean(axis=0)).T @ over + pull * X[:, 6:].var(axis=0)[:, np.newaxis] * found
    np.testing.assert_allclose(slopes[found != 0], 0, atol=0.02 * np.abs(X[:, 6:]).max())
    bits = np.stack([rows[-1] - rows[0] for rows in tables.rows[:6]])
    np.testing.assert_allclose(X[:, :6].T @ over + bits / 3, 0, atol=1e-4)
