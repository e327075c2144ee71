"""Baseline classifiers from scikit-learn, to compare with the trainers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..samples import Samples

if TYPE_CHECKING:
    from sklearn.base import ClassifierMixin


@dataclass(frozen=True, slots=True)
class Classifier:
    """A classifier on standardised inputs: its description, and a function that creates it."""

    what: str
    make: "Callable[[], ClassifierMixin]"

    def predict(self, learning: Samples, X: NDArray[np.generic]) -> NDArray[np.intp]:
        """Return the class numbers predicted for rows X (n, s + j) after training on `learning`."""
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler

        # scikit-learn's classifiers cannot be fitted to a single class.
        if (learning.labels == learning.labels[0]).all():
            return np.full(len(X), learning.labels[0])
        made = make_pipeline(StandardScaler(), self.make()).fit(learning.inputs.astype(np.float64), learning.labels)
        return np.asarray(made.predict(X.astype(np.float64)), dtype=np.intp)


def _logistic() -> "ClassifierMixin":
    from sklearn.linear_model import LogisticRegression

    return LogisticRegression(max_iter=10_000)


def _neighbours() -> "ClassifierMixin":
    from sklearn.neighbors import KNeighborsClassifier

    return KNeighborsClassifier(5, weights="distance")


CLASSIFIERS: Mapping[str, Classifier] = MappingProxyType(
    {
        "logistic-regression": Classifier("scikit-learn's, with its own settings", _logistic),
        "5-nearest-neighbours": Classifier("scikit-learn's, weighted by distance", _neighbours),
    }
)
