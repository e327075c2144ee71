"""Accuracies: what each is of, whether it counts trials or frames, its 95 % interval, and the optimism of the best of
many.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import sqrt
from statistics import fmean, stdev
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thenar.runtime.manifest import Of, Unit, fit_name
from thenar.runtime.names import list_names
from thenar.runtime.recipe import AUTO, Recipe

from ..samples import decided
from ..text import DASH, counted
from ..trainers.base import Training

UNITS: tuple[Unit, ...] = ("trials", "frames")

LEVEL = 0.95
_Z = 1.959963984540054  # the normal distribution's quantile of (1 + LEVEL) / 2

# Prior for the similarity of two units of one cluster (intracluster correlation), frames of a trial or trials of a
# subject, and its weight in misses.
ALIKE: dict[Unit, float] = {"frames": 0.6, "trials": 0.3}
WEIGHT = 0.5

# Random draws of units.
DRAWS = 1000
# For up to this many units, every possible draw is used once instead of random draws.
_FEW = 4
# Units whose hits are summed at a time.
_BLOCK = 2048

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class RecipeWords:
    """What rates are of: the placement method and the trainer, each with its settings, in words."""

    method: str
    trainer: str

    @classmethod
    def of(cls, recipe: Recipe) -> Self:
        """Return the words for classifiers that all have the same placement and trainer."""
        training, trainer = Training.of(recipe), "chosen from the training rows"
        if recipe.trainer != AUTO:
            trainer = fit_name(training.trainer, training.settings)
        return cls(placement_words(recipe), trainer)

    def __str__(self) -> str:
        """Return "placement: id3, S = 0; trainer: logit, penalty 1"."""
        return f"placement: {self.method}; trainer: {self.trainer}"


@dataclass(frozen=True, slots=True)
class Rate:
    """The share of correct units, and its 95 % interval.

    of       which units: of all subjects pooled, of a subject that was also trained on, or of a subject, an object or a
             session that was left out
    unit     what is counted: trials, each decided by the majority of its frames, or single frames
    correct  correct units in each repeat           mean       in 0..1
    total    units of one repeat                    low, high  the 95 % interval of the mean
    over     the number of clusters: trials; for `new ...`, subjects, objects or sessions if there are several

    If each unit is a separate cluster, the interval is Wilson's (E. B. Wilson 1927):

        (p + z^2/2n +- z sqrt(p (1 - p)/n + z^2/4n^2)) / (1 + z^2/n)        with n = total, z = 1.96

    Units of one cluster (frames of a trial, trials of a left out subject) are correlated. Then n is total / d, and z is
    Student's t with over - 1 degrees of freedom (as Korn and Graubard 1998, Survey Methodology 24). The design effect d
    is the cluster-robust variance of p over p (1 - p) / total, at least 1. Few misses carry little information on d: so
    it is averaged with that of a correlation of ALIKE within clusters, weighted as WEIGHT misses.
    `benchmarks/intervals.py` shows how often the interval covers the truth.

    Repeats share their units: the interval is over the units' means. It also contains Student's interval over the
    repeats, or over random draws if there are several, which reflects the influence of folds and draws.
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
            The label predicted for each row in each of r repeats.
        labels, trials : array of int, shape (n,)
            Each row's true label, and its trial. Rows of a trial have the same label.
        of : str
            What the accuracy is of.
        unit : str
            What to count. The label of a trial is that of most of its frames, the lowest of several.
        groups : array, shape (n,), optional
            The subject, object or session of each row, if `of` is of new ones: the interval is over those, if there
            are several.
        repeats_a_draw : int
            The number of consecutive repeats that belong to one random draw.

        Raises
        ------
        ValueError
            If there are no rows, or the shapes do not match.
        """
        guesses, truth = np.atleast_2d(np.asarray(predicted)), np.asarray(labels)
        _, first, trial = np.unique(np.asarray(trials), return_index=True, return_inverse=True)
        if not truth.size or guesses.shape[1:] != truth.shape or trial.shape != truth.shape:
            shapes = f"predictions {guesses.shape} of {truth.size} rows with {trial.size} trials"
            raise ValueError(f"{shapes} do not give a rate")
        clusters: Rows = trial
        alike: Unit = "frames"
        if groups is not None and (number := np.unique(np.asarray(groups), return_inverse=True)[1]).any():
            clusters, alike = number, "trials"
        if unit == "trials":
            guesses, truth, clusters = decided(guesses, trial), truth[first], clusters[first]
        hits = guesses == truth
        correct, sizes = tuple(hits.sum(axis=1).tolist()), np.bincount(clusters)
        recognised = np.bincount(clusters, weights=hits.sum(axis=0)).astype(np.intp)
        bounds = clustered(recognised.tolist(), sizes.tolist(), alike, len(hits))
        return cls._around(of, unit, correct, len(truth), len(sizes), bounds, repeats_a_draw)

    @classmethod
    def counted(cls, correct: tuple[int, ...], total: int, *, of: Of, repeats_a_draw: int = 1) -> Self:
        """Return the rate of `correct` trials of `total` in each repeat, with each trial as a separate cluster.

        Raises ValueError unless 0 <= correct <= total > 0.
        """
        if not correct or total < 1 or not all(0 <= count <= total for count in correct):
            raise ValueError(f"{correct} correct of {total} trials do not give a rate")
        wilson = _wilson(sum(correct) / (len(correct) * total), total, _Z)
        return cls._around(of, "trials", correct, total, total, wilson, repeats_a_draw)

    @classmethod
    def _around(
        cls,
        of: Of,
        unit: Unit,
        correct: tuple[int, ...],
        total: int,
        over: int,
        bounds: tuple[float, float],
        repeats_a_draw: int,
    ) -> Self:
        """Return the rate whose interval contains `bounds`, Student's interval over the draws, and the mean."""
        mean = sum(correct) / (len(correct) * total)
        ends = [mean, *bounds]
        starts = range(0, len(correct), repeats_a_draw)
        if len(starts) > 1:
            ends += student([fmean(correct[i : i + repeats_a_draw]) / total for i in starts])
        return cls(of, unit, correct, total, over, mean, max(0.0, min(ends)), min(1.0, max(ends)))

    def corrected(self, luck: float) -> Self:
        """Return the rate of the best of many, corrected for selection. The upper end of its interval stays: the
        optimism is an estimate, and models trained on all rows do a little better than those of the folds.
        """
        return replace(self, mean=max(self.mean - luck, 0.0), low=max(self.low - luck, 0.0))

    @property
    def what(self) -> str:
        """What the accuracy is of, and its unit: "new subject, trials"."""
        return f"{self.of}, {self.unit}"

    def __str__(self) -> str:
        """Return "73.1 [55.2, 86.0] % new subject, trials"."""
        return f"{interval(self)} % {self.what}"


