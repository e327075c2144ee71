"""The work of an evaluation: independent fits, each done once, on all cores, with the same result on any number."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..boosting.stumps import winners
from ..samples import Columns, Samples
from ..tables.collapse import model_scores
from ..trainers.base import Training
from ..workers import in_workers
from .folds import Fold

Inputs = NDArray[np.uint16]
Labels = NDArray[np.intp]
Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class Fit:
    """Train on a fold's training rows and these columns, classes `grasps` (ascending labels); then test the fold.

    The first `n_switches` columns are switches, the others joints. Two fits are one if they are of the same `Fold`
    object and the same columns.
    """

    fold: Fold
    columns: Columns
    grasps: tuple[int, ...]
    n_switches: int = 0


def predictions(X: Inputs, labels: Labels, fit: Fit, training: Training) -> Labels:
    """Return the labels given to the fold's test rows; X (n, d), labels (n,).

    Where the fit is blind, every row gets the most frequent label of the training rows (the lowest of several), which
    is the rate to beat.
    """
    grasps = np.array(fit.grasps, dtype=np.intp)
    trained = np.searchsorted(grasps, labels[fit.fold.train])
    if is_blind(X, fit):
        return np.full(len(fit.fold.test), grasps[np.bincount(trained).argmax()])
    part = X[:, fit.columns]
    bits, codes = part[:, : fit.n_switches].astype(bool), part[:, fit.n_switches :]
    rows, names = fit.fold.train, tuple(map(str, fit.grasps))
    model = training.train(Samples(bits[rows], codes[rows], trained, names))
    return grasps[winners(model_scores(model, bits[fit.fold.test], codes[fit.fold.test]))]


def is_blind(X: Inputs, fit: Fit) -> bool:
    """Return whether a fit has no column that varies among its training rows of X (n, d): nothing to tell apart by."""
    rows = fit.fold.train
    return not any((X[rows, column] != X[rows[0], column]).any() for column in fit.columns)


def run_fits(
    X: Inputs,
    labels: Labels,
    fits: Iterable[Fit],
    training: Training,
    jobs: int = -1,
    progress: Progress | None = None,
) -> dict[Fit, Labels]:
    """Return the predictions of every fit. Equal fits are done once; `progress(done, total)` after each.

    jobs  worker processes, as joblib counts them: -1 for all cores, 1 for none beside this one. A worker runs one
          thread. Sums in boosting are exact, so the result does not depend on the number of workers.
    """
    todo = list(dict.fromkeys(fits))
    results: dict[Fit, Labels] = {}
    tasks = (_Task(number, X, labels, fit, training) for number, fit in enumerate(todo))
    for number, found in in_workers(_numbered, tasks, jobs):
        results[todo[number]] = found
        if progress is not None:
            progress(len(results), len(todo))
    return results


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    number: int
    X: Inputs
    labels: Labels
    fit: Fit
    training: Training


def _numbered(task: _Task) -> tuple[int, Labels]:
    return task.number, predictions(task.X, task.labels, task.fit, task.training)
