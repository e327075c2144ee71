"""The paper's trainer as a scikit-learn estimator: LogitBoost on decision stumps."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thenar.drivers.extras import optional
from thenar.runtime.model.tables import TIE, winners

from .elementary import Floats, softmax
from .samples import TrainingError
from .trainers.base import check_weights
from .trainers.logitboost import boost

with optional():
    from sklearn.base import BaseEstimator, ClassifierMixin
    from sklearn.utils import check_array
    from sklearn.utils.multiclass import check_classification_targets
    from sklearn.utils.validation import check_is_fitted, validate_data


class LogitBoostClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """Additive logistic regression on decision stumps, multi-class as Weka 3.6's LogitBoost computes it.

    Inputs are bits, integer codes or floating-point numbers, X (n, d). A threshold lies midway between two neighbouring
    values of the training set. `compile_build` trains the same with `trainer="logitboost"`.

    Parameters
    ----------
    rounds : int, default=100
        Number of boosting rounds; each fits one stump a class (the paper: 100).
    shrinkage : float, default=1.0
        Factor on every stump's output, in [1e-6, 1] (Weka's -H).
    z_max : float, default=3.0
        Clamp of the working response and of every stump's output, in (1, 100] (Weka 3.6: the constant 3).
    tolerance : float, optional
        Training stops where the mean log-likelihood changes by less than this in a round (Weka's -L); None: never.
    max_bins : int, optional
        The most bins per input (2 or more); they hold rows as evenly as possible. None: one for each value.
    classes : sequence, optional
        All labels, if y may lack some of them (a fold without a rare class). None: those in y.

    Attributes
    ----------
    classes_ : ndarray, shape (K,)
        The labels, in the order of the columns of scores and probabilities.
    stumps_ : Stumps
        The ensemble: `n_rounds_` rounds of K stumps.
    n_rounds_ : int
        The number of rounds trained.
    losses_ : ndarray of float, shape (n_rounds_ + 1,)
        Mean of -ln P(true class) on the training rows before and after every round.

    References
    ----------
    Friedman, Hastie, Tibshirani, Annals of Statistics 28 (2000), algorithm 6; docs/project/weka-parity.md.

    Examples
    --------
    >>> from thenar.compiler import LogitBoostClassifier
    >>> X, y = [[0, 10], [0, 200], [1, 30], [1, 220]], ["tip", "power", "tip", "power"]
    >>> classifier = LogitBoostClassifier(rounds=5).fit(X, y)
    >>> classifier.predict([[0, 20], [0, 215]]).tolist()
    ['tip', 'power']
    """

    def __init__(
        self,
        rounds: int = 100,
        shrinkage: float = 1.0,
        z_max: float = 3.0,
        tolerance: float | None = None,
        max_bins: int | None = None,
        classes: Sequence[Any] | None = None,
    ) -> None:
        self.rounds = rounds
        self.shrinkage = shrinkage
        self.z_max = z_max
        self.tolerance = tolerance
        self.max_bins = max_bins
        self.classes = classes

    def fit(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> Self:
        """Train on X (n, d) and labels y (n,).

        Parameters
        ----------
        X : array-like, shape (n, d)
            Finite numbers.
        y : array-like, shape (n,)
            Labels.
        sample_weight : array-like, shape (n,), optional
            The weight of each row; 0 removes it.

        Returns
        -------
        LogitBoostClassifier
            This estimator, fitted.

        Raises
        ------
        TrainingError
            A ValueError, if a parameter, a weight or a label is invalid.
        ValueError
            If X holds NaN or an infinity, here and wherever X is given.
        """
        inputs, targets = validate_data(self, X, y, dtype=_kept_dtypes(X))
        if self.classes is None:
            check_classification_targets(targets)
        self.classes_ = np.unique(targets) if self.classes is None else np.asarray(self.classes)
        labels, weights = self._index(targets), None
        if sample_weight is not None:
            weights = check_array(sample_weight, ensure_2d=False, dtype=np.float64, input_name="sample_weight")
            check_weights(weights, len(inputs))
            # Remove rows of zero weight: their values make no thresholds (in Weka they do).
            kept = weights > 0
            inputs, labels, weights = inputs[kept], labels[kept], weights[kept]
        self.stumps_, losses = boost(
            inputs,
            labels,
            len(self.classes_),
            rounds=self.rounds,
            shrinkage=self.shrinkage,
            z_max=self.z_max,
            tolerance=self.tolerance,
            weights=weights,
            max_bins=self.max_bins,
        )
        self.n_rounds_ = self.stumps_.n_rounds
        self.losses_ = np.array(losses)
        return self

    def decision_function(self, X: ArrayLike) -> Floats:
        """Return the additive scores F (n, K) of X (n, d); with two classes the second's minus the first's, (n,).

        The class with the largest score is predicted, the lowest number at a tie.
        """
        scores = self._scores(X)
        if len(self.classes_) != 2:
            return scores
        lead = scores[:, 1] - scores[:, 0]
        # Tied scores, which go to the first class, have a lead of zero.
        return np.where(np.abs(lead) <= TIE, 0.0, lead)

    def predict_proba(self, X: ArrayLike) -> Floats:
        """Return class probabilities (n, K), columns as in `classes_`."""
        scores = self._scores(X)
        return np.ascontiguousarray(softmax(np.ascontiguousarray(scores.T)).T)

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """Return the label (n,) with the largest score."""
        best = winners(self._scores(X))
        labels: NDArray[Any] = self.classes_[best]
        return labels

    def _scores(self, X: ArrayLike) -> Floats:
        check_is_fitted(self)
        return self.stumps_.scores(validate_data(self, X, reset=False, dtype=_kept_dtypes(X)))

    def _index(self, targets: NDArray[Any]) -> NDArray[np.intp]:
        matches = targets[:, np.newaxis] == self.classes_
        if not matches.any(axis=1).all():
            strange = targets[~matches.any(axis=1)][0]
            raise TrainingError(
                f"label {str(strange)!r} of y is not among the declared classes {self.classes_.tolist()}"
            )
        found: NDArray[np.intp] = matches.argmax(axis=1)
        return found


def _kept_dtypes(X: ArrayLike) -> str | list[type]:
    """Keep bits and integer codes as they are; convert all else to float64, on which thresholds are computed."""
    kind = getattr(getattr(X, "dtype", None), "kind", "")
    return "numeric" if kind in ("b", "i", "u") else [np.float64]
