"""Permutation test: the accuracy of the same evaluation with shuffled labels, and how rarely it is as high."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from thenar.runtime.manifest import Of, Unit

from ..placement.placement import Placer
from ..recordings.graspset import GraspSet
from ..samples import Samples
from ..trainers.base import Training
from ..workers import in_workers
from .plan import ANGLE, ANGLE_SELECTED, SELECTED, Composition, Data, Planner, Progress, Ways, predictions
from .populations import NESTED, OF, Population, Scheme, groups_of, populations
from .rates import RecipeWords
from .tables import RateReader


@dataclass(frozen=True, slots=True)
class Permuted:
    """The accuracy of one composition under the nested protocol, one repeat, compared with shuffled labels.

    Labels are shuffled among the trials of each subject, keeping frames of a trial together; then folds are cut,
    placements chosen and classifiers trained as with the true labels.

    composition   its name and inputs             of, unit  what the accuracy is of
    rate          with the true labels            chance    mean accuracy of the permutations
    permutations  their number, m                 highest   their highest accuracy
    p             (b + 1) / (m + 1), where b permutations reach the accuracy: the probability of it by chance
    """

    composition: str
    recipe: RecipeWords
    of: Of
    unit: Unit
    rate: float
    permutations: int
    chance: float
    highest: float
    p: float

    def __str__(self) -> str:
        """Return accuracy, chance level and p-value in a sentence."""
        return (
            f"Permutation test of {self.composition}, {self.of}, {self.unit}, nested ({self.recipe}): "
            f"{100 * self.rate:.1f} %; chance "
            f"{100 * self.chance:.1f} % (mean of {self.permutations} shuffles of labels within subjects, highest "
            f"{100 * self.highest:.1f} %); p = {self.p:.2g}"
        )


@dataclass(frozen=True, slots=True)
class Permutations:
    """The evaluation to repeat m times, of a study; parts are the populations of the true labels."""

    parts: tuple[Population, ...]
    scheme: Scheme
    placer: Placer
    training: Training
    ways: Ways
    words: RecipeWords

    def test(self, grasp_set: GraspSet, m: int, jobs: int, progress: Progress | None) -> Permuted:
        """Return the test with selected switches and joints, as far as the set has them; m > 0."""
        kind = ANGLE_SELECTED if grasp_set.joints else SELECTED
        kind = kind if grasp_set.element_names else ANGLE
        tasks = [(self, grasp_set, kind, number) for number in range(m + 1)]
        correct, total = _counted(tasks[0])
        shuffled = []
        for count, _ in in_workers(_counted, tasks[1:], jobs):
            shuffled.append(count)
            if progress is not None:
                progress(len(shuffled), m)
        return Permuted(
            composition=f"{kind.name} {kind.what}",
            recipe=self.words,
            of=OF[self.scheme],
            unit="trials",
            rate=correct / total,
            permutations=m,
            chance=sum(shuffled) / m / total,
            highest=max(shuffled) / total,
            p=(sum(count >= correct for count in shuffled) + 1) / (m + 1),
        )


def _counted(task: tuple[Permutations, GraspSet, Composition, int]) -> tuple[int, int]:
    """Return the number of trials that a permutation (0: the true labels) predicts correctly, and the total."""
    how, grasp_set, kind, number = task
    recipe = how.placer.recipe
    made = shuffled_labels(grasp_set, (recipe.seed, number)) if number else grasp_set
    parts = populations(made, "trial", recipe.folds, 1, recipe.seed) if how.scheme == "trial" else how.parts
    planner = Planner(parts, Samples.of(made), how.placer)
    cells = [planner.cell(part, kind, partial(planner.own, NESTED)) for part in parts]
    cells = [replace(cell, runs=cell.runs[:1]) for cell in cells]
    data = Data.of(made)
    found = {fit: predictions(data, fit, how.training, how.ways) for cell in cells for fit in cell.fits}
    grasps = tuple(np.unique(made.labels).tolist())
    scheme = how.scheme
    groups = groups_of(made, scheme)
    reader = RateReader(made.labels, made.trial_ids, grasps, found, frozenset(), OF[scheme], groups)
    rate, _ = reader.rates(cells)
    return rate.correct[0], rate.total


def shuffled_labels(grasp_set: GraspSet, seed: tuple[int, ...]) -> GraspSet:
    """Return the set with its grasp types shuffled among the trials of each subject; trials stay whole."""
    random = np.random.default_rng(seed)
    trial = grasp_set.trial_ids
    _, first = np.unique(trial, return_index=True)
    subjects, grasps = grasp_set.subjects[first], grasp_set.grasps[first]
    for subject in np.unique(subjects):
        mine = np.flatnonzero(subjects == subject)
        grasps[mine] = grasps[random.permutation(mine)]
    # The trial number keeps two trials apart that get the same label.
    return replace(grasp_set, grasps=grasps[trial], trials=trial)
