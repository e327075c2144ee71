"""How well one placement serves many subjects: on the mean, and the tenth that it serves worst."""

from dataclasses import dataclass, replace
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from ..boosting.boost import boost
from ..boosting.stumps import winners
from ..samples import Columns, Samples

Numbers = NDArray[np.intp]
# What a standard placement is bettered for: nothing, the mean over subjects, or those that are served worst.
Aim = Literal["plain", "mean", "worst tenth"]

WORST_SHARE = 0.1


class Served(msgspec.Struct, frozen=True):
    """Recognition rates, 0..1, of subjects that nothing was learnt from: the mean over them, the mean of the tenth of
    them (at least one) with the lowest rates, and the lowest.
    """

    mean: float
    worst_tenth: float
    lowest: float

    @property
    def worth(self) -> float:
        """Return what standard placements are compared by: the mean and the worst tenth, in equal parts."""
        return (self.mean + self.worst_tenth) / 2


@dataclass(frozen=True, slots=True, eq=False)
class Crowd:
    """Rows of many subjects: `learning` of n rows, and whose each row is, subjects (n,) intp."""

    learning: Samples
    subjects: Numbers

    def of(self, subjects: Numbers) -> "Crowd":
        """Return the rows of some subjects."""
        return self._rows(np.flatnonzero(np.isin(self.subjects, subjects)))

    def drawn(self, rows: int, seed: int) -> "Crowd":
        """Return about so many rows, equally many of every subject, drawn with `seed`; all where there are no more."""
        there = np.unique(self.subjects)
        if rows >= len(self.subjects):
            return self
        each = max(rows // len(there), 1)
        random = np.random.default_rng(seed)
        own = (random.permutation(np.flatnonzero(self.subjects == subject))[:each] for subject in there)
        return self._rows(np.sort(np.concatenate(list(own))))

    def _rows(self, rows: Numbers) -> "Crowd":
        return replace(self, learning=self.learning.rows(rows), subjects=self.subjects[rows])


def rates(learnt: Crowd, asked: Crowd, columns: Columns, rounds: int) -> NDArray[np.float64]:
    """Return the recognition rate of every subject of `asked`, in the order of their numbers.

    LogitBoost of so many rounds learns the switches `columns`, and the joints if there are any, from `learnt`.
    """
    stumps, _ = boost(_inputs(learnt, columns), learnt.learning.labels, learnt.learning.n_classes, rounds=rounds)
    right = winners(stumps.scores(_inputs(asked, columns))) == asked.learning.labels
    numbers = np.unique(asked.subjects, return_inverse=True)[1]
    return np.asarray(np.bincount(numbers, right) / np.bincount(numbers), dtype=np.float64)


def served(rates: NDArray[np.float64]) -> Served:
    """Return how the subjects of these rates (n,) are served."""
    ordered = np.sort(rates)
    worst = ordered[: max(round(WORST_SHARE * len(ordered)), 1)]
    return Served(float(rates.mean()), float(worst.mean()), float(ordered[0]))


def _inputs(crowd: Crowd, columns: Columns) -> NDArray[np.uint16]:
    learning = crowd.learning
    return np.hstack([learning.switches[:, list(columns)].astype(np.uint16), learning.codes])
