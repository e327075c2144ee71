"""Accuracies: what each is of, whether it counts trials or frames, and its 95 % interval."""

from dataclasses import dataclass
from math import sqrt
from statistics import fmean, stdev
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thenar.runtime.manifest import Of, Unit

from ..samples import decided
from ..text import interval

UNITS: tuple[Unit, ...] = ("trials", "frames")

LEVEL = 0.95
_Z = 1.959963984540054  # the normal distribution's quantile of (1 + LEVEL) / 2

# Prior of how alike two units of one cluster are (intracluster correlation), frames of a trial or trials of a subject,
# and how many misses it weighs.
ALIKE: dict[Unit, float] = {"frames": 0.6, "trials": 0.3}
WEIGHT = 0.5

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Rate:
    """The share of units that were recognised, and its 95 % interval.

    of       which units: of all subjects pooled, of a subject that was also trained on, of a subject, an object or a
             session that was left out
    unit     what is counted: trials, each recognised as most of its frames are, or single frames
    correct  units recognised in each repeat        mean       in 0..1
    total    units of one repeat                    low, high  the 95 % interval of the mean
    over     how many clusters the interval is over: trials; of `new ...`, subjects, objects or sessions if several

    Where each unit is a cluster of its own, the interval is Wilson's (E. B. Wilson 1927):

        (p + z^2/2n +- z sqrt(p (1 - p)/n + z^2/4n^2)) / (1 + z^2/n)        with n = total, z = 1.96

    Units of one cluster (frames of a trial, trials of a left out subject) are alike. There n is total / d, and z is
    Student's t of over - 1 degrees of freedom (as Korn and Graubard 1998, Survey Methodology 24). The design effect d
    is the cluster-robust variance of p over p (1 - p) / total, at least 1. Few misses tell little about d: so it is
    averaged with that of a correlation of ALIKE within clusters, which weighs WEIGHT misses. `benchmarks/intervals.py`
    shows how often the interval covers the truth.

    Repeats share their units: the interval is over the units' means. It also holds Student's interval over the
    repeats, or over random draws where there are several, which says how much the cut into folds and the draw matter.
    """

    of: Of
    unit: Unit
    correct: tuple[int, ...]
    total: int
    over: int
    mean: float
    low: float
    high: float

    @classmethod
    def predicted(
        cls,
        predicted: ArrayLike,
        labels: ArrayLike,
        trials: ArrayLike,
        *,
        of: Of,
        unit: Unit = "trials",
        groups: ArrayLike | None = None,
        repeats_a_draw: int = 1,
    ) -> Self:
        """Return the rate of predictions of n rows.

        Parameters
        ----------
        predicted : array of int, shape (n,) or (r, n)
            The label that each row was given, in each of r repeats.
        labels, trials : array of int, shape (n,)
            Each row's true label, and its trial. Rows of a trial have one label.
        of : str
            What the rate is of.
        unit : str
            What to count. A trial is recognised as the label that most of its frames are given, the lowest of several.
        groups : array, shape (n,), optional
            The subject, object or session of each row, if `of` is of new ones: the interval is over those, if there
            are several.
        repeats_a_draw : int
            So many repeats in a row are of one random draw.

        Raises
        ------
        ValueError
            If there are no rows, or the shapes do not fit.
        """
        given, truth = np.atleast_2d(np.asarray(predicted)), np.asarray(labels)
        _, first, trial = np.unique(np.asarray(trials), return_index=True, return_inverse=True)
        if not truth.size or given.shape[1:] != truth.shape or trial.shape != truth.shape:
            raise ValueError(f"predictions {given.shape} of {truth.size} rows with {trial.size} trials are no rate")
        clusters: Rows = trial
        alike: Unit = "frames"
        if groups is not None and len(found := np.unique(np.asarray(groups), return_inverse=True)[1]) and found.max():
            clusters, alike = found, "trials"
        if unit == "trials":
            given, truth, clusters = decided(given, trial), truth[first], clusters[first]
        hits = given == truth
        correct, sizes = tuple(hits.sum(axis=1).tolist()), np.bincount(clusters)
        recognised = np.bincount(clusters, weights=hits.sum(axis=0)).astype(np.intp)
        bounds = clustered(recognised.tolist(), sizes.tolist(), alike, len(hits))
        return cls._held(of, unit, correct, len(clusters), len(sizes), bounds, repeats_a_draw)

    @classmethod
    def counted(cls, correct: tuple[int, ...], total: int, *, of: Of, repeats_a_draw: int = 1) -> Self:
        """Return the rate of `correct` trials of `total` in each repeat, each a cluster of its own.

        Raises ValueError unless 0 <= correct <= total > 0.
        """
        if not correct or total < 1 or not all(0 <= count <= total for count in correct):
            raise ValueError(f"{correct} recognised of {total} trials is no rate")
        wilson = _wilson(sum(correct) / (len(correct) * total), total, _Z)
        return cls._held(of, "trials", correct, total, total, wilson, repeats_a_draw)

    @classmethod
    def _held(
        cls,
        of: Of,
        unit: Unit,
        correct: tuple[int, ...],
        total: int,
        over: int,
        bounds: tuple[float, float],
        repeats_a_draw: int,
    ) -> Self:
        """Return the rate whose interval holds `bounds`, Student's over the draws, and the mean."""
        mean = sum(correct) / (len(correct) * total)
        ends = [mean, *bounds]
        starts = range(0, len(correct), repeats_a_draw)
        if len(starts) > 1:
            ends += student([fmean(correct[i : i + repeats_a_draw]) / total for i in starts])
        return cls(of, unit, correct, total, over, mean, max(0.0, min(ends)), min(1.0, max(ends)))

    @property
    def what(self) -> str:
        """What the rate is of, and its unit: "new subject, trials"."""
        return f"{self.of}, {self.unit}"

    def __str__(self) -> str:
        """Return "73.1 [55.2, 86.0] % new subject, trials"."""
        return f"{interval(self)} % {self.what}"


