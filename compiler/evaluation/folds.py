"""Folds: stratified exactly as in Weka 3.6, or keeping related rows on the same side of the split; the populations that
they divide, and the rows from which a placement is chosen.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thenar.drivers.errors import ThenarError
from thenar.runtime.manifest import Of

from ..recordings.graspset import GraspSet
from ..samples import Samples
from ..text import INDEPENDENT


class EvaluationError(ThenarError, ValueError):
    """The set cannot be split or compared as requested: too few rows or subjects, or an unknown name."""


_MULTIPLIER = 0x5DEECE66D
_INCREMENT = 0xB
_MASK = (1 << 48) - 1


class JavaRandom:
    """The 48-bit linear congruential generator of java.util.Random, seeded as `new Random(seed)`."""

    def __init__(self, seed: int) -> None:
        self._state = (seed ^ _MULTIPLIER) & _MASK

    def next_bits(self, bits: int) -> int:
        """Return the next `bits` (1 to 32) random bits, as a non-negative number."""
        self._state = (self._state * _MULTIPLIER + _INCREMENT) & _MASK
        return self._state >> (48 - bits)

    def next_int(self, bound: int) -> int:
        """Return a uniform integer in [0, bound), as nextInt(bound); ValueError unless 0 < bound < 2^31."""
        if not 0 < bound < 1 << 31:
            raise ValueError(f"bound {bound} is not in 1..2147483647")
        if bound & (bound - 1) == 0:
            return bound * self.next_bits(31) >> 31
        while True:
            drawn = self.next_bits(31)
            remainder = drawn % bound
            # The last, incomplete run of `bound` numbers below 2^31 would favour small remainders: draw again.
            if drawn - remainder + bound <= 1 << 31:
                return remainder

    def shuffle(self, order: list[int]) -> None:
        """Shuffle a list in place: for i from the end down to 1, swap items i and nextInt(i + 1)."""
        for i in range(len(order) - 1, 0, -1):
            j = self.next_int(i + 1)
            order[i], order[j] = order[j], order[i]


Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """Row numbers to train on, in training order, and row numbers to test on. Compared by identity."""

    train: Rows
    test: Rows
    name: str

    def of(self, rows: Rows) -> "Fold":
        """Return this fold of a part with rows `rows` (n_part,) as a fold of the whole."""
        return Fold(rows[self.train], rows[self.test], self.name)


def weka_folds(labels: ArrayLike, n_folds: int, seed: int) -> list[Fold]:
    """Return the folds of `weka -x n_folds -s seed` for labels (n,) in the order of the file.

    One generator shuffles all rows and then each fold's training part; classes are distributed as in Weka's `stratify`.
    A class with fewer rows than folds is missing from some test parts, as in Weka. Raises EvaluationError for fewer
    than two folds, or fewer rows than folds.
    """
    labels = np.asarray(labels)
    check_cut(len(labels), n_folds, "rows")
    random = JavaRandom(seed)
    order = list(range(len(labels)))
    random.shuffle(order)
    grouped = _grouped(order, labels.tolist())
    order = [row for start in range(n_folds) for row in grouped[start::n_folds]]
    size, larger = divmod(len(order), n_folds)
    folds = []
    for fold in range(n_folds):
        start = fold * size + min(fold, larger)
        stop = start + size + (fold < larger)
        train = order[:start] + order[stop:]
        random.shuffle(train)
        folds.append(Fold(np.array(train, np.intp), np.array(order[start:stop], np.intp), str(fold + 1)))
    return folds


def trial_folds(labels: ArrayLike, trials: NDArray[np.intp], n_folds: int, seed: int) -> list[Fold]:
    """Return stratified folds of rows (n,) that split no trial: rows with equal numbers in `trials` (n,) stay together.

    The trials, in the order of their first rows, are split as `weka_folds` splits rows; if each row is a separate
    trial, these are Weka's folds. The label of a trial is the smallest of its rows' labels. For a movement this is the
    grasp, since rows without one have the highest label. Raises EvaluationError as `weka_folds` does.
    """
    _, first, number = np.unique(trials, return_index=True, return_inverse=True)
    smallest = np.asarray(labels)[first]
    np.minimum.at(smallest, number, labels)
    order = np.argsort(first)
    number = np.argsort(order)[number]
    rows, starts = np.argsort(number, kind="stable"), np.concatenate([[0], np.cumsum(np.bincount(number))])
    check_cut(len(order), n_folds, "trials" if len(order) < len(number) else "rows")

    def expanded(chosen: Rows) -> Rows:
        return np.concatenate([rows[starts[trial] : starts[trial + 1]] for trial in chosen.tolist()])

    folds = weka_folds(smallest[order], n_folds, seed)
    return [Fold(expanded(fold.train), expanded(fold.test), fold.name) for fold in folds]


def check_cut(n_parts: int, n_folds: int, what: str) -> None:
    """Raise EvaluationError unless `n_parts` `what` can be split into `n_folds` non-empty folds."""
    if n_folds < 2:
        raise EvaluationError(f"{n_folds} fold(s) leave nothing to train on; ask for 2 or more")
    if n_parts < n_folds:
        raise EvaluationError(
            f"{n_parts} {what} cannot be cut into {n_folds} folds; record more or ask for fewer folds"
        )


def _grouped(order: list[int], labels: Sequence[object]) -> list[int]:
    """Bring rows of one class together by Weka's swaps, classes by first appearance. Not stable: swaps move others."""
    placed = 1
    while placed < len(order):
        label = labels[order[placed - 1]]
        for k in range(placed, len(order)):
            if labels[order[k]] == label:
                order[placed], order[k] = order[k], order[placed]
                placed += 1
        placed += 1
    return order


