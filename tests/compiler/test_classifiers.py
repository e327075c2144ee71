"""The estimators: scikit-learn's own contract, and what users rely on besides."""

from collections.abc import Callable

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.utils.estimator_checks import parametrize_with_checks

from thenar.compiler import AdditiveLogitClassifier, GraspSet, LogitBoostClassifier, Recipe, Samples
from thenar.compiler.trainers.base import Training
from thenar.runtime.errors import ThenarError
from thenar.runtime.model.tables import ScoreTables


@parametrize_with_checks([LogitBoostClassifier(rounds=20)])
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.SkipTestWarning")
def test_scikit_learn_accepts_the_estimator(
    estimator: LogitBoostClassifier, check: Callable[[LogitBoostClassifier], None]
) -> None:
    check(estimator)  # raises AssertionError where the contract is broken


X = np.array([[0, 10], [0, 200], [1, 30], [1, 220], [0, 20], [1, 210]])
Y = np.array(["tip", "power", "tip", "power", "tip", "power"])


def test_declared_classes_keep_their_column_though_no_row_has_them() -> None:
    classifier = LogitBoostClassifier(rounds=50, classes=["power", "hook", "tip"]).fit(X, Y)
    probability = classifier.predict_proba(X)
    assert probability.shape == (6, 3)
    assert (probability[:, 1] < 0.01).all()


def test_a_label_outside_the_declared_classes_is_named() -> None:
    with pytest.raises(ThenarError, match="'tip' of y is not among"):
        LogitBoostClassifier(classes=["power", "hook"]).fit(X, Y)


def test_a_missing_input_is_refused() -> None:
    inputs = np.array([[0.0], [0.0], [1.0], [1.0], [np.nan], [np.nan]])
    labels = np.array([0, 0, 1, 1, 2, 2])
    for classifier in (LogitBoostClassifier(rounds=5), AdditiveLogitClassifier()):
        with pytest.raises(ValueError, match="contains NaN"):
            classifier.fit(inputs, labels)
        with pytest.raises(ValueError, match="contains NaN"):
            classifier.fit(inputs[:4], labels[:4]).predict(inputs)


def test_staged_decisions_end_where_decisions_are() -> None:
    classifier = LogitBoostClassifier(rounds=7).fit(X, Y)
    stages = list(classifier.staged_decision_function(X))
    assert len(stages) == classifier.n_rounds_ == 7
    assert np.array_equal(stages[-1], classifier.decision_function(X))
    assert len(classifier.losses_) == 8


@parametrize_with_checks([AdditiveLogitClassifier(tolerance=1e-12), AdditiveLogitClassifier(linear=True)])
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.SkipTestWarning")
def test_scikit_learn_accepts_the_additive_estimator(
    estimator: AdditiveLogitClassifier, check: Callable[[AdditiveLogitClassifier], None]
) -> None:
    check(estimator)  # raises AssertionError where the contract is broken


def test_it_is_the_trainer_logit(grasp_set: GraspSet) -> None:
    samples = Samples.of(grasp_set)
    options = Recipe(trainer="logit", settings={"penalty": 2.0, "smoothness": 3.0}, max_bins=5)
    model = Training.of(options).train(samples)
    assert isinstance(model, ScoreTables)
    classifier = AdditiveLogitClassifier(penalty=2.0, smoothness=3.0, max_bins=5)
    tables = clone(classifier).fit(samples.inputs, samples.labels).tables_.score_tables(samples.n_switches)
    for ours, theirs in (
        (model.switch_rows, tables.switch_rows),
        *zip(model.joint_rows, tables.joint_rows, strict=True),
    ):
        assert np.array_equal(ours, theirs)


def test_declared_classes_and_one_class_alone() -> None:
    X, y = np.array([[0, 10], [0, 200], [1, 30], [1, 220]]), ["tip", "power", "tip", "power"]
    probability = AdditiveLogitClassifier(classes=["power", "hook", "tip"]).fit(X, y).predict_proba(X)
    assert probability.shape == (4, 3)
    assert (probability.argmax(axis=1) != 1).all()
    assert (AdditiveLogitClassifier().fit(X, np.zeros(4, int)).predict_proba(X) == 1.0).all()


def test_a_row_of_no_weight_is_not_there() -> None:
    X, y = np.array([[0.0], [1.0], [2.0], [50.0]]), np.array([0, 0, 1, 1])
    weighted = AdditiveLogitClassifier().fit(X, y, sample_weight=[1, 1, 1, 0])
    absent = AdditiveLogitClassifier().fit(X[:3], y[:3], sample_weight=[1, 1, 1])
    assert np.array_equal(weighted.decision_function(X), absent.decision_function(X))
