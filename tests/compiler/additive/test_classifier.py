"""The estimator: scikit-learn's own contract, and the trainer's own answer."""

from collections.abc import Callable

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.utils.estimator_checks import parametrize_with_checks

from thenar.compiler import AdditiveLogitClassifier, GraspSet, Recipe, Samples
from thenar.compiler.trainers.base import Training
from thenar.runtime.model.tables import ScoreTables


@parametrize_with_checks([AdditiveLogitClassifier(tolerance=1e-12), AdditiveLogitClassifier(linear=True)])
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.SkipTestWarning")
def test_scikit_learn_accepts_the_estimator(
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
