"""LogitBoost on decision stumps as a scikit-learn estimator."""

from collections.abc import Iterator, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils import Tags
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import _check_sample_weight, check_is_fitted, validate_data

from ..elementary import softmax
from .boost import BoostingError, boost
from .stumps import winners

Floats = NDArray[np.float64]


class LogitBoostClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """Additive logistic regression on decision stumps, multi-class as Weka 3.6's LogitBoost computes it.

    Inputs are bits, integer codes or floating-point numbers, X (n, d); NaN is a missing value, which gets a branch of
    its own. A threshold lies midway between two neighbouring values of the training set.

    Parameters
    ----------
    rounds : number of boosting rounds; each fits one stump a class (the paper: 100).
    shrinkage : factor on every stump's answer, in [1e-6, 1] (Weka's -H).
    z_max : clamp of the working response and of every stump's answer, in (1, 100] (Weka 3.6: the constant 3).
    tolerance : stop where the mean log-likelihood changes by less than this in a round (Weka's -L); None never stops.
    classes : labels that exist even where y lacks some of them (a fold without a rare class); None: those in y.

    Attributes
    ----------
    classes_ : (K,) labels, in the order of the columns of scores and probabilities.
    stumps_ : the `Stumps`, `n_rounds_` rounds of K.
    losses_ : (n_rounds_ + 1,) mean of -ln P(true class) on the training rows before and after every round.
    stopped_early_ : whether `tolerance` ended the training.

    `sample_weight` counts a row that many times, in the stumps and in the losses; 0 removes it.
    Source: Friedman, Hastie, Tibshirani, Annals of Statistics 28 (2000), algorithm 6; docs/weka-parity.md.
    """

    def __init__(
        self,
        rounds: int = 100,
        shrinkage: float = 1.0,
        z_max: float = 3.0,
        tolerance: float | None = None,
        classes: Sequence[Any] | None = None,
    ) -> None:
        self.rounds = rounds
        self.shrinkage = shrinkage
        self.z_max = z_max
        self.tolerance = tolerance
        self.classes = classes

    def fit(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> Self:
        """Train on X (n, d) and labels y (n,). Raises ValueError saying what does not fit."""
        inputs, targets = validate_data(self, X, y, ensure_all_finite="allow-nan", dtype=_kept_dtypes(X))
        check_classification_targets(targets)
        weights = None
        if sample_weight is not None:
            weights = _check_sample_weight(sample_weight, inputs, dtype=np.float64, ensure_non_negative=True)
        self.classes_ = np.unique(targets) if self.classes is None else np.asarray(self.classes)
        labels = self._index(targets)
        if weights is not None:
            # A row of no weight is a row that is not there: its values make no thresholds (in Weka they do).
            kept = weights > 0
            inputs, labels, weights = inputs[kept], labels[kept], weights[kept]
        self.stumps_, history = boost(
            inputs,
            labels,
            len(self.classes_),
            rounds=self.rounds,
            shrinkage=self.shrinkage,
            z_max=self.z_max,
            tolerance=self.tolerance,
            weights=weights,
        )
        self.n_rounds_ = self.stumps_.n_rounds
        self.losses_ = np.array(history.losses)
        self.stopped_early_ = history.stopped_early
        return self

    def scores(self, X: ArrayLike) -> Floats:
        """Return the additive scores F (n, K); the class of the largest is the answer, its lowest number at a tie."""
        inputs = self._inputs(X)
        return self.stumps_.scores(inputs)

    def staged_scores(self, X: ArrayLike) -> Iterator[Floats]:
        """Yield the scores (n, K) after 1, 2, ... rounds: one training serves every number of rounds."""
        inputs = self._inputs(X)
        return self.stumps_.staged_scores(inputs)

    def predict_proba(self, X: ArrayLike) -> Floats:
        """Return class probabilities (n, K), columns as in `classes_`."""
        return np.ascontiguousarray(softmax(np.ascontiguousarray(self.scores(X).T)).T)

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """Return the label (n,) of the largest score."""
        best = winners(self.scores(X))
        labels: NDArray[Any] = self.classes_[best]
        return labels

    def __sklearn_tags__(self) -> Tags:
        """Tell scikit-learn that NaN is welcome."""
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags

    def _inputs(self, X: ArrayLike) -> NDArray[Any]:
        check_is_fitted(self)
        inputs: NDArray[Any] = validate_data(self, X, reset=False, ensure_all_finite="allow-nan", dtype=_kept_dtypes(X))
        return inputs

    def _index(self, targets: NDArray[Any]) -> NDArray[np.intp]:
        matches = targets[:, np.newaxis] == self.classes_
        if not matches.any(axis=1).all():
            strange = targets[~matches.any(axis=1)][0]
            raise BoostingError(
                f"label {str(strange)!r} of y is not among the declared classes {self.classes_.tolist()}"
            )
        found: NDArray[np.intp] = matches.argmax(axis=1)
        return found


def _kept_dtypes(X: ArrayLike) -> str | list[type]:
    """Bits and integer codes stay what they are; all else becomes float64, on which thresholds are computed."""
    kind = getattr(getattr(X, "dtype", None), "kind", "")
    return "numeric" if kind in ("b", "i", "u") else [np.float64]
