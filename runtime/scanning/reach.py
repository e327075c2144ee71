"""How far switches that were not read could still carry a grasp type past another.

A switch adds nothing when open, its row when closed, its mean row when lost. So against a leader l, an unread switch s
can bring class r at most  max(0, row_sr - row_sl, mean_sr - mean_sl)  closer, and several switches at most the sum of
these: each is free to do its worst. For one rival that sum is reached, by some state of the switches; so it is not only
a bound, but the most there is.
"""

from functools import lru_cache

import numpy as np

from ..live.frames import Mask
from ..tables import IntegerTables

# Of how many classes answers are kept, over all answers: some 2 MB.
_KEPT = 1 << 16


class Reach:
    """Answers, kept for the leaders and the sets of unread switches that come again and again."""

    def __init__(self, tables: IntegerTables) -> None:
        self._rows = tables.switch_rows.astype(np.int64)
        self._means = tables.switch_means.astype(np.int64)
        self.of = lru_cache(maxsize=_KEPT // tables.n_classes)(self._of)

    def _of(self, leader: int, unread: Mask) -> tuple[int, ...]:
        """Return, for every class (K,), the most steps by which the switches `unread` can bring it closer to `leader`.

        The leader's own is 0.
        """
        numbers = [number for number in range(len(self._rows)) if unread >> number & 1]
        closed, lost = (rows - rows[:, leader, np.newaxis] for rows in (self._rows[numbers], self._means[numbers]))
        found: list[int] = np.maximum(0, np.maximum(closed, lost)).sum(axis=0).tolist()
        return tuple(found)
