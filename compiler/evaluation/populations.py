"""Populations: the rows behind a column of the tables, their folds, and the rows from which a placement is chosen."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Of

from ..recordings.graspset import GraspSet
from ..text import INDEPENDENT
from .folds import EvaluationError, Fold, Rows, block_folds, leave_one_out, trial_folds

Scheme = Literal["trial", "subject", "object", "session", "block"]

# What the accuracies of each scheme are of.
OF: dict[Scheme, Of] = {
    "trial": "within subject",
    "subject": "new subject",
    "object": "new object",
    "session": "new session",
    "block": "within subject",
}


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """One column of the tables.

    name     the subject whose rows are tested
    rows     all rows in training or test
    grasps   labels present in `rows`, ascending: the classes
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

    @property
    def total(self) -> int:
        """Number of rows tested in one repeat."""
        return sum(len(fold.test) for fold in self.repeats[0])


def populations(grasp_set: GraspSet, scheme: Scheme, n_folds: int, repeats: int, seed: int) -> tuple[Population, ...]:
    """Return one population per subject.

    trial, block, object, session: only the subject's own rows are trained on, and all are tested once per repeat.
    subject: the rows of all others are trained on. Only `trial` has a seed, and so repeats (seed, seed + 1, ...). No
    scheme has rows of one trial on both sides of a fold. Raises EvaluationError naming a subject that cannot be split.
    """
    subjects, everyone = grasp_set.subjects, np.arange(len(grasp_set))

    def population(name: str, rows: Rows, repeats: Sequence[Sequence[Fold]]) -> Population:
        grasps = tuple(np.unique(grasp_set.labels[rows]).tolist())
        return Population(name, rows, grasps, tuple(tuple(fold.of(rows) for fold in folds) for folds in repeats))

    def cut(rows: Rows) -> list[list[Fold]]:
        """Return the repeats of folds of one subject's rows, numbered within these."""
        if scheme in ("object", "session"):
            groups = grasp_set.objects if scheme == "object" else grasp_set.sessions
            return [leave_one_out(groups[rows], scheme)]
        if scheme == "block":
            return [block_folds(grasp_set.trials[rows], n_folds)]
        labels, trials = grasp_set.labels[rows], grasp_set.trial_ids[rows]
        return [trial_folds(labels, trials, n_folds, seed + repeat) for repeat in range(repeats)]

    if scheme == "subject":
        return tuple(population(fold.name, everyone, [[fold]]) for fold in leave_one_out(subjects, "subject"))
    found = []
    for name in np.unique(subjects).tolist():
        rows = np.flatnonzero(subjects == name)
        try:
            found.append(population(name, rows, cut(rows)))
        except EvaluationError as reason:
            raise EvaluationError(f"subject {name}: {reason}") from reason
    return tuple(found)


def groups_of(grasp_set: GraspSet, scheme: Scheme) -> NDArray[np.str_] | None:
    """Return the group (n,) that each row is left out with, None if that is its trial; sessions are per subject."""
    if scheme == "session":
        return np.char.add(np.char.add(grasp_set.subjects, "\n"), grasp_set.sessions)
    return {"subject": grasp_set.subjects, "object": grasp_set.objects}.get(scheme)


ProtocolName = Literal["paper", "nested"]


@dataclass(frozen=True, slots=True)
class Protocol:
    """A protocol's name, and one sentence on its meaning."""

    name: ProtocolName
    meaning: str

    def may_choose(self, part: Population, fold: Fold) -> Rows:
        """Return the rows from which the placement for this fold may be chosen."""
        return part.rows if self.name == "paper" else fold.train

    def may_choose_pooled(self, everyone: Rows, fold: Fold) -> Rows:
        """Return the rows from which a placement common to all subjects may be chosen for this fold."""
        return everyone if self.name == "paper" else np.setdiff1d(everyone, fold.test)


PAPER = Protocol(
    "paper",
    "The placement is chosen once, from all rows, test rows included, as the paper did: optimistic.",
)
NESTED = Protocol(
    "nested",
    "The placement is chosen anew inside each training fold, without the test rows: the accuracy on new grasps.",
)
PROTOCOLS = (PAPER, NESTED)


def concerns(grasp_set: GraspSet, parts: tuple[Population, ...], scheme: Scheme, n_folds: int) -> tuple[str, ...]:
    """Return warnings: that grasps are simulated, that rows are stated to be independent, and about grasp types that
    are the only one, too rare for the folds, or tested but never trained.
    """
    made = grasp_set.simulated
    simulated = [f"these grasps are simulated ({made}): the rates are not those of recorded ones"] if made else []
    alone = [
        f"subject {part.name}: every row is of {grasp_set.taxonomy.types[part.grasps[0]]}, the only type"
        for part in parts
        if len(part.grasps) == 1
    ]
    found = [text for part in parts for text in _untrained(grasp_set, part)]
    if scheme == "trial":
        found = [text for part in parts for text in _rare(grasp_set, part, n_folds)] + found
    claimed = [INDEPENDENT] if grasp_set.independent else []
    return tuple(simulated + claimed + alone + found)


def _rare(grasp_set: GraspSet, part: Population, n_folds: int) -> list[str]:
    first = np.unique(grasp_set.trial_ids[part.rows], return_index=True)[1]
    counts = np.bincount(grasp_set.labels[part.rows][first], minlength=len(grasp_set.taxonomy.types))
    return [
        f"subject {part.name} has {counts[label]} trial(s) of {grasp_set.taxonomy.types[label]}: "
        f"fewer than the {n_folds} folds, so some folds do not test it"
        for label in part.grasps
        if counts[label] < n_folds
    ]


def _untrained(grasp_set: GraspSet, part: Population) -> list[str]:
    """Name the grasp types that some fold tests without training on them, with the number of rows lost."""
    lost: dict[int, int] = {}
    for fold in part.repeats[0]:
        tested = grasp_set.labels[fold.test]
        for label in np.setdiff1d(tested, grasp_set.labels[fold.train]).tolist():
            lost[label] = lost.get(label, 0) + int(np.count_nonzero(tested == label))
    return [
        f"{count} row(s) of {grasp_set.taxonomy.types[label]} of subject {part.name} are tested by a fold that trains "
        "no such row: they cannot be recognised"
        for label, count in sorted(lost.items())
    ]
