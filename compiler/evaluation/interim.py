"""The accuracy during a collection: each trial is predicted by a quick model of all the others.

The model is penalised least squares on the inputs, with a column of +1 and -1 for each class (R. Rifkin and A. Klautau
2004, In defense of one-vs-all classification, JMLR 5). Leaving a trial out needs no retraining: with A = inverse of
(X X' + penalty) over all rows, the scores of the rows B of a trial from all other rows are

    Y_B - inverse(A_BB) (A Y)_B

exactly (the PRESS of D. Allen 1974, for blocks), so a thousand trials take a second. Inputs are scaled by their
standard deviation over all rows, which uses no label. The penalty is fixed: no choice depends on the accuracies.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..recordings.graspset import GraspSet
from ..recordings.mcap_recording import import_recordings
from ..samples import decided
from .folds import EvaluationError
from .rates import Floats, Rate

# As a share of the mean eigenvalue of X X'.
_PENALTY = 0.1
# The inverse penalty on the constant added to the scores, as a multiple of that mean.
_CONSTANT = 1e4


@dataclass(frozen=True, slots=True)
class InterimType:
    """A grasp type, or none: the number of its trials, how many are correct, the 95 % interval of that accuracy in
    0..1, and the type most often predicted for the others ("" if there are none).

    A type with a single trial has no accuracy (correct is 0, the interval 0..1): without its trial it is unknown.
    """

    grasp: str
    total: int
    correct: int
    low: float
    high: float
    taken_for: str = ""


@dataclass(frozen=True, slots=True)
class InterimAccuracy:
    """The accuracy of a collection so far, and of each type, starting with those for which more trials help most.

    Only the trials of types with two or more count in `total`; it may be 0, with an interval of 0..1.
    """

    total: int
    correct: int
    low: float
    high: float
    types: tuple[InterimType, ...]


def interim_accuracy(grasp_set: GraspSet) -> InterimAccuracy:
    """Return the accuracy for a set's trials, each predicted from all others.

    Types are ordered by the lower end of their interval, which is low for types that are mistaken for others and for
    types with few trials. Raises EvaluationError for a set with one type.
    """
    names = grasp_set.taxonomy.names
    classes, labels = np.unique(np.asarray(grasp_set.labels, np.intp), return_inverse=True)
    if len(classes) < 2:
        raise EvaluationError("all trials are of one grasp type: there is nothing to distinguish")
    _, first, trial = np.unique(grasp_set.trial_ids, return_index=True, return_inverse=True)
    scores = left_out_scores(_inputs(grasp_set), labels, trial)
    predicted, truth = decided(scores.argmax(axis=1)[np.newaxis], trial)[0], labels[first]
    types = []
    for number, label in enumerate(classes):
        guesses = predicted[truth == number]
        wrong = np.bincount(guesses[guesses != number], minlength=len(classes))
        taken_for = names[classes[wrong.argmax()]] if wrong.any() and len(guesses) > 1 else ""
        types.append(InterimType(names[label], len(guesses), *_rate(guesses == number, len(guesses) > 1), taken_for))
    counts = (np.bincount(truth) > 1)[truth]
    types.sort(key=lambda kind: kind.low)
    return InterimAccuracy(int(counts.sum()), *_rate((predicted == truth)[counts], bool(counts.any())), tuple(types))


def _rate(hits: NDArray[np.bool_], known: bool) -> tuple[int, float, float]:
    """Return the correct trials and the interval of their share; of nothing known 0 and 0..1."""
    if not known:
        return 0, 0.0, 1.0
    rate = Rate.counted((int(hits.sum()),), len(hits), of="within subject")
    return rate.correct[0], rate.low, rate.high


def left_out_scores(inputs: Floats, label: NDArray[np.intp], trial: NDArray[np.intp]) -> Floats:
    """Return the scores (n, K) of each row from a model of all rows but those of its trial.

    inputs (n, p); label (n,) in 0..K-1; trial (n,) in 0..T-1. All rows of a trial together weigh as much as the only
    row of another. The model is the minimum over weights W (p, K) and constants c (K,) of

        sum over rows of |x W + c - y|^2 / rows of its trial + penalty (|W|^2 + |c|^2 / _CONSTANT)
    """
    rows = np.bincount(trial)
    kernel = inputs @ inputs.T
    mean = max(float(np.trace(kernel)) / len(inputs), 1e-12)
    kernel += _CONSTANT * mean
    kernel[np.diag_indices_from(kernel)] += _PENALTY * mean * rows[trial]
    inverse = np.linalg.inv(kernel)
    columns = 2.0 * np.eye(int(label.max()) + 1)[label] - 1.0
    weights = inverse @ columns
    scores = np.empty_like(columns)
    order = np.argsort(trial, kind="stable")
    for block in np.split(order, np.cumsum(rows)[:-1]):
        scores[block] = columns[block] - np.linalg.solve(inverse[np.ix_(block, block)], weights[block])
    return scores


def interim_accuracy_of(recording: Path) -> InterimAccuracy | None:
    """Return the accuracy for the trials of a recording so far; None while they have fewer than two types."""
    grasp_set, _ = import_recordings([recording])
    return interim_accuracy(grasp_set) if len(np.unique(grasp_set.labels)) > 1 else None


def _inputs(grasp_set: GraspSet) -> Floats:
    """Return switches, joints and taxels (n, p), centred and scaled by the standard deviation; constant ones are 0."""
    columns = np.hstack([grasp_set.switches, grasp_set.codes, grasp_set.taxels.reshape(len(grasp_set), -1)]).astype(
        np.float64
    )
    spread = columns.std(axis=0)
    return np.asarray((columns - columns.mean(axis=0)) / np.where(spread > 0, spread, 1.0))