def rated(
    predicted: ArrayLike,
    labels: ArrayLike,
    trials: ArrayLike,
    *,
    of: Of,
    groups: ArrayLike | None = None,
    repeats_a_draw: int = 1,
) -> tuple[Rate, Rate | None]:
    """Return the rate of trials, and that of frames where a trial has several; arguments as Rate.predicted's."""
    by_trial, by_frame = (
        Rate.predicted(predicted, labels, trials, of=of, unit=unit, groups=groups, repeats_a_draw=repeats_a_draw)
        for unit in UNITS
    )
    return by_trial, by_frame if by_frame.total > by_trial.total else None


@dataclass(frozen=True, slots=True)
class Paired:
    """The same m trials by two recognisers.

    than        the other one
    difference  of the rates, -1..1
    better      trials that are recognised in more repeats than by the other; worse: in fewer
    p           how probable a split of these as uneven is where both are equal: McNemar's exact test, two-sided. It is
                of these people: trials of a person are alike, so of new people it tells less.
    """

    than: str
    difference: float
    better: int
    worse: int
    p: float

    @classmethod
    def of(cls, hits: NDArray[np.bool_], others: NDArray[np.bool_], than: str) -> Self:
        """Return the comparison of `hits` (r, m), which trials are recognised in each of r repeats, with `others`."""
        from scipy.special import bdtr

        gained = hits.sum(axis=0, dtype=np.intp) - others.sum(axis=0, dtype=np.intp)
        better, worse = int((gained > 0).sum()), int((gained < 0).sum())
        p = min(1.0, 2 * float(bdtr(min(better, worse), better + worse, 0.5))) if better + worse else 1.0
        return cls(than, float(gained.sum()) / hits.size, better, worse, p)

    def __str__(self) -> str:
        """Return "+0.8, p 0.02"."""
        return f"{100 * self.difference:+.1f}, p {self.p:.2g}"


def clustered(recognised: list[int], sizes: list[int], unit: Unit, repeats: int = 1) -> tuple[float, float]:
    """Return the 95 % interval of a rate of units in clusters: of each, how many were recognised in all repeats
    together, and how many there are in one; units are the frames of trials, or the trials of subjects or the like.
    """
    n_clusters, total, hits = len(sizes), sum(sizes), sum(recognised)
    mean = hits / (repeats * total)
    if n_clusters == total:
        return _wilson(mean, total, _Z)
    if n_clusters == 1:
        return _wilson(mean, 1, _Z)
    n = total / design_effect(recognised, sizes, unit, repeats)
    return _wilson(mean, n, _quantile(n_clusters - 1))


def design_effect(recognised: list[int], sizes: list[int], unit: Unit, repeats: int = 1) -> float:
    """Return how many units of two or more clusters tell as much as one independent unit; 1 or more."""
    n_clusters, total, hits = len(sizes), sum(sizes), sum(recognised)
    misses = repeats * total - hits
    prior = 1 + (total / n_clusters - 1) * ALIKE[unit]
    if not hits or not misses:
        return prior
    # In whole numbers up to the quotient: exact on every machine.
    squares = sum((own * total - size * hits) ** 2 for own, size in zip(recognised, sizes, strict=True))
    found = max(1.0, n_clusters * squares / ((n_clusters - 1) * total * hits * misses))
    weight = min(hits, misses) / (repeats * found)
    return (weight * found + WEIGHT * max(prior, found)) / (weight + WEIGHT)


def _wilson(p: float, n: float, z: float) -> tuple[float, float]:
    centre = p + z * z / (2 * n)
    reach = z * sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    shrink = 1 + z * z / n
    return (centre - reach) / shrink, (centre + reach) / shrink


def student(rates: list[float]) -> tuple[float, float]:
    """Return Student's 95 % interval of the mean of two numbers or more."""
    reach = _quantile(len(rates) - 1) * stdev(rates) / sqrt(len(rates))
    return fmean(rates) - reach, fmean(rates) + reach


def _quantile(freedom: int) -> float:
    from scipy.special import stdtrit

    return float(stdtrit(freedom, (1 + LEVEL) / 2))
