"""Two trainings that should be one: how far their scores are apart, and why they part where they do."""

from collections.abc import Iterator, Sequence

import numpy as np

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import TIE, Stumps

from ..finding import Finding, Worst
from ..inputs.changes import Change
from ..inputs.hard_data import Floats, HardSet
from ..reference.numbers import precisely
from .class_rounds import ClassRound, branches, class_rounds
from .growth import Step, grown, step_of

Z_MAX = 3.0
SAME = "what is learnt from the set as it was"


class Partings:
    """Gathers how far the scores of two trainings are apart, and which rows they give to different classes, as long as
    their stumps are the same; and where these first are not, by how much the stumps differ in what they explain.

    Once they have parted on a tie nothing more is claimed: stumps that explain as much are not the same stumps.
    """

    def __init__(self) -> None:
        self._apart = Worst("scores, renumbered or repeated, while stumps agree", SAME, 1.0, "x growth")
        self._answers = Worst("winners, but for ties, while stumps agree", SAME, 0.0, "rows")
        self._parted = Worst("what two stumps explain, where they first differ", "60 digits", 1.0, "x rounding")

    def findings(self) -> Iterator[Finding]:
        """Yield what was found."""
        return (worst.finding() for worst in (self._apart, self._answers, self._parted))

    def see(self, hard: HardSet, change: Change, rounds: int) -> None:
        """Train on both sets, weights left out, and follow the rounds to the end or to where they part."""
        one, other = (boost(of.X, of.labels, of.n_classes, rounds=rounds)[0] for of in (hard, change.hard))
        other = renumbered(other, change)
        steps: list[Step] = []
        F = np.zeros((len(hard.X), hard.n_classes))
        for number, both in enumerate(zip(one.staged_scores(hard.X), other.staged_scores(hard.X), strict=True)):
            at = f"{hard.name}, {change.name}, round {number + 1}"
            given = class_rounds(F.tolist(), hard.labels.tolist(), Z_MAX)
            if self._see_stumps(hard, given, [one.first(number + 1), other.first(number + 1)], change, at):
                return
            steps.append(_step(hard, one, number, given, float(np.abs(both).max())))
            self._apart.see(float((np.abs(both[0] - both[1]).ravel() / (2 * grown(steps))).max()), at)
            self._answers.see(_answered_otherwise(*both), at, len(hard.X))
            F = both[0]

    def _see_stumps(
        self, hard: HardSet, given: Sequence[ClassRound], trainings: Sequence[Stumps], change: Change, at: str
    ) -> bool:
        """Return whether the last stumps differ; then see by how much they do in what they explain."""
        places = [list(zip(of.columns[-1].tolist(), of.thresholds[-1].tolist(), strict=True)) for of in trainings]
        for k, (first, second) in enumerate(zip(*places, strict=True)):
            if first != second:
                self._parted.see(_doubt(hard, given[k], (first, second), len(change.hard.labels)), at)
        return places[0] != places[1]


def renumbered(other: Stumps, change: Change) -> Stumps:
    """Return the ensemble of a changed set in the numbers of inputs and classes of the set itself."""
    place = np.full(other.n_inputs, -1, np.int32)
    place[list(change.inputs)] = np.arange(len(change.inputs))
    order = list(change.classes)
    columns = place[other.columns[:, order]]
    return Stumps(len(change.inputs), columns, other.thresholds[:, order], other.values[:, order], other.shrinkage)


def _step(hard: HardSet, stumps: Stumps, number: int, given: Sequence[ClassRound], largest: float) -> Step:
    places = zip(stumps.columns[number].tolist(), stumps.thresholds[number].tolist(), strict=True)
    parts = [branches(hard.X[:, column], threshold) for column, threshold in places]
    return step_of(given, parts, hard.labels.tolist(), stumps.shrinkage, Z_MAX, largest)


@precisely()
def _doubt(hard: HardSet, given: ClassRound, places: Sequence[tuple[int, float]], rows: int) -> float:
    """Return by how much two stumps differ in what they explain, as a share of what makes them equal to training.

    `rows` are those of the larger set, with whose number grows what its grid rounds away.
    """
    one, other = (given.explained(hard.X, *place) for place in places)
    return float(abs(one - other) / given.doubt(Z_MAX, rows / len(given.weights)))


def _answered_otherwise(one: Floats, other: Floats) -> int:
    """Return how many rows of scores (n, K) have another winner, and not because two scores are tied in either."""
    rows, first, second = np.arange(len(one)), one.argmax(axis=1), other.argmax(axis=1)
    leads = one[rows, first] - one[rows, second], other[rows, second] - other[rows, first]
    return int(np.count_nonzero(np.minimum(*leads) > TIE))
