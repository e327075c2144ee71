"""Populations: whose rows a column of the tables is about, and how they are cut into folds."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..recordings.graspset import GraspSet
from .errors import EvaluationError
from .folds import Fold, Rows, weka_folds
from .groups import block_folds, leave_one_out

Scheme = Literal["stratified", "subject", "object", "block"]


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """One column of the tables.

    name     the subject: whose rows are tested
    rows     every row that takes part, tested or trained on
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
    """Return a population a subject.

    stratified, block, object: only the subject's own rows are trained on, and all of them are tested once a repeat.
    subject: the rows of all others are trained on. Only `stratified` has a seed, and so repeats (seed, seed + 1, ...).
    Raises EvaluationError naming the subject that cannot be cut so.
    """
    if scheme == "subject":
        everyone = np.arange(len(grasp_set))
        folds = leave_one_out(grasp_set.subjects, "subject")
        return tuple(_population(grasp_set, fold.name, everyone, ((fold,),)) for fold in folds)
    cut = _cutter(grasp_set, scheme, n_folds, repeats, seed)
    names = np.unique(grasp_set.subjects).tolist()
    return tuple(_of_subject(grasp_set, name, cut) for name in names)


_Cut = Callable[[Rows], list[list[Fold]]]


def _cutter(grasp_set: GraspSet, scheme: Scheme, n_folds: int, repeats: int, seed: int) -> _Cut:
    """Return what cuts rows into repeats of folds, numbered within the rows."""
    if scheme == "object":
        return lambda rows: [leave_one_out(grasp_set.objects[rows], "object")]
    if scheme == "block":
        return lambda rows: [block_folds(grasp_set.trials[rows], n_folds)]
    labels = grasp_set.labels
    return lambda rows: [weka_folds(labels[rows], n_folds, seed + repeat) for repeat in range(repeats)]


def _of_subject(grasp_set: GraspSet, name: str, cut: _Cut) -> Population:
    rows = np.flatnonzero(grasp_set.subjects == name)
    try:
        repeats = tuple(tuple(fold.of(rows) for fold in folds) for folds in cut(rows))
    except EvaluationError as reason:
        raise EvaluationError(f"subject {name}: {reason}") from reason
    return _population(grasp_set, name, rows, repeats)


def _population(grasp_set: GraspSet, name: str, rows: Rows, repeats: tuple[tuple[Fold, ...], ...]) -> Population:
    return Population(name, rows, tuple(np.unique(grasp_set.labels[rows]).tolist()), repeats)
