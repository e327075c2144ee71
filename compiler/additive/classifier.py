"""The additive multinomial logit as a scikit-learn estimator."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..boosting.classifier import AdditiveClassifier, Floats
from .logit import BINS, PENALTY, SMOOTHNESS, TOLERANCE, fit_logit


class AdditiveLogitClassifier(AdditiveClassifier):
    """Multinomial logistic regression on a table of scores for each input.

    Inputs are bits, integer codes or floating-point numbers, X (n, d). One that takes two values adds a row of scores
    at the upper one, any other a row for the bin that it lies in. NaN is a missing value: it has a row of its own where
    the training set has any, and else adds the mean. What is minimised is convex, so that there is one answer. It is
    what the trainer `logit` fits, and `compile` makes a build of a fitted one.

    Parameters
    ----------
    penalty : float, default=0.5
        Pull of scores towards zero: half of it times the sum of their squares is added to the loss; of bins a
        sixteenth of that, of the bias a thousandth.
    smoothness : float, default=2.0
        Pull of neighbouring bins towards each other: half of it times the sum of squares of their differences is added.
    max_bins : int, optional, default=16
        No input has more bins than this (2 or more); they hold rows as evenly as can be. None: one for each value.
    linear : bool, default=False
        An input of more than two values adds scores in proportion to it instead, between the least and the largest of
        the training set; `smoothness` then pulls what a standard deviation of it adds.
    tolerance : float, default=1e-7
        No derivative of the loss is larger than this at the answer, in the weight of all rows; at least 1e-12.
    classes : sequence, optional
        Labels that exist even where y lacks some of them (a fold without a rare class). None: those in y.

    Attributes
    ----------
    classes_ : ndarray, shape (K,)
        The labels, in the order of the columns of scores and probabilities.
    tables_ : ColumnTables
        The rows of scores: `bias` (K,), for each column its `edges` and `rows`, the last one for a missing value, and
        `lines` of some columns.

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