def leave_one_out(groups: NDArray[np.str_], by: str) -> list[Fold]:
    """Return one fold for each name in groups (n,): test on its rows, train on all others; in the order of names.

    `by` is the word for a group ("subject", "object"). Raises EvaluationError if there is only one.
    """
    names = np.unique(groups).tolist()
    if len(names) < 2:
        raise EvaluationError(
            f"leaving one {by} out needs two or more; all {len(groups)} rows are of {by} {', '.join(names)!r}"
        )
    return [Fold(np.flatnonzero(groups != name), np.flatnonzero(groups == name), name) for name in names]


# With more groups than this, several are left out together.
_MOST_GROUPS = 10


def leave_groups_out(groups: NDArray[np.generic], by: str, n_folds: int = _MOST_GROUPS) -> list[Fold]:
    """Return the folds of `leave_one_out`; for more than `n_folds` names in groups (n,), that many of several names."""
    names, number = np.unique(groups, return_inverse=True)
    if len(names) > n_folds:
        groups = number % n_folds
    return leave_one_out(groups.astype(np.str_), by)


Scheme = Literal["trial", "subject", "object", "session"]

# What the accuracies of each scheme are of.
OF: dict[Scheme, Of] = {
    "trial": "within subject",
    "subject": "new subject",
    "object": "new object",
    "session": "new session",
}


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """One column of the tables.

    name     the subject whose rows are tested
    rows     all rows in training or test
    grasps   class numbers present in `rows`, ascending
    repeats  folds of each repeat
    """

    name: str
    rows: Rows
    grasps: tuple[int, ...]
    repeats: tuple[tuple[Fold, ...], ...]

    @property
    def folds(self) -> list[Fold]:
        """The folds of all repeats."""
        return [fold for folds in self.repeats for fold in folds]


