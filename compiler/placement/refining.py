"""A placement bettered for many subjects: switches at its edge exchanged for those that serve other subjects better.

What a method chooses last, and what it would choose next, it can hardly tell apart from the rows it looks at: another
draw of rows chooses others. So these are exchanged, one by one, as long as half of the subjects then recognise the
other half better: on the mean over subjects, or over the tenth that is served worst.

Weights in place of exchanges (the worst-served tenth counted more, every subject by how badly it is served) gained no
more than another draw of rows did.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..samples import Columns
from .serving import Aim, Crowd, rates, served

# So many of the switches chosen last, and of those chosen next, may change places, in so many exchanges at most.
REACH, EXCHANGES = 4, 2
# With fewer subjects nothing is exchanged: the worst tenth is a handful, and with 10 to 40 of the 200 what exchanges
# won within them was lost on others more often than not.
ENOUGH_SUBJECTS = 80
_ASKED_OF_EACH = 50


@dataclass(slots=True)
class Refining:
    """The placement `kept` of a method, the switches `spare` that it would choose next, and how subjects of `crowd` are
    served by what is tried: LogitBoost of `rounds` rounds learns from `rows` rows.
    """

    crowd: Crowd
    kept: Columns
    spare: Columns
    rows: int
    rounds: int
    seed: int
    _halves: tuple[tuple[Crowd, Crowd], ...] = field(init=False)
    _known: dict[frozenset[int], NDArray[np.float64]] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        people = np.random.default_rng([self.seed, 2]).permutation(np.unique(self.crowd.subjects))
        one, other = self.crowd.of(people[::2]), self.crowd.of(people[1::2])
        learnt = [half.drawn(self.rows // 2, self.seed) for half in (one, other)]
        asked = [half.drawn(_ASKED_OF_EACH * len(np.unique(half.subjects)), self.seed) for half in (other, one)]
        self._halves = tuple(zip(learnt, asked, strict=True))

    def best(self, aim: Aim) -> Columns:
        """Return the placement as the method chose it ("plain"), or after the exchanges that serve `aim` best.

        Nothing is exchanged without a gain, nor with fewer than ENOUGH_SUBJECTS.
        """
        if aim == "plain" or len(np.unique(self.crowd.subjects)) < ENOUGH_SUBJECTS:
            return self.kept
        columns = self.kept
        for _ in range(EXCHANGES):
            better = max([columns, *self._exchanges(columns)], key=lambda tried: self._value(tried, aim))
            if better == columns:
                break
            columns = better
        return columns

    def _exchanges(self, columns: Columns) -> list[Columns]:
        edge = (*self.kept[-REACH:], *self.spare)
        return [
            tuple(new if column == old else column for column in columns)
            for old in columns
            if old in edge
            for new in edge
            if new not in columns
        ]

    def _value(self, columns: Columns, aim: Aim) -> float:
        key = frozenset(columns)
        if key not in self._known:
            order = tuple(sorted(columns))
            parts = [rates(learnt, asked, order, self.rounds) for learnt, asked in self._halves]
            self._known[key] = np.concatenate(parts)
        found = served(self._known[key])
        return found.worst_tenth if aim == "worst tenth" else found.mean
