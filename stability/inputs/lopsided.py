"""Sets that lack something on one side of a cut, and what must be true of their evaluation."""

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.evaluation.fits import Fit, predictions
from thenar.compiler.evaluation.plan import inputs
from thenar.compiler.evaluation.populations import Population, Scheme, populations
from thenar.compiler.evaluation.study import Cell
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.trainers.base import Training

from .small_sets import make_set


def lopsided() -> dict[str, tuple[GraspSet, Scheme]]:
    """Return sets that lack something on one side of a cut, by what it is, each with the scheme that cuts it so."""
    frames = [[0, 0], [0, 1], [1, 0], [1, 1]] * 4
    subjects = ["A"] * 8 + ["B"] * 8
    apart, lacking = ["a"] * 8 + ["b"] * 8, ["a", "b"] * 4 + ["a", "b", "c", "c"] * 2
    return {
        "subjects of one class each": (make_set(apart, frames, subjects=subjects), "subject"),
        "a subject that lacks a class": (make_set(lacking, frames, subjects=subjects), "subject"),
        "a class of one row in four folds": (make_set(["a", "b"] * 7 + ["a", "c"], frames), "stratified"),
        "a class in one block of four": (make_set(["a", "b"] * 6 + ["c"] * 4, frames), "block"),
    }


def parts_of(grasp_set: GraspSet, scheme: Scheme) -> tuple[Population, ...]:
    """Return the populations of an evaluation in four folds and two repeats."""
    return populations(grasp_set, scheme, 4, 2, 1)


def tested_labels(grasp_set: GraspSet, part: Population) -> NDArray[np.intp]:
    """Return how many rows of each label (K,) the population's folds test, over all repeats."""
    rows = np.concatenate([fold.test for fold in part.folds])
    return np.bincount(grasp_set.labels[rows], minlength=len(grasp_set.taxonomy.types))


def differs(cell: Cell, tested: NDArray[np.intp]) -> bool:
    """Return whether a cell's matrix does not hold the rows tested, or recognises others than its rate says."""
    confusion = np.array(cell.confusion)
    return not np.array_equal(confusion.sum(axis=1), tested) or confusion.trace() != sum(cell.rate.correct)


def guessed_untrained(grasp_set: GraspSet, scheme: Scheme) -> int:
    """Return how many tested rows are taken for a class that their fold was not trained on."""
    X, labels = inputs(grasp_set), grasp_set.labels
    wrong = 0
    for part in parts_of(grasp_set, scheme):
        for fold in part.folds:
            fit = Fit(fold, tuple(range(X.shape[1])), part.grasps, len(grasp_set.switch_names))
            found = predictions(X, labels, fit, Training("logitboost", {"rounds": 10}))
            wrong += int((~np.isin(found, labels[fold.train])).sum())
    return wrong
