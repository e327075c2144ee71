"""`compare_builds`: two builds on the same trials."""

from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import numpy as np

from thenar.runtime.build import Build

from ..evaluation.rates import Rate, _quantile
from ..recogniser import predicted_classes
from ..recordings.graspset import GraspSet
from ..samples import decided, select_inputs
from .training import trained_on


@dataclass(frozen=True)
class BuildComparison:
    difference: float
    low: float
    high: float
    rates: tuple[Rate, Rate]
    by_type: tuple[tuple[str, int, int, int], ...]
    changed: tuple[tuple[int, str, str, str], ...]


def compare_builds(a: Path, b: Path, grasp_set: GraspSet) -> BuildComparison | None:
    """Return the comparison on the trials that neither was trained on."""
    builds = [Build.load(path) for path in (a, b)]
    seen = np.any([trained_on(build.manifest, grasp_set) for build in builds], axis=0)
    trial = np.unique(grasp_set.trial_ids, return_inverse=True)[1]
    grasp_set = grasp_set.rows(~seen[trial])
    if not len(grasp_set):
        return None
    names, trial = np.unique(grasp_set.trial_ids, return_inverse=True)
    first = np.unique(trial, return_index=True)[1]
    truth = grasp_set.grasps[first]
    read = []
    for build in builds:
        bits, codes = select_inputs(grasp_set, build.manifest)
        rows = predicted_classes(build.tables, build.manifest.rejection, bits, codes)
        read.append(np.array(build.classes)[decided(rows[np.newaxis], trial)[0]])
    hits = [one == truth for one in read]
    people = np.unique(grasp_set.subjects[first], return_inverse=True)[1]
    clusters = people if people.any() else np.arange(len(truth))
    gained = hits[1].astype(float) - hits[0]
    mean, size = float(gained.mean()), clusters.max() + 1
    sums = np.bincount(clusters, gained - mean)
    reach = _quantile(size - 1) * sqrt(size / (size - 1) * float(sums @ sums)) / len(truth) if size > 1 else 1.0
    labels = np.unique(truth, return_inverse=True)[1]
    rates = tuple(
        Rate.predicted(np.where(hit, labels, -1), labels, np.arange(len(labels)), of="new subject", groups=people)
        for hit in hits
    )
    by_type = tuple(
        (str(name), int((truth == name).sum()), *(int(hit[truth == name].sum()) for hit in hits))
        for name in np.unique(truth)
    )
    changed = np.flatnonzero(read[0] != read[1])
    return BuildComparison(
        mean,
        mean - reach,
        mean + reach,
        rates,
        by_type,
        tuple((int(names[one]), str(truth[one]), str(read[0][one]), str(read[1][one])) for one in changed),
    )
