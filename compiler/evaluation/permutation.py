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
from .plan import ANGLE, ANGLE_SELECTED, SELECTED, Composition, Data, Planner, Progress, predictions, ways_of
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


def permuted(
    grasp_set: GraspSet,
    parts: tuple[Population, ...],
    scheme: Scheme,
    placer: Placer,
    words: RecipeWords,
    m: int,
    jobs: int,
    progress: Progress,
) -> Permuted:
    """Return the test of an evaluation, of m > 0 permutations, with selected switches and joints as far as the set has
    them; `parts` are the populations of the true labels.
    """
    kind = ANGLE_SELECTED if grasp_set.joints else SELECTED
    kind = kind if grasp_set.element_names else ANGLE
    tasks = [(grasp_set, parts, scheme, placer, kind, number) for number in range(m + 1)]
    correct, total = _counted(tasks[0])
    shuffled = []
    for count, _ in in_workers(_counted, tasks[1:], jobs):
        shuffled.append(count)
        progress(len(shuffled), m)
    return Permuted(
        composition=f"{kind.name} {kind.what}",
        recipe=words,
        of=OF[scheme],
        unit="trials",
        rate=correct / total,
        permutations=m,
        chance=sum(shuffled) / m / total,
        highest=max(shuffled) / total,
        p=(sum(count >= correct for count in shuffled) + 1) / (m + 1),
    )


def _counted(task: tuple[GraspSet, tuple[Population, ...], Scheme, Placer, Composition, int]) -> tuple[int, int]:
    """Return the number of trials that a permutation (0: the true labels) predicts correctly, and the total."""
    grasp_set, parts, scheme, placer, kind, number = task
    recipe = placer.recipe
    made = shuffled_labels(grasp_set, (recipe.seed, number)) if number else grasp_set
    if scheme == "trial":
        parts = populations(made, scheme, recipe.folds, 1, recipe.seed)
    planner = Planner(parts, Samples.of(made), placer)
    cells = [planner.cell(part, kind, partial(planner.own, NESTED)) for part in parts]
    cells = [replace(cell, runs=cell.runs[:1]) for cell in cells]
    data, training, ways = Data.of(made), Training.of(recipe), ways_of(recipe)
    found = {fit: predictions(data, fit, training, ways) for cell in cells for fit in cell.fits}
    grasps = tuple(np.unique(made.labels).tolist())
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
