"""What adapting to people left out brings: the strength that `compile` stores, and `evaluate --adapt`."""

from collections.abc import Sequence
from functools import partial
from math import inf
from statistics import fmean

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Wearing
from thenar.runtime.model.tables import ScoreTables, winners
from thenar.runtime.recipe import Recipe

from ..evaluation.folds import EvaluationError, Fold, leave_one_out
from ..evaluation.rates import RecipeWords, student
from ..model.collapse import collapse
from ..recogniser import Recogniser
from ..recordings.graspset import GraspSet
from ..samples import Samples, decided
from ..trainers.base import Report
from ..wearer import STRENGTH, STRENGTHS, Adaptation, correlations
from ..workers import in_workers

# The number of trials of each type that a person left out is adapted to, and a strength.
Try = tuple[int, float]
# The correct trials of a person after each try, and their number.
Hits = tuple[tuple[int, ...], int]
Counts = NDArray[np.intp]
_OWN = 2
TRIES: tuple[Try, ...] = (*((_OWN, strength) for strength in STRENGTHS), (0, inf))
_LEAST_PEOPLE, _LEAST_GAIN = 3, 100


def related_joints(tables: ScoreTables, learnt: Samples) -> tuple[int, ...]:
    """Return the correlations of the joints in the training rows, where tables have lines; else none are needed."""
    return correlations(learnt.codes) if tables.lines else ()


def hits_of(recogniser: Recogniser, samples: Samples, tries: Sequence[Try] = TRIES) -> list[Hits]:
    """Return what each try brings to each person in `samples`, with all inputs, of whom the recogniser saw nothing.

    A person's first trials of each type adapt; those that no try needs are tested. A person without such is left out.
    """
    read = recogniser.read(samples).without_none()
    tables = collapse(recogniser.model, read.n_switches)
    related = related_joints(tables, recogniser.read(recogniser.samples))
    most, found = max(own for own, _ in tries), []
    for person in np.unique(read.subjects):
        rows = read.rows(read.subjects == person)
        _, first, trial = np.unique(rows.trials, return_index=True, return_inverse=True)
        of_type, place = rows.labels[first], np.empty(len(first), np.intp)
        for label in np.unique(of_type):
            place[of_type == label] = np.arange(np.count_nonzero(of_type == label))
        tested = place >= most
        if not tested.any() or tested.all():
            continue
        correct = []
        for own, strength in tries:
            some, adapted = rows.rows((place < own)[trial]) if own else None, tables
            if some is not None:
                columns = some.switches, some.codes, some.labels, some.trials
                adapted = Adaptation(tables, *columns, strength, related).adapted
            predicted = winners(adapted.scores(rows.switches, rows.codes))
            hits = decided(predicted[np.newaxis], trial)[0] == of_type
            correct.append(int(np.count_nonzero(hits & tested)))
        found.append((tuple(correct), int(np.count_nonzero(tested))))
    return found


def wearing_of(hits: Sequence[Hits], related: tuple[int, ...]) -> Wearing | None:
    """Return the strength for the people left out; None where there is nothing to store.

    It is the usual one, unless another recognised a hundredth of the trials more: less is chance, with a few people.
    """
    if len(hits) < _LEAST_PEOPLE:
        return Wearing(STRENGTH, related) if related else None
    *after, before = np.sum([correct for correct, _ in hits], axis=0).tolist()
    total = sum(tested for _, tested in hits)
    best = int(_best(np.array(after), total))
    return Wearing(STRENGTHS[best], related, len(hits), _OWN, before, after[best], total)


def _best(after: Counts, total: int | Counts) -> Counts:
    """Return the number (...) of the strength for correct trials (..., strengths) of `total` (...)."""
    usual = STRENGTHS.index(STRENGTH)
    gains = after.max(axis=-1) - after[..., usual]
    best: Counts = np.where(_LEAST_GAIN * gains > total, after.argmax(axis=-1), usual)
    return best


class AdaptedRow(msgspec.Struct, frozen=True):
    """The accuracy of people left out, 0..1, after `own` trials a type of theirs: the mean over people with its 95 %
    interval (Student's t; None with one person), the worst person, and each.
    """

    own: int
    mean: float
    low: float | None
    high: float | None
    worst: float
    people: tuple[float, ...]

    @property
    def title(self) -> str:
        """What the accuracy is of."""
        return f"new subject, after {self.own} own trials a type" if self.own else "new subject"


class WearerStudy(msgspec.Struct, frozen=True):
    """The result: what was trained, the people left out, the trials that were tested, and the rows."""

    fingerprint: str
    recipe: RecipeWords
    subjects: tuple[str, ...]
    trials: int
    rows: tuple[AdaptedRow, ...]


def study_wearers(
    grasp_set: GraspSet, recipe: Recipe, numbers: Sequence[int], jobs: int = -1, progress: Report | None = None
) -> WearerStudy:
    """Evaluate adaptation on people left out: the first trials of each of their types adapt, the rest are tested.

    For each person, the strength is the one that was best for the others.

    Parameters
    ----------
    grasp_set : GraspSet
        Recordings of two or more subjects.
    recipe : Recipe
        How to place and train.
    numbers : sequence of int
        The numbers of own trials of each type.
    jobs : int
        Worker processes; the result does not depend on their number.
    progress : callable, optional
        Called with (done, total) after each subject.

    Raises
    ------
    EvaluationError
        If there is only one subject, or nobody has more trials than the largest number.
    """
    samples = Samples.of(grasp_set, recipe.inputs)
    folds = leave_one_out(grasp_set.subjects, "subject")
    tries = [*((own, strength) for own in numbers for strength in STRENGTHS), (0, inf)]
    found: dict[str, Hits] = {}
    for done, (name, hits) in enumerate(
        in_workers(partial(_left_out, samples, grasp_set.subjects, recipe, tries), folds, jobs), 1
    ):
        found |= dict(zip([name], hits, strict=False))  # nothing, of a person with too few trials
        if progress is not None:
            progress(done, len(folds))
    people = [found[fold.name] for fold in folds if fold.name in found]
    if not people:
        raise EvaluationError(f"nobody has more than {max(numbers)} trials of a type: adapt to fewer")
    counts, totals = np.array([correct for correct, _ in people]), np.array([total for _, total in people])
    rows = [_row(0, (counts[:, -1] / totals).tolist())]
    for number, own in enumerate(numbers):
        part = counts[:, number * len(STRENGTHS) : (number + 1) * len(STRENGTHS)]
        others = part.sum(axis=0) - part
        best = _best(others, totals.sum() - totals)
        rows.append(_row(own, (part[np.arange(len(people)), best] / totals).tolist()))
    return WearerStudy(
        fingerprint=grasp_set.fingerprint(),
        recipe=RecipeWords.of(recipe),
        subjects=tuple(fold.name for fold in folds if fold.name in found),
        trials=int(totals.sum()),
        rows=tuple(rows),
    )


def _left_out(
    samples: Samples, subjects: NDArray[np.str_], recipe: Recipe, tries: list[Try], fold: Fold
) -> tuple[str, list[Hits]]:
    groups = subjects if len(np.unique(subjects[fold.train])) > 1 else None
    recogniser = Recogniser.fit(samples, recipe, fold.train, groups=groups)
    return fold.name, hits_of(recogniser, samples.rows(fold.test), tries)


def _row(own: int, rates: list[float]) -> AdaptedRow:
    low, high = student(rates) if len(rates) > 1 else (None, None)
    return AdaptedRow(own, fmean(rates), low, high, min(rates), tuple(rates))
