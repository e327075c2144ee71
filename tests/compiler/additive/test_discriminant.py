"""Linear discriminants: scikit-learn's answer, and the size of their scores."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import log_softmax
from sklearn.covariance import ledoit_wolf_shrinkage
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

from thenar.compiler import Samples, ScoreTables, TrainingError
from thenar.compiler.trainers.base import Training
from thenar.compiler.trainers.discriminant import fit_discriminant

from ..conftest import grasps
from .test_logit import SEEDS, numbers, scores_of


@given(SEEDS, st.sampled_from([None, 6]))
@settings(max_examples=10, deadline=None)
def test_it_is_scikit_learns_answer_on_inputs_in_their_units(seed: int, max_bins: int | None) -> None:
    X, labels = grasps(seed)
    tables = fit_discriminant(X, labels, np.arange(len(X)), 3, max_bins=max_bins, calibrated=False)
    means = np.stack([X[labels == label].mean(axis=0) for label in range(3)])
    units = np.r_[np.full(6, 0.5), (X - means[labels]).std(axis=0)[6:]]
    edges = [(X[:, 6 + joint, np.newaxis] > tables.edges[6 + joint]) / 2.0 for joint in range(2)]
    assert [each.shape[1] for each in edges] == [0 if max_bins is None else max_bins - 1] * 2
    design = np.column_stack([X / units, *edges])
    rest = design - np.stack([design[labels == label].mean(axis=0) for label in range(3)])[labels]
    share = ledoit_wolf_shrinkage(rest, assume_centered=True)
    theirs = LinearDiscriminantAnalysis(solver="lsqr", shrinkage=share).fit(design, labels)
    found, wanted = (log_softmax(scores, axis=1) for scores in (scores_of(tables, X), theirs.decision_function(design)))
    # A code is rounded to a 512th of its range.
    np.testing.assert_allclose(found, wanted, atol=0.02 * np.abs(wanted).max())


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_frames_of_a_trial_count_as_one_and_their_order_for_nothing(seed: int) -> None:
    X, labels = grasps(seed)
    trials, rows = np.arange(len(X)), np.random.default_rng(seed).permutation(np.repeat(np.arange(len(X)), 3))
    once = fit_discriminant(X, labels, trials, 3, max_bins=4, calibrated=False)
    thrice = fit_discriminant(X[rows], labels[rows], trials[rows], 3, max_bins=4, calibrated=False)
    np.testing.assert_allclose(scores_of(thrice, X), scores_of(once, X), rtol=1e-9, atol=1e-9)
    again = fit_discriminant(X[rows[::-1]], labels[rows[::-1]], trials[rows[::-1]], 3, max_bins=4, calibrated=False)
    assert numbers(again) == numbers(thrice)


@given(SEEDS)
@settings(max_examples=5, deadline=None)
def test_calibrated_scores_are_as_sure_as_new_trials_warrant(seed: int) -> None:
    X, labels = grasps(seed, 2000, 6, 3, 4)
    (X, fresh), (labels, truth) = np.split(X, [24]), np.split(labels, [24])
    losses = []
    for calibrated in (True, False):
        tables = fit_discriminant(X, labels, np.arange(24), 4, max_bins=16, calibrated=calibrated)
        scores = scores_of(tables, fresh)
        losses.append(-log_softmax(scores, axis=1)[np.arange(len(truth)), truth].mean())
    assert losses[0] < losses[1] / 2


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_a_class_without_rows_is_predicted_nowhere_and_equal_inputs_share_a_weight(seed: int) -> None:
    X, labels = grasps(seed)
    samples = Samples(np.column_stack([X[:, :6], X[:, :6], np.zeros(len(X))]) > 0, X[:, 6:].astype(np.uint16),
                      labels, tuple("abcd"))  # fmt: skip
    tables = Training("discriminant", {"max_bins": 4}).train(samples)
    anything = np.random.default_rng(seed)
    switches, codes = anything.random((500, 13)) < 0.5, anything.integers(0, 65536, (500, 2)).astype(np.uint16)
    assert tables.scores(switches, codes).argmax(axis=1).max() < 3
    alone = Training("discriminant", {"max_bins": 4}).train(samples.with_joints(()))
    assert alone.scores(switches, codes[:, :0]).argmax(axis=1).max() < 3
    assert isinstance(tables, ScoreTables)
    np.testing.assert_allclose(tables.switch_rows[:6], tables.switch_rows[6:12], rtol=1e-6, atol=1e-9)
    assert not tables.switch_rows[12].any()


def test_one_trial_suffices_and_broken_numbers_are_refused() -> None:
    X, labels = grasps(0)
    assert np.isfinite(fit_discriminant(X[:1], labels[:1], np.zeros(1, np.intp), 3).bias).all()
    with pytest.raises(TrainingError, match="row 0, column 6 is infinite"):
        fit_discriminant(np.where(np.arange(8) == 6, np.inf, X), labels, np.arange(len(X)), 3)
