"""The strong rivals that our placements are held beside: what a practitioner would take from scikit-learn or PySensors.

Each learns from the switches alone (joint codes are ignored), does the expensive work once, and then answers any number
of switches, fewer being the first of more. Switches that never change are never chosen; where fewer vary than are asked
for, fewer are returned. What scikit-learn, SciPy and PySensors answer rests on the linear algebra of the machine: on
another machine near ties may fall otherwise.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.util import find_spec
from itertools import islice
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from ..samples import Columns, Samples
from .mrmr import mrmr
from .rivals import cmim_order, random_placement, top_mutual_information
from .sparse_sensing import qr_order, sspoc_order

Choose = Callable[[float], Columns]
Bits = NDArray[np.bool_]
Labels = NDArray[np.intp]

_SEED = 0
_TREES = 300
# scikit-learn's default of 100 ends some fits with a warning that they have not converged. With its own tolerance,
# a tenth of this one, elimination takes twice as long and the switches that it leaves recognise no better.
_ITERATIONS, _TOLERANCE = 2000, 1e-3


def _ranked(rank: Callable[[Bits, Labels], Iterable[int]]) -> Callable[[Samples], Choose]:
    """Return the chooser of a method that ranks switches (n, s), all of which vary, best one first.

    What is ranked one at a time is ranked as far as is asked for.
    """

    def chooser(learning: Samples) -> Choose:
        from threadpoolctl import threadpool_limits

        bits, labels = learning.switches, learning.labels
        varying = np.flatnonzero(bits.any(axis=0) & ~bits.all(axis=0))
        order: list[int] = []
        ranked: Iterator[int] = iter(())
        if varying.size and np.ptp(labels):
            # The matrices are small: threads would wait for each other longer than they work.
            with threadpool_limits(1):
                ranked = iter(rank(bits[:, varying], labels))

        def choose(m: float) -> Columns:
            most = min(max(int(m), 0), len(varying))
            if most > len(order):
                with threadpool_limits(1):
                    order.extend(int(varying[column]) for column in islice(ranked, most - len(order)))
            return tuple(order[:most])

        return choose

    return chooser


def _elimination_by_regression(bits: Bits, labels: Labels) -> Columns:
    """Return the switches in the reverse of the order in which recursive elimination drops them, one at a time."""
    from scipy.sparse import csr_matrix
    from sklearn.feature_selection import RFE
    from sklearn.linear_model import LogisticRegression

    # Few switches are closed at a time: sparse rows give the same model, in a fraction of the time.
    elimination = RFE(LogisticRegression(max_iter=_ITERATIONS, tol=_TOLERANCE), n_features_to_select=1, step=1)
    elimination.fit(csr_matrix(bits, dtype=np.float64), labels)
    return tuple(np.argsort(elimination.ranking_, kind="stable").tolist())


def _forest_importance(bits: Bits, labels: Labels) -> Columns:
    """Return the switches by their mean decrease of impurity in a random forest."""
    from sklearn.ensemble import RandomForestClassifier

    forest = RandomForestClassifier(_TREES, random_state=_SEED, n_jobs=1).fit(bits, labels)
    return tuple(np.argsort(-forest.feature_importances_, kind="stable").tolist())


def _mutual_information(bits: Bits, labels: Labels) -> Columns:
    return top_mutual_information(bits, labels, bits.shape[1])


def _random(bits: Bits, labels: Labels) -> Columns:
    return random_placement(bits.shape[1], bits.shape[1], _SEED)


RIVALS: Mapping[str, tuple[str, Callable[[Samples], Choose]]] = MappingProxyType(
    {
        "rfe": (
            "Recursive elimination by logistic regression (scikit-learn), one switch at a time",
            _ranked(_elimination_by_regression),
        ),
        "forest": (f"Importance in a random forest of {_TREES} trees (scikit-learn)", _ranked(_forest_importance)),
        "mrmr": ("Greedy: most relevant to the grasp type, least redundant (mRMR)", _ranked(mrmr)),
        "cmim": ("Greedy by conditional mutual information (CMIM)", _ranked(cmim_order)),
        "mutual-information": ("Those that each tell most about the grasp type, alone", _ranked(_mutual_information)),
        "random": ("Drawn at random (seeded) among those that vary", _ranked(_random)),
        "sspoc": ("Sparse sensors for classification (PySensors' SSPOC)", _ranked(sspoc_order)),
        "qr": ("Sensors for reconstruction by pivoted QR (PySensors), without labels", _ranked(qr_order)),
    }
)

_OF_PYSENSORS = ("sspoc", "qr")


def available() -> tuple[str, ...]:
    """Return the names of the rivals that can be asked here: PySensors' two only where it is installed."""
    installed = find_spec("pysensors") is not None
    return tuple(name for name in RIVALS if installed or name not in _OF_PYSENSORS)
