"""The additive multinomial logit as a scikit-learn estimator."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..boosting.classifier import AdditiveClassifier, Floats
from .logit import BINS, PENALTY, SMOOTHNESS, TOLERANCE, fit_logit


class AdditiveLogitClassifier(AdditiveClassifier):
    """Multinomial logistic regression on a table of scores for each input.

    Inputs are bits, integer codes or floating-point numbers, X (n, d). An input of two values adds a row of scores at
    the upper one; any other adds the row of its bin. NaN is a missing value: it has a separate row where the training
    set has any, and adds the mean otherwise. The objective is convex, so the solution is unique. The trainer `logit`
    fits the same model, and `compile` makes a build of a fitted classifier.

    Parameters
    ----------
    penalty : float, default=0.5
        Pull of scores towards zero: half of it times the sum of their squares is added to the loss. Bins have a
        sixteenth of this pull, the bias a thousandth.
    smoothness : float, default=2.0
        Pull of neighbouring bins towards each other: half of it times the sum of squares of their differences is added.
    max_bins : int, optional, default=16
        The most bins per input (2 or more); they hold rows as evenly as possible. None: one for each value.
    linear : bool, default=False
        Inputs of more than two values add scores in proportion to them instead, between their minimum and maximum in
        the training set; `smoothness` then pulls the contribution of one standard deviation.
    tolerance : float, default=1e-7
        No derivative of the loss is larger than this at the solution, relative to the total weight; at least 1e-12.
    classes : sequence, optional
        All labels, if y may lack some of them (a fold without a rare class). None: those in y.

    Attributes
    ----------
    classes_ : ndarray, shape (K,)
        The labels, in the order of the columns of scores and probabilities.
    tables_ : ColumnTables
        The rows of scores: `bias` (K,); for each column its `edges` and `rows`, the last row for a missing value; and
        the `lines` of some columns.

    Examples
    --------
    >>> from thenar.compiler import AdditiveLogitClassifier
    >>> X, y = [[0, 10], [0, 200], [1, 30], [1, 220]], ["tip", "power", "tip", "power"]
    >>> classifier = AdditiveLogitClassifier().fit(X, y)
    >>> classifier.predict([[0, 20], [0, 215]]).tolist()
    ['tip', 'power']
    """

    def __init__(
        self,
        penalty: float = PENALTY,
        smoothness: float = SMOOTHNESS,
        max_bins: int | None = BINS,
        linear: bool = False,
        tolerance: float = TOLERANCE,
        classes: Sequence[Any] | None = None,
    ) -> None:
        self.penalty = penalty
        self.smoothness = smoothness
        self.max_bins = max_bins
        self.linear = linear
        self.tolerance = tolerance
        self.classes = classes

    def _learn(
        self,
        inputs: NDArray[Any],
        labels: NDArray[np.intp],
        weights: Floats | None,
        progress: Callable[[int, int], None] | None,
    ) -> None:
        self.tables_ = fit_logit(
            inputs,
            labels,
            len(self.classes_),
            penalty=self.penalty,
            smoothness=self.smoothness,
            max_bins=self.max_bins,
            linear=self.linear,
            tolerance=self.tolerance,
            weights=weights,
        )

    def _sums(self, inputs: NDArray[Any]) -> Floats:
        return self.tables_.scores(inputs)
