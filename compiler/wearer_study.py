"""Accuracy after adaptation to people left out, by which `compile` chooses the strength."""

from collections.abc import Sequence
from functools import partial
from itertools import product
from statistics import fmean

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Of, Recognised
from thenar.runtime.model.quantise import quantise
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.recipe import Recipe

from .evaluation.folds import EvaluationError, Fold, leave_one_out
from .evaluation.rates import Rate, RecipeWords, clustered, student
from .model.collapse import collapse
from .recogniser import Recogniser
from .recordings.graspset import GraspSet
from .samples import Samples, decided
from .text import counted
from .trainers.base import Report
from .wearer import STRENGTH, STRENGTHS, Adaptation, correlations
from .workers import in_workers

# The number of trials of each type that a person left out is adapted to, and the strength.
Try = tuple[int, float]
# The correct trials of a person after each try, and the number of those tested.
Hits = tuple[tuple[int, ...], int]
TRIES: tuple[Try, ...] = tuple((2, strength) for strength in STRENGTHS)
_LEAST_PEOPLE, _LEAST_GAIN = 3, 100


def related_joints(tables: ScoreTables, learnt: Samples) -> tuple[int, ...]:
    """Return the correlations of the joints in the training rows, where tables have lines; else none are needed."""
    return correlations(learnt.codes) if tables.lines else ()


def hits_of(recogniser: Recogniser, samples: Samples, tries: Sequence[Try] = TRIES) -> list[Hits]:
    """Return how many trials of each person in `samples`, with all inputs, integer tables recognise after each try.

    Only people whom the recogniser has not seen count. A person's first trials of each type adapt; those that no try
    needs are tested. A person without such trials is left out.
    """
    read = recogniser.read(samples).without_none()
    tables, recipe = collapse(recogniser.model, read.n_switches), recogniser.recipe
    related = related_joints(tables, recogniser.read(recogniser.samples))
    most, found = max(own for own, _ in tries), []
    for person in np.setdiff1d(read.subjects, recogniser.samples.subjects):
        rows = read.rows(read.subjects == person)
        _, first, trial = np.unique(rows.trials, return_index=True, return_inverse=True)
        truth, place = rows.labels[first], np.empty(len(first), np.intp)
        for label in np.unique(truth):
            place[truth == label] = np.arange(np.count_nonzero(truth == label))
        tested, correct = place >= most, []
        for own, strength in tries if tested.any() else ():
            integers = recogniser.integers
            if own:
                some = rows.rows((place < own)[trial])
                adaptation = Adaptation(tables, some.switches, some.codes, some.labels, some.trials, strength, related)
                integers = quantise(adaptation.adapted, some.switches, some.codes, recipe.width, recipe.table_bits)
            predicted = integers.scores(rows.switches, rows.codes).argmax(axis=1)
            hits = decided(predicted[np.newaxis], trial)[0] == truth
            correct.append(int(np.count_nonzero(hits & tested)))
        found += [(tuple(correct), int(np.count_nonzero(tested)))] if correct else []
    return found


def chosen_strength(hits: Sequence[Hits], folds: int, seed: int) -> tuple[float, list[Recognised]]:
    """Return the strength for the people left out in folds, and the accuracy of each with the strength that suits the
    others; none of too few people.
    """
    if len(hits) < _LEAST_PEOPLE:
        return STRENGTH, []
    rate = after_adaptation(hits)
    low, high = round(rate.low, 6), round(rate.high, 6)
    recognised = Recognised("nested", folds, seed, rate.correct[0], rate.total, rate.of, rate.unit, low, high)
    return STRENGTHS[_best(hits)], [recognised]


def after_adaptation(hits: Sequence[Hits]) -> Rate:
    """Return the accuracy of people, from the effects of all STRENGTHS: of each with the one that suits the others."""
    return of_people(hits, _chosen_by_others(hits), "new subject after adaptation")


def of_people(hits: Sequence[Hits], numbers: Sequence[int], of: Of) -> Rate:
    """Return the accuracy of people, each with the try of this number."""
    totals = [total for _, total in hits]
    correct = [own[number] for number, (own, _) in zip(numbers, hits, strict=True)]
    right, total, (low, high) = sum(correct), sum(totals), clustered(correct, totals, "trials")
    return Rate(of, "trials", (right,), total, len(hits), right / total, low, high)


