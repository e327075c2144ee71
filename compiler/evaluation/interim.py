"""The accuracy during a collection: each trial is predicted by linear discriminants of others."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..recordings.graspset import GraspSet
from ..recordings.mcap_recording import import_recordings
from ..samples import decided
from ..trainers.discriminant import fit_discriminant
from .folds import EvaluationError, trial_folds
from .rates import Rate

# Discriminants are best where trials are few. Of more trials than this, several are left out together.
_MOST_FOLDS, _SEED = 40, 1


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
    """Return the accuracy for a set's trials, each predicted from others.

    Types are ordered by the lower end of their interval, which is low for types that are mistaken for others and for
    types with few trials. Raises EvaluationError for a set with one type.
    """
    names = grasp_set.taxonomy.names
    classes, labels = np.unique(np.asarray(grasp_set.labels, np.intp), return_inverse=True)
    if len(classes) < 2:
        raise EvaluationError("all trials are of one grasp type: there is nothing to distinguish")
    _, first, trial = np.unique(grasp_set.trial_ids, return_index=True, return_inverse=True)
    inputs = np.hstack([grasp_set.switches, grasp_set.codes, grasp_set.taxels], dtype=np.uint16)
    rows = np.empty_like(labels)
    for fold in trial_folds(labels, trial, min(len(first), _MOST_FOLDS), _SEED):
        learnt = fold.train
        model = fit_discriminant(inputs[learnt], labels[learnt], trial[learnt], len(classes), calibrated=False)
        rows[fold.test] = model.scores(inputs[fold.test]).argmax(axis=1)
    predicted, truth = decided(rows[np.newaxis], trial)[0], labels[first]
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


def interim_accuracy_of(recording: Path) -> InterimAccuracy | None:
    """Return the accuracy for the trials of a recording so far; None while they have fewer than two types."""
    grasp_set, _ = import_recordings([recording])
    return interim_accuracy(grasp_set) if len(np.unique(grasp_set.labels)) > 1 else None
