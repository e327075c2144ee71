"""Backward elimination: the switch whose row of the score tables is missed least goes, again and again.

The tables are those that boosting heads for (`logistic`), of all switches that are left and of the joints. While many
switches are left, the few whose rows cost least to replace by their means go at once; of the last FINE, one goes at a
time, and the likeliest CANDIDATES for it are tried: the tables are fitted on without each, since the others may stand
in for it. Of equally likely ones the lowest number goes, of equally good candidates the likeliest.

With the times of ports, a rise is held against what the port takes, shared out over those of its switches that are
left: the last one of a port pays for all of it.
"""

import numpy as np
from numpy.typing import NDArray

from ..samples import Columns, Samples
from .costaware import PortCosts
from .indicators import sampled, thermometer
from .logistic import Logistic
from .removal import removal_rises

Floats = NDArray[np.float64]

FINE = 40
CANDIDATES = 6
# Of the switches that are left, how many go at once while they are many.
SHARE = 0.05
# Steps of L-BFGS: at first, for a candidate, and after a removal.
FIRST_STEPS, TRIAL_STEPS, STEPS = 60, 3, 5
# What the mean time of a port counts, where a switch itself counts 1.
PORT_WEIGHT = 16.0


def elimination_order(learning: Samples, ports: PortCosts | None = None) -> Columns:
    """Return the switches that vary in `learning`, the last one to go first: any m are the m first.

    The joints' codes, where there are any, are always kept. `ports` tells of all switches of `learning`. Takes the time
    of some 1500 evaluations of the tables for 160 switches, whatever they are; of many rows, a sample is looked at.
    """
    return _Elimination(sampled(learning), ports).order()


class _Elimination:
    def __init__(self, learning: Samples, ports: PortCosts | None) -> None:
        bits = learning.switches.T
        self._left: list[int] = np.flatnonzero(bits.any(axis=1) & ~bits.all(axis=1)).tolist()
        self._bits = np.ascontiguousarray(bits[self._left])
        self._labels, self._ports = learning.labels, ports
        self._gone: list[int] = []
        columns = np.concatenate([self._bits, thermometer(learning.codes)])
        self._fit = Logistic(columns, learning.labels, learning.n_classes)

    def order(self) -> Columns:
        if len(self._left) > 1:
            self._fit.improve(FIRST_STEPS)
        while len(self._left) > 1:
            rises = removal_rises(self._fit.probability, self._bits, self._fit.rows[: len(self._left)], self._labels)
            likeliest = np.argsort(rises / self._costs(), kind="stable").tolist()
            if len(self._left) > FINE:
                worst = likeliest[: max(1, int(SHARE * len(self._left)))]
                self._fit = self._fit.without(worst)
                self._fit.improve(STEPS)
            else:
                worst = [self._try(likeliest[:CANDIDATES])]
            self._drop(worst)
        return tuple(self._left + self._gone[::-1])

    def _try(self, candidates: list[int]) -> int:
        """Go on without the candidate (a position) whose absence, once the others stand in for it, costs least."""
        fits = [self._fit.without([position]) for position in candidates]
        for fit in fits:
            fit.improve(TRIAL_STEPS)
        costs = self._costs()
        rises = [(fit.loss - self._fit.loss) / costs[p] for fit, p in zip(fits, candidates, strict=True)]
        best = rises.index(min(rises))
        self._fit = fits[best]
        self._fit.improve(STEPS - TRIAL_STEPS)
        return candidates[best]

    def _drop(self, positions: list[int]) -> None:
        self._gone += [self._left[position] for position in positions]
        self._left = [column for position, column in enumerate(self._left) if position not in set(positions)]
        self._bits = np.delete(self._bits, positions, axis=0)

    def _costs(self) -> Floats:
        """Return what each switch that is left costs; only how they compare matters."""
        if self._ports is None:
            return np.ones(len(self._left))
        return 1.0 + PORT_WEIGHT * self._ports.shares(self._left)
