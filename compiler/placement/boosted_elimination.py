"""Backward elimination on the boosted tables themselves: the switch whose removal costs least goes, again and again.

LogitBoost learns from all switches that are left, and the joints' codes; its stumps collapse to one row of scores a
switch. What a removal costs is by how much the loss rises where the switch's row is replaced by its mean contribution.
Those that cost least go, SHARE of them at once while many are left; boosting then starts anew. Of equally cheap ones
the lowest number goes first. `elimination` is the same idea on tables that are fitted whole.
"""

import numpy as np
from numpy.typing import NDArray

from ..boosting.boost import boost
from ..elementary import softmax
from ..samples import Columns, Samples
from ..tables.collapse import collapse
from .indicators import BINS, sampled
from .removal import Floats, removal_rises

ROUNDS = 40
SHARE = 0.12


def boosted_elimination_order(learning: Samples) -> Columns:
    """Return the switches that vary in `learning`, the last one to go first: any m are the m first.

    The joints' codes, where there are any, are always kept. Trains some 35 ensembles for 160 switches; of many rows, a
    sample is looked at.
    """
    rows = sampled(learning)
    varying = rows.switches.any(axis=0) & ~rows.switches.all(axis=0)
    left: NDArray[np.intp] = np.flatnonzero(varying)
    gone: list[int] = []
    while len(left) > 1:
        cheapest = np.argsort(_costs(rows, left), kind="stable")[: max(1, int(SHARE * len(left)))]
        gone += left[cheapest].tolist()
        left = np.delete(left, cheapest)
    return tuple(left.tolist() + gone[::-1])


def _costs(learning: Samples, left: NDArray[np.intp]) -> Floats:
    """Return (len(left),) by how much the loss rises without each of the switches `left`."""
    bits = learning.switches[:, left]
    X = np.hstack([bits.astype(np.uint16), learning.codes])
    stumps, _ = boost(X, learning.labels, learning.n_classes, rounds=ROUNDS, max_bins=BINS)
    tables = collapse(stumps, len(left))
    probability = softmax(np.ascontiguousarray(stumps.scores(X).T))
    return removal_rises(probability, np.ascontiguousarray(bits.T), tables.switch_rows, learning.labels)
