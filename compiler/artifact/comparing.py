"""`compare_builds`: two builds on the same trials."""

from pathlib import Path

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.build import Build

from ..evaluation.rates import Paired, Rate, paired_interval
from ..recogniser import predicted_classes
from ..recordings.graspset import GraspSet
from ..samples import decided, select_inputs
from ..trainers.base import Report
from . import CompileError
from .training import trained_on


class TypeCounts(Struct, frozen=True):
    """How many trials of a grasp type there are, and how many each build recognises."""

    grasp: str
    trials: int
    a: int
    b: int


class ChangedTrial(Struct, frozen=True):
    """A trial, as the recordings number it, that two builds take for different grasp types."""

    subject: str
    object: str
    trial: int
    recorded: str
    a: str
    b: str


class BuildComparison(Struct, frozen=True, kw_only=True):
    """Two builds, a and b, on `trials` trials of grasps; `of` says whether they were trained on these.

    a, b         trials that each recognises, by the majority of their frames
    ends         the 95 % intervals of both accuracies
    difference   of the accuracies, b less a, -1..1; low, high: its 95 % interval
    better       trials that b alone recognises; worse: trials that a alone recognises
    p            McNemar's exact test, two-sided
    types        the same counts of each grasp type; changed: the trials that the builds take for different types
    """

    of: str
    trials: int
    a: int
    b: int
    ends: tuple[tuple[float, float], tuple[float, float]]
    difference: float
    low: float
    high: float
    better: int
    worse: int
    p: float
    types: tuple[TypeCounts, ...]
    changed: tuple[ChangedTrial, ...]


def compare_builds(
    a: str | Path, b: str | Path, grasp_set: GraspSet, progress: Report | None = None
) -> BuildComparison:
    """Compare two builds, which may read different sensors, on the trials of recordings.

    Trials that a build was trained on are left out, if there are others.

    Parameters
    ----------
    a, b : path
        The builds.
    grasp_set : GraspSet
        Recordings with the inputs of both. Rows of nothing held are left out.
    progress : callable, optional
        Called with (done, total) after each build.

    Returns
    -------
    BuildComparison
        The paired difference with its interval, by type, and the trials that changed.

    Raises
    ------
    BuildError, FormatError
        If a folder is not a valid build.
    CompileError
        If the recordings lack inputs of a build, or have no grasps.

    Examples
    --------
    >>> from thenar.compiler import GraspSet, compare_builds, compile_build
    >>> grasp_set = GraspSet.load("set.grasps")
    >>> folders = [compile_build(grasp_set, name, rounds=5, folds=0).folder for name in ("a", "b")]
    >>> compare_builds(*folders, grasp_set).difference
    0.0
    """
    held = grasp_set.without_none()
    if not len(held):
        raise CompileError("the recordings have no grasps: there is nothing to compare")
    guesses, seen = [], []
    _, first, trial = np.unique(held.trial_ids, return_index=True, return_inverse=True)
    for done, folder in enumerate((a, b), 1):
        build = Build.load(folder)
        try:
            inputs = select_inputs(held, build.manifest)
        except CompileError as reason:
            raise CompileError(f"{folder}: {reason}") from reason
        predicted = predicted_classes(build.tables, build.manifest.rejection, *inputs)
        guesses.append(np.array(build.classes)[decided(predicted[np.newaxis], trial)[0]])
        # Of a set with nothing held, the trials of grasps.
        seen.append(trained_on(build.manifest, grasp_set)[np.unique(grasp_set.trial_ids[~grasp_set.is_none])])
        if progress is not None:
            progress(done, 2)
    chosen, of = _chosen(*seen)
    first, truth, names_a, names_b = (each[chosen] for each in (first, held.grasps[first], *guesses))
    right_a, right_b = names_a == truth, names_b == truth
    subjects = np.unique(held.subjects[first], return_inverse=True)[1]
    low, high = paired_interval(right_b.astype(np.intp) - right_a, subjects)
    paired = Paired.of(right_b[np.newaxis], right_a[np.newaxis], "a")
    return BuildComparison(
        of=of,
        trials=len(truth),
        a=int(right_a.sum()),
        b=int(right_b.sum()),
        ends=(_ends(right_a, subjects), _ends(right_b, subjects)),
        difference=paired.difference,
        low=low,
        high=high,
        better=paired.better,
        worse=paired.worse,
        p=paired.p,
        types=tuple(
            TypeCounts(str(grasp), *(int(np.count_nonzero(truth[those] == grasp)) for those in (..., right_a, right_b)))
            for grasp in np.unique(truth)
        ),
        changed=tuple(
            ChangedTrial(
                str(held.subjects[row]),
                str(held.objects[row]),
                int(held.trials[row]),
                *map(str, (truth[place], names_a[place], names_b[place])),
            )
            for place, row in enumerate(first.tolist())
            if names_a[place] != names_b[place]
        ),
    )


def _ends(right: NDArray[np.bool_], subjects: NDArray[np.intp]) -> tuple[float, float]:
    """Return the 95 % interval of the share of trials (T,) that are `right`, of these subjects (T,)."""
    rate = Rate.predicted(right, np.ones(len(right), bool), np.arange(len(right)), of="new subject", groups=subjects)
    return rate.low, rate.high


def _chosen(seen_a: NDArray[np.bool_], seen_b: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], str]:
    """Return which trials (T,) to compare on, and what they are, in words."""
    new = ~(seen_a | seen_b)
    if new.any():
        return new, "trials that neither build was trained on"
    whose = "one build or both were"
    for mine, others, words in ((seen_a, seen_b, "the first build was"), (seen_b, seen_a, "the second build was")):
        if mine.all() and not others.any():
            whose = words
    if (seen_a & seen_b).all():
        whose = "both builds were"
    return np.ones(len(new), bool), f"trials that {whose} trained on"
