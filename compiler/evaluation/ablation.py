"""Ablation: the change in accuracy when an effect of a simulated scene is removed."""

from collections.abc import Iterable
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.recipe import PAPERS_TRAINER, Recipe

from ..placement.placement import Placer
from ..recordings.graspset import GraspSet
from ..samples import Samples, decided
from ..trainers.base import Training
from .plan import COMPOSITIONS, Data, Planner, Progress, run_fits
from .populations import populations
from .rates import Rate, rated

Bits = NDArray[np.bool_]
Labels = NDArray[np.intp]

FOLDS, ROUNDS, SEED = 4, 100, 1

# All switches, all joints, and both: no placement, so that only the effects matter.
_KINDS = {"switches": COMPOSITIONS[4], "joints": COMPOSITIONS[3], "both": COMPOSITIONS[0]}
_Z = 1.959963984540054  # of the normal distribution, for 95 %


class AccuracyChange(msgspec.Struct, frozen=True):
    """A difference of two accuracies on the same grasps, and its 95 % interval."""

    mean: float
    low: float
    high: float


class InputAccuracy(msgspec.Struct, frozen=True):
    """The accuracy with some inputs, by trials and by frames (None if each row is a trial), and the change in accuracy
    by trials when the effect is removed; None for the whole scene.
    """

    inputs: str
    rate: Rate
    frames: Rate | None
    change: AccuracyChange | None


class Variant(msgspec.Struct, frozen=True):
    """The scene without an effect, or the whole scene (`without` is None); us_a_grasp of processor time."""

    without: str | None
    rows: int
    unsettled: int
    us_a_grasp: float
    rates: tuple[InputAccuracy, ...]


class Ablation(msgspec.Struct, frozen=True):
    """The whole scene, and then the scene without each of its effects."""

    simulated: bool
    scene: str
    seed: int
    folds: int
    rounds: int
    variants: tuple[Variant, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Made:
    """Grasps of a scene without an effect, or of the whole scene (`without` is None), if they settled."""

    without: str | None
    grasp_set: GraspSet
    unsettled: int
    us_a_grasp: float


def ablated(
    made: Iterable[Made], n_variants: int, n_subjects: int, jobs: int = -1, progress: Progress | None = None
) -> tuple[Variant, ...]:
    """Return the effect of each effect of a scene on the accuracy for each subject's own grasps.

    LogitBoost is cross-validated within each subject. The whole scene is the first of `made`; `progress` counts the
    fits, n_subjects for each of n_variants. Raises EvaluationError for too few repetitions to cross-validate.
    """
    count = len(_KINDS) * FOLDS * n_subjects
    found: list[Variant] = []
    whole: tuple[GraspSet, dict[str, Labels]] | None = None
    for number, one in enumerate(made):
        report = None if progress is None else _further(progress, number * count, n_variants * count)
        grasps = one.grasp_set.without_none()
        predicted = _predicted(grasps, jobs, report)
        rates = tuple(_recognised(name, grasps, predicted, whole) for name in predicted)
        found.append(Variant(one.without, len(grasps), one.unsettled, one.us_a_grasp, rates))
        whole = whole or (grasps, predicted)
    return tuple(found)


def _further(progress: Progress, before: int, total: int) -> Progress:
    return lambda done, _: progress(before + done, total)


def _predicted(grasp_set: GraspSet, jobs: int, progress: Progress | None) -> dict[str, Labels]:
    """Return, for each kind of inputs, the label (n,) predicted for each row when it was left out of training."""
    parts = populations(grasp_set, "trial", FOLDS, repeats=1, seed=SEED)
    planner = Planner(parts, Samples.of(grasp_set), Placer(Recipe(trainer=PAPERS_TRAINER, seed=SEED)))
    fits = {
        name: [fit for part in parts for fit in planner.cell(part, kind, lambda *_: ()).fits]
        for name, kind in _KINDS.items()
    }
    everything = [fit for some in fits.values() for fit in some]
    training = Training("logitboost", {"rounds": ROUNDS})
    found = run_fits(Data.of(grasp_set), everything, training, jobs, progress)
    predicted = {name: np.zeros(len(grasp_set), dtype=np.intp) for name in fits}
    for name, some in fits.items():
        for fit in some:
            predicted[name][fit.fold.test] = found[fit]
    return predicted


def _recognised(
    name: str, grasp_set: GraspSet, predicted: dict[str, Labels], whole: tuple[GraspSet, dict[str, Labels]] | None
) -> InputAccuracy:
    rates = rated(predicted[name], grasp_set.labels, grasp_set.trial_ids, of="within subject")
    if whole is None:
        return InputAccuracy(name, *rates, None)
    now, before = _hits(grasp_set, predicted[name]), _hits(whole[0], whole[1][name])
    # A grasp may have settled in only one of the two.
    same = [key for key in now if key in before]
    change = change_of(np.array([now[key] for key in same]), np.array([before[key] for key in same]))
    return InputAccuracy(name, *rates, change)


def _hits(grasp_set: GraspSet, predicted: Labels) -> dict[tuple[str, int], bool]:
    """Return which trials, by subject and number, were recognised."""
    trial = grasp_set.trial_ids
    _, first = np.unique(trial, return_index=True)
    hits = decided(predicted[np.newaxis], trial)[0] == grasp_set.labels[first]
    keys = zip(grasp_set.subjects[first].tolist(), grasp_set.trials[first].tolist(), strict=True)
    return dict(zip(keys, hits.tolist(), strict=True))


def change_of(now: Bits, before: Bits) -> AccuracyChange:
    """Return the change in accuracy on the same m > 0 grasps, recognised `now` and `before`, with its 95 % interval.

    The interval is for a difference of paired proportions, with half a grasp added to each cell of the 2 x 2 table
    (Agresti and Min 2005, Statistics in Medicine 24:729-740). It covers the choice of grasps, not the cut into folds.
    """
    gained = float(np.count_nonzero(now & ~before))
    lost = float(np.count_nonzero(before & ~now))
    m = len(now) + 2.0
    middle = (gained - lost) / m
    reach = _Z * ((gained + lost + 1.0) / m - middle * middle) ** 0.5 / m**0.5
    mean = (gained - lost) / len(now)
    return AccuracyChange(mean, max(-1.0, min(mean, middle - reach)), min(1.0, max(mean, middle + reach)))
