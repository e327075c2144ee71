"""The work of an evaluation: independent fits, each done once, on all cores, with the same result on any number."""

import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker

import numpy as np
from numpy.typing import NDArray

from ..boosting.boost import boost
from ..boosting.stumps import winners
from .compositions import Columns
from .folds import Fold

Inputs = NDArray[np.uint16]
Labels = NDArray[np.intp]
Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class Fit:
    """Train on a fold's training rows and these columns, classes `grasps` (ascending labels); then test the fold.

    Two fits are one if they are of the same `Fold` object and the same columns.
    """

    fold: Fold
    columns: Columns
    grasps: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Training:
    """How every classifier is trained: the rounds of boosting, and the factor on every stump's answer."""

    rounds: int = 100
    shrinkage: float = 1.0


def predictions(X: Inputs, labels: Labels, fit: Fit, training: Training) -> Labels:
    """Return the labels given to the fold's test rows; X (n, d), labels (n,).

    Without columns nothing can be told apart: every row gets the most frequent label of the training rows (the lowest
    of several), which is the rate to beat.
    """
    grasps = np.array(fit.grasps, dtype=np.intp)
    trained = np.searchsorted(grasps, labels[fit.fold.train])
    if not fit.columns:
        return np.full(len(fit.fold.test), grasps[np.bincount(trained).argmax()])
    part = X[:, fit.columns]
    inputs = part[fit.fold.train]
    stumps, _ = boost(inputs, trained, len(grasps), rounds=training.rounds, shrinkage=training.shrinkage)
    return grasps[winners(stumps.scores(part[fit.fold.test]))]


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
    from joblib import Parallel, delayed, parallel_config

    todo = list(dict.fromkeys(fits))
    results: dict[Fit, Labels] = {}
    with parallel_config(backend="loky", inner_max_num_threads=1):
        workers = Parallel(n_jobs=jobs, return_as="generator_unordered")
        with _interrupts_held():
            answers = workers(delayed(_numbered)(i, X, labels, fit, training) for i, fit in enumerate(todo))
        for number, found in answers:
            results[todo[number]] = found
            if progress is not None:
                progress(len(results), len(todo))
    return results


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Let a Ctrl-C wait. Processes started meanwhile never get it, so none complains of it: this one ends them."""
    # loky asks for this helper process of Python's, and its start would lift the block.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _numbered(number: int, X: Inputs, labels: Labels, fit: Fit, training: Training) -> tuple[int, Labels]:
    return number, predictions(X, labels, fit, training)
