"""Switches that are never, or always, on: against how often they were in the recordings that the build was trained on.

The tables remember that share: a switch's mean row is its row times the share of the recordings in which it was on. A
grasp that is held is one observation, however many frames it lasts. If a switch is on in a share p of grasps, it stays
off throughout n of them with a probability of at most (1 - p)^n, and on with at most p^n, given that grasps come as
they did in the recordings. Because people also repeat one grasp for long, a switch is only suspected once half of the
grasp types were seen since it was last found otherwise.
"""

import math
from collections.abc import Sequence

import numpy as np

from ..tables import IntegerTables
from .frames import Mask

# How improbable what was seen must be of a switch that works.
ALARM = 1e-4
_SURE = 1 - 1e-12


def on_shares(tables: IntegerTables) -> list[float]:
    """Return, for every switch, the share of the recordings in which it was on; nan where its row is all zeros."""
    rows, means = tables.switch_rows.astype(np.float64), tables.switch_means.astype(np.float64)
    weight = (rows * rows).sum(axis=1)
    shares = np.divide((rows * means).sum(axis=1), weight, out=np.full(len(rows), np.nan), where=weight > 0)
    found: list[float] = np.clip(shares, 0.0, 1.0).tolist()
    return found


def patience(share: float) -> float:
    """Return after how many grasps in which it does not happen, what happens in `share` of them is missed."""
    if math.isnan(share) or share <= 0:
        return math.inf
    return math.ceil(math.log(ALARM) / math.log1p(-min(share, _SURE)))


class Missed:
    """Counts, for every switch, the grasps since something was last seen of it: that it was on, or that it was off."""

    def __init__(self, shares: Sequence[float], classes: int) -> None:
        self._patience = [patience(share) for share in shares]
        self._enough = classes / 2
        self._grasps = [0] * len(shares)
        self._types = [0] * len(shares)
        self._seen: Mask = 0

    def see(self, switches: Mask) -> None:
        """Note that it was seen of `switches`, in the grasp that is held now."""
        self._seen |= switches

    def end_grasp(self, number: int, read: Mask) -> None:
        """Count a grasp of type `number` that is over; `read` are the switches that were read during it."""
        for switch in range(len(self._grasps)):
            if self._seen >> switch & 1:
                self._grasps[switch] = self._types[switch] = 0
            elif read >> switch & 1:
                self._grasps[switch] += 1
                self._types[switch] |= 1 << number
        self._seen = 0

    def suspects(self) -> list[int]:
        """Return the switches of which it should have been seen by now."""
        return [
            switch
            for switch, (grasps, types) in enumerate(zip(self._grasps, self._types, strict=True))
            if grasps >= self._patience[switch] and types.bit_count() >= self._enough
        ]


class StuckSwitches:
    """Both kinds of being stuck."""

    def __init__(self, tables: IntegerTables) -> None:
        shares = on_shares(tables)
        self._on = Missed(shares, tables.n_classes)
        self._off = Missed([1 - share for share in shares], tables.n_classes)
        self._read: Mask = 0

    def frame(self, closed: Mask, read: Mask) -> None:
        """Take a frame in which the switches `read` were read."""
        self._read |= read
        self._on.see(closed & read)
        self._off.see(~closed & read)

    def end_grasp(self, number: int | None) -> None:
        """End a grasp of type `number`; None: it was none, and what was seen meanwhile counts for the next."""
        if number is not None:
            self._on.end_grasp(number, self._read)
            self._off.end_grasp(number, self._read)
            self._read = 0

    def open(self) -> list[int]:
        """Return the switches that are suspected never to close."""
        return self._on.suspects()

    def closed(self) -> list[int]:
        """Return the switches that are suspected never to open."""
        return self._off.suspects()
