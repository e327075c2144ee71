"""The optimism of picking the best of many: bootstrap bias correction of cross-validation, without retraining.

Units (trials, or subjects) are drawn with replacement. The contender that is best on the drawn units is evaluated on
the others (BBC-CV: Tsamardinos, Greasidou and Borboudakis 2018, Machine Learning 107: 1895). Its mean loss of accuracy
over the draws, compared with the accuracy of the overall best on all units, is the luck of that one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DRAWS = 1000
# For up to this many units, every possible draw is used once instead of random draws.
_FEW = 4
# Units whose hits are summed at a time.
_BLOCK = 2048


@dataclass(frozen=True, slots=True, eq=False)
class Draws:
    """The accuracies of c contenders on the drawn units of b draws, (b, c), on the others, (b, c), and on all, (c,)."""

    drawn: Floats
    left: Floats
    every: Floats

    @classmethod
    def of(cls, hits: NDArray[np.intp], units: NDArray[np.intp], seed: int) -> "Draws":
        """Return the draws for `hits` (c, m), the correct predictions for each of m trials; `units` (m,) are drawn."""
        units = np.unique(units, return_inverse=True)[1]
        sizes = np.bincount(units)
        counts = _counts(len(sizes), seed)
        sums = np.zeros((2, len(counts), len(hits)))
        own = np.array([np.bincount(units, each) for each in hits]).T
        for start in range(0, len(sizes), _BLOCK):
            block = slice(start, start + _BLOCK)
            # Integers below 2^53: the sums are exact in any order.
            sums[0] += counts[:, block].astype(np.float64) @ own[block]
            sums[1] += (counts[:, block] == 0).astype(np.float64) @ own[block]
        drawn, left = counts @ sizes, (counts == 0) @ sizes
        judged = left > 0
        return cls(sums[0, judged] / drawn[judged, None], sums[1, judged] / left[judged, None], own.sum(axis=0))

    def luck(self, costs: Floats, limits: Sequence[float]) -> list[float]:
        """Return, for each limit, the luck of the best contender (c,) with a lower cost; ties go to the cheapest."""
        order = np.argsort(costs, kind="stable")
        drawn, left, every = self.drawn[:, order], self.left[:, order], self.every[order]
        found = []
        for size in np.searchsorted(costs[order], limits).tolist():
            best, draws = every[:size].argmax(), np.arange(len(drawn))
            found.append(max(float((left[:, best] - left[draws, drawn[:, :size].argmax(axis=1)]).mean()), 0.0))
        return found


def _counts(units: int, seed: int) -> NDArray[np.int32]:
    """Return how often each unit (u,) is drawn, (b, u)."""
    if units <= _FEW:
        drawn = np.indices((units,) * units).reshape(units, -1).T
    else:
        drawn = np.random.default_rng(seed).integers(units, size=(DRAWS, units))
    return np.array([np.bincount(each, minlength=units) for each in drawn], np.int32)