def _chosen_by_others(hits: Sequence[Hits]) -> list[int]:
    """Return for each person the number of the strength that suits the others; the usual one, if they are too few."""
    usual, few = STRENGTHS.index(STRENGTH), len(hits) < _LEAST_PEOPLE
    return [usual if few else _best([*hits[:person], *hits[person + 1 :]]) for person in range(len(hits))]


def _best(hits: Sequence[Hits]) -> int:
    """Return the number of the strength for these people: the usual one, unless another recognises a hundredth of the
    trials more. Less is chance, with a few people.
    """
    counts, usual = np.sum([correct for correct, _ in hits], axis=0), STRENGTHS.index(STRENGTH)
    best = int(counts.argmax())
    return best if _LEAST_GAIN * (counts[best] - counts[usual]) > sum(total for _, total in hits) else usual


class AdaptedRow(msgspec.Struct, frozen=True):
    """The accuracy of people left out, 0..1, after `own` trials a type of theirs: the mean over people with its 95 %
    interval (Student's t; None with one person), and each person.
    """

    own: int
    mean: float
    low: float | None
    high: float | None
    people: tuple[float, ...]

    @property
    def title(self) -> str:
        """What the accuracy is of."""
        return f"new subject, after {counted(self.own, 'own trial')} a type" if self.own else "new subject"


class WearerStudy(msgspec.Struct, frozen=True):
    """The result: what was trained, the number of trials that were tested, and the rows."""

    recipe: RecipeWords
    trials: int
    rows: tuple[AdaptedRow, ...]


def study_wearers(
    grasp_set: GraspSet, recipe: Recipe, numbers: Sequence[int], jobs: int = -1, progress: Report | None = None
) -> WearerStudy:
    """Evaluate adaptation on people left out: the first trials of each of their types adapt, the rest are tested.

    Each is adapted to with the strength that suits the others, as they are left out.

    Parameters
    ----------
    grasp_set : GraspSet
        Recordings of two or more subjects.
    recipe : Recipe
        How to place and train.
    numbers : sequence of int
        The numbers of own trials of each type; 0: the model of the others as it is.
    jobs : int
        Worker processes; the result does not depend on their number.
    progress : callable, optional
        Called with (done, total) after each subject.

    Raises
    ------
    EvaluationError
        If there is only one subject, or nobody has more trials than the largest number.
    """
    samples, folds = Samples.of(grasp_set, recipe.inputs), leave_one_out(grasp_set.subjects, "subject")
    groups = grasp_set.subjects if len(folds) > 2 else None
    hits: dict[str, list[Hits]] = {}
    for name, found in in_workers(partial(_left_out, samples, groups, recipe, numbers), folds, jobs):
        hits[name] = found
        if progress is not None:
            progress(len(hits), len(folds))
    people = [person for fold in folds for person in hits[fold.name]]
    if not people:
        raise EvaluationError(f"nobody has more than {max(numbers)} trials of a type: adapt to fewer")
    totals = [total for _, total in people]
    counts = np.reshape([correct for correct, _ in people], (len(people), len(numbers), len(STRENGTHS)))
    # The strength is chosen once, for all numbers.
    sums = zip(map(tuple, counts.sum(axis=1).tolist()), [len(numbers) * total for total in totals], strict=True)
    strengths, rows = _chosen_by_others([*sums]), []
    for number, own in enumerate(numbers):
        rates = (counts[np.arange(len(people)), number, strengths] / totals).tolist()
        low, high = (min(1.0, max(0.0, end)) for end in student(rates)) if len(rates) > 1 else (None, None)
        rows.append(AdaptedRow(own, fmean(rates), low, high, tuple(rates)))
    return WearerStudy(RecipeWords.of(recipe), sum(totals), tuple(rows))


def _left_out(
    samples: Samples, groups: NDArray[np.str_] | None, recipe: Recipe, numbers: Sequence[int], fold: Fold
) -> tuple[str, list[Hits]]:
    recogniser = Recogniser.fit(samples, recipe, fold.train, groups=groups)
    return fold.name, hits_of(recogniser, samples.rows(fold.test), [*product(numbers, STRENGTHS)])
