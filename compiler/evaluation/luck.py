"""How lucky the best of many is: bootstrap bias correction of cross-validation, without another training.

Units (trials, or subjects) are drawn with replacement. Of all that was tried, the best by the units that were drawn is
judged by those that were not (BBC-CV: Tsamardinos, Greasidou and Borboudakis 2018, Machine Learning 107: 1895). How
much worse it does there than the one that is best by all units, in the mean over the draws, is the luck of that one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DRAWS = 1000
# Of up to so many units every draw is taken once, in place of random ones.
_FEW = 4
# Units whose hits are summed at a time.
_BLOCK = 2048


@dataclass(frozen=True, slots=True, eq=False)
class Draws:
    """The rates of c contenders over the units of b draws, (b, c), over those left, (b, c), and over all, (c,)."""

    drawn: Floats
    left: Floats
    every: Floats

    @classmethod
    def of(cls, hits: NDArray[np.intp], units: NDArray[np.intp], seed: int) -> "Draws":
        """Return those of `hits` (c, m): how often each of m trials was recognised; `units` (m,) are what is drawn."""
        units = np.unique(units, return_inverse=True)[1]
        sizes = np.bincount(units)
        counts = _counts(len(sizes), seed)
        sums = np.zeros((2, len(counts), len(hits)))
        own = np.array([np.bincount(units, each) for each in hits]).T
        for start in range(0, len(sizes), _BLOCK):
            block = slice(start, start + _BLOCK)
            # Whole numbers below 2^53: the sums are exact in any order.
            sums[0] += counts[:, block].astype(np.float64) @ own[block]
            sums[1] += (counts[:, block] == 0).astype(np.float64) @ own[block]
        drawn, left = counts @ sizes, (counts == 0) @ sizes
        judged = left > 0
        return cls(sums[0, judged] / drawn[judged, None], sums[1, judged] / left[judged, None], own.sum(axis=0))

    def luck(self, costs: Floats, limits: Sequence[float]) -> list[float]:
        """Return, for each limit, the luck of the best contender (c,) that costs less; of equals the cheapest."""
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