def interval(rate: Rate | None) -> str:
    """Return "96.3 [95.1, 97.2]", in percent; a dash for no rate."""
    return DASH if rate is None else f"{100 * rate.mean:.1f} [{100 * rate.low:.1f}, {100 * rate.high:.1f}]"


def placement_words(options: Recipe) -> str:
    """Return a placement method with its settings and limits in words: "elimination, keep 16, the best 3 joints"."""
    words = [options.placement, f"S = {options.prune}" if options.keep is None else f"keep {options.keep}"]
    if options.sensors is not None or options.price is not None:
        number = "sensors" if options.sensors is None else counted(options.sensors, "sensor")
        words = [f"the best {number}" + ("" if options.price is None else f" for a price of {options.price:g}")]
    words += [] if options.keep_joints is None else [f"the best {counted(options.keep_joints, 'joint')}"]
    words += [f"with {list_names(options.have)}"] if options.have else []
    words += [f"without {list_names(options.never)}"] if options.never else []
    words += [] if options.apart_mm is None else [f"{options.apart_mm:g} mm apart"]
    words += [] if options.at_most_taxels is None else [f"at most {counted(options.at_most_taxels, 'taxel')}"]
    words += [] if options.budget_us is None else [f"within {options.budget_us:g} µs"]
    return ", ".join([*words, *(["robust"] if options.robust else [])])


