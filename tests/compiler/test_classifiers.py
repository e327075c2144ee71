"""The classifier: scikit-learn's own contract, and what users rely on besides."""

from collections.abc import Callable

import numpy as np
import pytest
from sklearn.utils.estimator_checks import parametrize_with_checks

from thenar.compiler import LogitBoostClassifier
from thenar.runtime.errors import ThenarError


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
    classifier = LogitBoostClassifier(rounds=5)
    with pytest.raises(ValueError, match="contains NaN"):
        classifier.fit(inputs, labels)
    with pytest.raises(ValueError, match="contains NaN"):
        classifier.fit(inputs[:4], labels[:4]).predict(inputs)
