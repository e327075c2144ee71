"""How lucky the best of many is: bootstrap bias correction of cross-validation, without another training.

Trials (of subjects who are left out: whole subjects) are drawn with replacement. Of all that was tried, the best of
those that were drawn is judged by those that were not; the mean over the draws is what the best of so many is worth
(I. Tsamardinos, E. Greasidou and G. Borboudakis 2018, Machine Learning 107: 1895).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DRAWS = 1000
# Of up to so many units every draw is taken once, in place of random ones.
_FEW = 4
# Units of which sums are made at a time.
_BLOCK = 2048


@dataclass(frozen=True, slots=True, eq=False)
class Draws:
    """The rates of c contenders in b draws of u units (trials or subjects).

    drawn, left  (b, c)  over the units that were drawn, and over those that were not
    whole        (c,)    over all
    """

    drawn: Floats
    left: Floats
    whole: Floats

    @classmethod
    def of(cls, hits: NDArray[np.intp], units: NDArray[np.intp], most: int, seed: int) -> "Draws":
        """Return those of hits (c, m), each 0 to `most`, of m trials that belong to `units` (m,)."""
        units = np.unique(units, return_inverse=True)[1]
        sizes = np.bincount(units).astype(np.float64) * most
        counts = _counts(len(sizes), seed)
        sums = np.zeros((2, len(counts), len(hits)))
        for start in range(0, len(sizes), _BLOCK):
            block = slice(start, start + _BLOCK)
            # Whole numbers below 2^53: the sums are exact in any order.
            own = np.array([np.bincount(units, each, len(sizes))[block] for each in hits]).T
            sums[0] += counts[:, block].astype(np.float64) @ own
            sums[1] += (counts[:, block] == 0).astype(np.float64) @ own
        drawn, left = counts @ sizes, (counts == 0) @ sizes
        told = left > 0
        whole = hits.sum(axis=1) / sizes.sum()
        return cls(sums[0, told] / drawn[told, None], sums[1, told] / left[told, None], whole)

    def luck(self, costs: Floats, limits: Sequence[float]) -> list[float]:
        """Return, for each limit, how much the best of the contenders (c,) that cost less is overestimated.

        Of equally good ones the cheapest counts.
        """
        order = np.argsort(costs, kind="stable")
        drawn, left, whole = self.drawn[:, order], self.left[:, order], self.whole[order]
        found = []
        for size in np.searchsorted(costs[order], limits).tolist():
            best = drawn[:, :size].argmax(axis=1)
            worth = float(left[np.arange(len(left)), best].mean())
            found.append(max(float(whole[:size].max()) - worth, 0.0))
        return found


def _counts(units: int, seed: int) -> NDArray[np.uint16]:
    """Return how often each unit (u,) is drawn, (b, u)."""
    if units <= _FEW:
        drawn = np.indices((units,) * units).reshape(units, -1).T
    else:
        drawn = np.random.default_rng(seed).integers(units, size=(DRAWS, units))
    return np.array([np.bincount(each, minlength=units) for each in drawn]).astype(np.uint16)