def rated(
    predicted: ArrayLike,
    labels: ArrayLike,
    trials: ArrayLike,
    *,
    of: Of,
    groups: ArrayLike | None = None,
    repeats_a_draw: int = 1,
) -> tuple[Rate, Rate | None]:
    """Return the accuracy by trials, and by frames if a trial has several; arguments as in Rate.predicted."""
    by_trial, by_frame = (
        Rate.predicted(predicted, labels, trials, of=of, unit=unit, groups=groups, repeats_a_draw=repeats_a_draw)
        for unit in UNITS
    )
    return by_trial, by_frame if by_frame.total > by_trial.total else None


@dataclass(frozen=True, slots=True)
class Paired:
    """Two recognisers compared on the same m trials.

    than        the other recogniser
    difference  of the accuracies, -1..1
    better      trials that are correct in more repeats than with the other; worse: in fewer
    p           probability of a split at least as uneven if both are equal: McNemar's exact test, two-sided. It is for
                these people: trials of a person are correlated, so it says less about new people.
    """

    than: str
    difference: float
    better: int
    worse: int
    p: float

    @classmethod
    def of(cls, hits: NDArray[np.bool_], others: NDArray[np.bool_], than: str) -> Self:
        """Return the comparison of `hits` (r, m), the correct trials in each of r repeats, with `others`."""
        from scipy.special import bdtr

        gained = hits.sum(axis=0, dtype=np.intp) - others.sum(axis=0, dtype=np.intp)
        better, worse = int((gained > 0).sum()), int((gained < 0).sum())
        p = min(1.0, 2 * float(bdtr(min(better, worse), better + worse, 0.5))) if better + worse else 1.0
        return cls(than, float(gained.sum()) / hits.size, better, worse, p)

    def __str__(self) -> str:
        """Return "+0.8, p 0.02"."""
        return f"{100 * self.difference:+.1f}, p {self.p:.2g}"


def paired_interval(gained: Rows, clusters: Rows) -> tuple[float, float]:
    """Return the 95 % interval of the difference of two accuracies on the same n units.

    gained    (n,) 1: only the one recogniser is correct, -1: only the other, 0: both or none
    clusters  (n,) number of the group of each unit, 0 to C - 1, such as its subject; of no influence if there is one

    Half a unit is added to each of the four counts of right and wrong (A. Agresti and Y. Min 2005, Statistics in
    Medicine 24: 729). Units of a group are correlated. So the variance is multiplied by its cluster-robust estimate
    over the plain one, at least 1. Student's t with C - 1 degrees of freedom replaces the normal quantile.
    """
    n, total, unequal = len(gained), int(gained.sum()), int(np.count_nonzero(gained))
    sizes, sums = np.bincount(clusters).tolist(), np.bincount(clusters, gained).astype(np.intp).tolist()
    mean, over = total / (n + 2), len(sizes)
    variance, z = ((unequal + 1) / (n + 2) - mean * mean) / (n + 2), _Z
    if 1 < over < n:
        z = _quantile(over - 1)
        # Integers up to the final quotient: exact on every machine.
        squares = sum((n * part - size * total) ** 2 for part, size in zip(sums, sizes, strict=True))
        plain = (over - 1) * n * (n * unequal - total * total)
        variance *= max(1.0, over * squares / plain) if plain else 1.0
    reach = z * sqrt(variance)
    return max(-1.0, min(total / n, mean - reach)), min(1.0, max(total / n, mean + reach))


