"""Common choices from scikit-learn: recursive elimination, and importance in a random forest."""

import numpy as np

from ...samples import Columns
from .base import Bits, Labels, Method, ranked

_SEED = 0
_TREES = 300
# With scikit-learn's default of 100 some fits end with a convergence warning. With its default tolerance, a tenth of
# this one, elimination takes twice as long and the remaining switches are no more accurate.
_ITERATIONS, _TOLERANCE = 2000, 1e-3


def _elimination_by_regression(bits: Bits, labels: Labels) -> Columns:
    """Return the switches in the reverse order of recursive elimination, which drops one at a time."""
    from scipy.sparse import csr_matrix
    from sklearn.feature_selection import RFE
    from sklearn.linear_model import LogisticRegression

    # Few switches are closed at a time: sparse rows give the same model in a fraction of the time.
    elimination = RFE(LogisticRegression(max_iter=_ITERATIONS, tol=_TOLERANCE), n_features_to_select=1, step=1)
    elimination.fit(csr_matrix(bits, dtype=np.float64), labels)
    return tuple(np.argsort(elimination.ranking_, kind="stable").tolist())


def _forest_importance(bits: Bits, labels: Labels) -> Columns:
    """Return the switches by their mean decrease of impurity in a random forest."""
    from sklearn.ensemble import RandomForestClassifier

    forest = RandomForestClassifier(_TREES, random_state=_SEED, n_jobs=1).fit(bits, labels)
    return tuple(np.argsort(-forest.feature_importances_, kind="stable").tolist())


MEMBER = (
    Method(
        name="rfe",
        help="Recursive elimination by logistic regression (scikit-learn), one switch at a time",
        learn=ranked(_elimination_by_regression),
        nested=True,
        tried="always",
        rank=20,
    ),
    Method(
        name="forest",
        help=f"Importance in a random forest of {_TREES} trees (scikit-learn)",
        learn=ranked(_forest_importance),
        nested=True,
        tried="always",
        rank=21,
    ),
)