def populations_of(
    grasp_set: GraspSet, scheme: Scheme, n_folds: int, repeats: int, seed: int
) -> tuple[Population, ...]:
    """Return one population per subject.

    trial, object, session: only the subject's own rows are trained on, and all are tested once per repeat.
    subject: the rows of all others are trained on. Only `trial` has a seed, and so repeats (seed, seed + 1, ...). No
    scheme has rows of one trial on both sides of a fold. Raises EvaluationError naming a subject that cannot be split.
    """
    subjects, everyone, samples = grasp_set.subjects, np.arange(len(grasp_set)), Samples.of(grasp_set)

    def population(name: str, rows: Rows, repeats: Sequence[Sequence[Fold]]) -> Population:
        grasps = tuple(np.unique(samples.labels[rows]).tolist())
        return Population(name, rows, grasps, tuple(tuple(fold.of(rows) for fold in folds) for folds in repeats))

    def cut(rows: Rows) -> list[list[Fold]]:
        """Return the repeats of folds of one subject's rows, numbered within these."""
        if scheme in ("object", "session"):
            groups = grasp_set.objects if scheme == "object" else grasp_set.sessions
            return [leave_one_out(groups[rows], scheme)]
        labels, trials = samples.labels[rows], samples.trials[rows]
        return [trial_folds(labels, trials, n_folds, seed + repeat) for repeat in range(repeats)]

    if scheme == "subject":
        return tuple(population(fold.name, everyone, [[fold]]) for fold in leave_one_out(subjects, "subject"))
    several = []
    for name in np.unique(subjects).tolist():
        rows = np.flatnonzero(subjects == name)
        try:
            several.append(population(name, rows, cut(rows)))
        except EvaluationError as reason:
            raise EvaluationError(f"subject {name}: {reason}") from reason
    return tuple(several)


def groups_of(grasp_set: GraspSet, by: Scheme) -> NDArray[np.str_] | None:
    """Return the group (n,) that each row is left out with, None if that is its trial; sessions are per subject."""
    if by == "session":
        return np.char.add(np.char.add(grasp_set.subjects, "\n"), grasp_set.sessions)
    if by == "object":
        return grasp_set.objects
    return grasp_set.subjects if by == "subject" else None


ProtocolName = Literal["paper", "nested"]


# The protocols, each with a sentence on its meaning.
PROTOCOLS: dict[ProtocolName, str] = {
    "paper": "The placement is chosen once, from all rows, test rows included, as the paper did: optimistic.",
    "nested": (
        "The placement is chosen anew inside each training fold, without the test rows: the accuracy on new grasps."
    ),
}


def may_choose(protocol: ProtocolName, population: Population, fold: Fold) -> Rows:
    """Return the rows from which the placement for this fold may be chosen."""
    return population.rows if protocol == "paper" else fold.train


def may_choose_pooled(protocol: ProtocolName, everyone: Rows, fold: Fold) -> Rows:
    """Return the rows from which a placement common to all subjects may be chosen for this fold."""
    return everyone if protocol == "paper" else np.setdiff1d(everyone, fold.test)


def concerns(grasp_set: GraspSet, populations: tuple[Population, ...], scheme: Scheme, n_folds: int) -> tuple[str, ...]:
    """Return warnings: that grasps are simulated, that rows are stated to be independent, and about grasp types that
    are the only one, too rare for the folds, or tested but never trained.
    """
    origin, samples = grasp_set.simulated, Samples.of(grasp_set)
    texts = [f"these grasps are simulated ({origin}): the rates are not those of recorded ones"] if origin else []
    texts += [INDEPENDENT] if grasp_set.independent else []
    texts += [
        f"subject {population.name}: every row is of {samples.grasps[population.grasps[0]]}, the only type"
        for population in populations
        if len(population.grasps) == 1
    ]
    if scheme == "trial":
        texts += [text for population in populations for text in _rare(samples, population, n_folds)]
    return (*texts, *(text for population in populations for text in _untrained(samples, population)))


def _rare(samples: Samples, population: Population, n_folds: int) -> list[str]:
    first = np.unique(samples.trials[population.rows], return_index=True)[1]
    counts = np.bincount(samples.labels[population.rows][first], minlength=samples.n_classes)
    return [
        f"subject {population.name} has {counts[label]} trial(s) of {samples.grasps[label]}: "
        f"fewer than the {n_folds} folds, so some folds do not test it"
        for label in population.grasps
        if counts[label] < n_folds
    ]


def _untrained(samples: Samples, population: Population) -> list[str]:
    """Name the grasp types that some fold tests without training on them, with the number of rows lost."""
    lost = np.zeros(samples.n_classes, np.intp)
    for fold in population.repeats[0]:
        unknown = ~np.isin(samples.labels[fold.test], samples.labels[fold.train])
        np.add.at(lost, samples.labels[fold.test][unknown], 1)
    return [
        f"{lost[label]} row(s) of {samples.grasps[label]} of subject {population.name} are tested by a fold that "
        "trains no such row: they cannot be recognised"
        for label in np.flatnonzero(lost)
    ]