def clustered(recognised: list[int], sizes: list[int], unit: Unit, repeats: int = 1) -> tuple[float, float]:
    """Return the 95 % interval of a rate of units in clusters.

    `recognised` counts each cluster's correct units in all repeats together, `sizes` its units in one; units are the
    frames of trials, or the trials of subjects, objects or sessions.
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
    """Return how many units of two or more clusters are worth one independent unit; 1 or more."""
    n_clusters, total, hits = len(sizes), sum(sizes), sum(recognised)
    misses = repeats * total - hits
    prior = 1 + (total / n_clusters - 1) * ALIKE[unit]
    if not hits or not misses:
        return prior
    # Integers up to the final quotient: exact on every machine.
    squares = sum((correct * total - size * hits) ** 2 for correct, size in zip(recognised, sizes, strict=True))
    effect = max(1.0, n_clusters * squares / ((n_clusters - 1) * total * hits * misses))
    weight = min(hits, misses) / (repeats * effect)
    return (weight * effect + WEIGHT * max(prior, effect)) / (weight + WEIGHT)


def _wilson(p: float, n: float, z: float) -> tuple[float, float]:
    centre = p + z * z / (2 * n)
    reach = z * sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    shrink = 1 + z * z / n
    return (centre - reach) / shrink, (centre + reach) / shrink


def student(rates: list[float]) -> tuple[float, float]:
    """Return Student's 95 % interval of the mean of two or more numbers."""
    reach = _quantile(len(rates) - 1) * stdev(rates) / sqrt(len(rates))
    return fmean(rates) - reach, fmean(rates) + reach


def _quantile(freedom: int) -> float:
    from scipy.special import stdtrit

    return float(stdtrit(freedom, (1 + LEVEL) / 2))


@dataclass(frozen=True, slots=True, eq=False)
class Draws:
    """The accuracies of c contenders on the drawn units of b draws, (b, c), on the others, (b, c), and on all, (c,).

    Bootstrap bias correction of cross-validation, without retraining: units (trials, or subjects) are drawn with
    replacement. The contender that is best on the drawn units is evaluated on the others (BBC-CV: Tsamardinos,
    Greasidou and Borboudakis 2018, Machine Learning 107: 1895). Its mean loss of accuracy over the draws, compared with
    the accuracy of the overall best on all units, is the luck of that one.
    """

    drawn: Floats
    left: Floats
    every: Floats

    @classmethod
    def of(cls, hits: NDArray[np.intp], units: NDArray[np.intp], seed: int) -> "Draws":
        """Return the draws for `hits` (c, m), the correct predictions for each of m trials; `units` (m,) are drawn."""
        units = np.unique(units, return_inverse=True)[1]
        sizes = np.bincount(units)
        n = len(sizes)
        if n <= _FEW:
            chosen = np.indices((n,) * n).reshape(n, -1).T
        else:
            chosen = np.random.default_rng(seed).integers(n, size=(DRAWS, n))
        # How often each unit is drawn, (b, n).
        counts = np.array([np.bincount(draw, minlength=n) for draw in chosen], np.int32)
        sums = np.zeros((2, len(counts), len(hits)))
        correct = np.array([np.bincount(units, row) for row in hits]).T
        for start in range(0, n, _BLOCK):
            block = slice(start, start + _BLOCK)
            # Integers below 2^53: the sums are exact in any order.
            sums[0] += counts[:, block].astype(np.float64) @ correct[block]
            sums[1] += (counts[:, block] == 0).astype(np.float64) @ correct[block]
        drawn, left = counts @ sizes, (counts == 0) @ sizes
        judged = left > 0
        return cls(sums[0, judged] / drawn[judged, None], sums[1, judged] / left[judged, None], correct.sum(axis=0))

    def luck(self, costs: Floats, limits: Sequence[float]) -> list[float]:
        """Return, for each limit, the luck of the best contender (c,) with a lower cost; ties go to the cheapest."""
        order = np.argsort(costs, kind="stable")
        drawn, left, every = self.drawn[:, order], self.left[:, order], self.every[order]
        lucks = []
        for size in np.searchsorted(costs[order], limits).tolist():
            best, draws = every[:size].argmax(), np.arange(len(drawn))
            lucks.append(max(float((left[:, best] - left[draws, drawn[:, :size].argmax(axis=1)]).mean()), 0.0))
        return lucks
