"""Learning curves: the accuracy after 2, 4, 8, ... repetitions of each grasp type by each person, and its
extrapolation.

The error after n repetitions is modelled as a + b n^-c with a, b >= 0: a power law with a floor that more recordings
cannot lower. It is fitted by weighted least squares over a grid of exponents. Since the law may not hold further on, it
is extrapolated to at most FURTHER times the largest number of repetitions, and only with at least LEAST points.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Of

from .folds import EvaluationError, Fold, Rows, leave_groups_out, trial_folds
from .luck import Draws
from .plan import CellPlan, Data, Planner, learners
from .populations import NESTED, Population, Scheme
from .rates import Rate, RecipeWords
from .tables import RateReader

Floats = NDArray[np.float64]

FURTHER, LEAST = (2, 4), 4
_EXPONENTS = np.arange(1, 61) / 30  # of n, from 1/30 to 2


@dataclass(frozen=True, slots=True)
class ExpectedAccuracy:
    """The accuracy expected after `repetitions` repetitions, from a fitted law, with its 95 % interval."""

    repetitions: int
    mean: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class LearningCurve:
    """The accuracies of a trainer or baseline after each number of repetitions, and those expected for more."""

    learner: str
    rates: tuple[Rate, ...]
    expected: tuple[ExpectedAccuracy, ...]


@dataclass(frozen=True, slots=True)
class Learning:
    """Learning curves of the same trials.

    inputs       inputs of the classifiers            of     what the accuracies are of
    repetitions  trials of each grasp type and person in training; the last uses all there are: their mean
    curves       one per trainer or baseline          note   why there is no extrapolation; "" if there is one
    """

    inputs: str
    of: Of
    repetitions: tuple[int, ...]
    curves: tuple[LearningCurve, ...]
    note: str
    recipe: RecipeWords

    @property
    def title(self) -> str:
        """The title of the curves."""
        return (
            f"Learning curves, {self.inputs}, nested: {self.of}, trials, by repetitions a grasp type and person; "
            f"{self.recipe}"
        )

    @property
    def further(self) -> tuple[int, ...]:
        """The numbers of repetitions for which the accuracy is extrapolated."""
        return tuple(each.repetitions for each in self.curves[0].expected)


@dataclass(frozen=True, slots=True)
class LearningPlan:
    """The fits of learning curves: for each learner a cell for each number of repetitions."""

    inputs: str
    of: Of
    repetitions: tuple[int, ...]
    cells: Mapping[str, tuple[CellPlan, ...]]

    @property
    def every(self) -> Iterator[CellPlan]:
        """All cells."""
        return (cell for cells in self.cells.values() for cell in cells)

    def read(self, reader: RateReader, groups: NDArray[np.str_] | None, seed: int, recipe: RecipeWords) -> Learning:
        """Return the curves; groups (n,) are the subjects, if those are left out."""
        enough, curves = len(self.repetitions) >= LEAST, []
        for learner, cells in self.cells.items():
            rates = tuple(reader.rates((cell,))[0] for cell in cells)
            hits = np.array([reader.hits((cell,)) for cell in cells])
            units = np.arange(hits.shape[2])
            if groups is not None:
                units = np.unique(groups[np.unique(reader.trials, return_index=True)[1]], return_inverse=True)[1]
            found = expected(self.repetitions, rates, hits, units, seed) if enough else ()
            curves.append(LearningCurve(learner, rates, found))
        note = f"The effect of more repetitions is not extrapolated from fewer than {LEAST} points: record more."
        return Learning(self.inputs, self.of, self.repetitions, tuple(curves), "" if enough else note, recipe)


def plan_learning(
    data: Data, subjects: NDArray[np.str_], planner: Planner, scheme: Scheme, n_folds: int, repeats: int
) -> LearningPlan:
    """Plan the fits: folds of everybody's trials, or a subject left out, with a limited number of training trials.

    The training trials of each type in a fold are put in random order and the first ones taken, so larger training sets
    of a curve contain the smaller ones. Raises EvaluationError for other schemes, or too few trials.
    """
    if scheme not in ("trial", "subject"):
        raise EvaluationError(
            f"a learning curve tests trials, or subjects left out, not {scheme}s left out: choose another scheme"
        )
    everyone = np.arange(len(data.labels))
    several = len(np.unique(subjects)) > 1
    numbers = np.unique(subjects, return_inverse=True)[1]
    parts = leave_groups_out(subjects, "subject") if scheme == "subject" else []
    cuts, counts = [], []
    for repeat in range(repeats):
        random = np.random.default_rng((planner.recipe.seed, repeat))
        place = random.permutation(int(data.trials.max()) + 1)
        for fold in parts or trial_folds(data.labels, data.trials, n_folds, planner.recipe.seed + repeat):
            rank, count = _ranks(data, numbers, fold.train, place)
            cuts.append((repeat, fold, rank))
            counts.append(count)
    most = round(float(np.mean(counts)))
    sizes = tuple(2**power for power in range(1, most.bit_length()) if 2**power < most)
    if not sizes:
        raise EvaluationError(f"a learning curve needs more than 2 repetitions to train on, and there are {most}")
    grasps = tuple(np.unique(data.labels).tolist())
    kind = planner.kinds[0]
    populations = []
    for size in (*sizes, None):
        folds = [
            (repeat, fold if size is None else Fold(fold.train[rank < size], fold.test, fold.name))
            for repeat, fold, rank in cuts
        ]
        runs = tuple(tuple(fold for own, fold in folds if own == repeat) for repeat in range(repeats))
        populations.append(Population("all", everyone, grasps, runs))
    chosen = partial(planner.own, NESTED)
    cells = {name: tuple(planner.cell(part, kind, chosen, name) for part in populations) for name in learners()}
    of: Of = "new subject" if scheme == "subject" else "pooled" if several else "within subject"
    return LearningPlan(f"{kind.name} {kind.what}", of, (*sizes, most), cells)


def _ranks(data: Data, subjects: Rows, rows: Rows, place: Rows) -> tuple[Rows, float]:
    """Return the rank (n,) of each row's trial among those of its type and subject, ordered by `place`, and the mean
    number of trials per type and subject.
    """
    trials, first, back = np.unique(data.trials[rows], return_index=True, return_inverse=True)
    kind = np.unique(np.stack([data.labels[rows], subjects[rows]])[:, first], axis=1, return_inverse=True)[1].ravel()
    order = np.lexsort((place[trials], kind))
    starts = np.searchsorted(kind[order], np.arange(kind.max() + 1))
    rank = np.empty(len(trials), np.intp)
    rank[order] = np.arange(len(trials)) - starts[kind[order]]
    return rank[back], len(trials) / (int(kind.max()) + 1)


def expected(
    repetitions: Sequence[int], rates: Sequence[Rate], hits: NDArray[np.bool_], units: Rows, seed: int
) -> tuple[ExpectedAccuracy, ...]:
    """Return the expected accuracies up to FURTHER times the last number of repetitions.

    The interval covers 95 % of the laws fitted to bootstrap draws of units (m,), trials or subjects, and of repeats, by
    hits (sizes, repeats, m). It is at least as wide as that of the last accuracy, and contains that accuracy.
    """
    sizes, repeats, _ = hits.shape
    wanted = np.array([times * repetitions[-1] for times in FURTHER], np.float64)
    n = np.array(repetitions, np.float64)
    errors = np.array([1 - rate.mean for rate in rates])
    weights = rates[0].total / (errors * (1 - errors) + 1 / rates[0].total)
    drawn = Draws.of(hits.reshape(sizes * repeats, -1).astype(np.intp), units, seed).drawn
    taken = np.random.default_rng(seed).integers(repeats, size=(len(drawn), repeats))
    every = drawn.reshape(len(drawn), sizes, repeats)
    several = np.take_along_axis(every, taken[:, np.newaxis, :], axis=2).mean(axis=2)
    (means,) = 1 - power_law(n, errors[np.newaxis], weights, wanted)
    laws = 1 - power_law(n, 1 - several, weights, wanted)
    lows, highs = np.quantile(laws, (0.025, 0.975), axis=0)
    last, found = rates[-1], []
    for times, mean, low, high in zip(FURTHER, means.tolist(), lows.tolist(), highs.tolist(), strict=True):
        ends = (low, mean - last.mean + last.low, last.mean), (high, mean - last.mean + last.high, last.mean)
        found.append(ExpectedAccuracy(times * repetitions[-1], mean, max(0.0, min(ends[0])), min(1.0, max(ends[1]))))
    return tuple(found)


def power_law(n: Floats, errors: Floats, weights: Floats, wanted: Floats) -> Floats:
    """Return a + b w^-c for each of `wanted` (w,), as (r, w).

    The law minimises the sum of weights (s,) times squared residuals over errors (r, s) at n (s,).
    """
    best, found = np.full(len(errors), np.inf), np.zeros((len(errors), len(wanted)))
    total = weights.sum()
    for exponent in _EXPONENTS:
        x, at = (n / n[0]) ** -exponent, (wanted / n[0]) ** -exponent
        centre, mean = (weights @ x) / total, errors @ weights / total
        b = np.maximum((errors - mean[:, None]) @ (weights * (x - centre)) / (weights @ (x - centre) ** 2), 0.0)
        a = mean - b * centre
        b = np.where(a < 0, (errors @ (weights * x)) / (weights @ x**2), b)
        a = np.maximum(a, 0.0)
        squares = (errors - a[:, None] - b[:, None] * x) ** 2 @ weights
        better = squares < best
        best[better] = squares[better]
        found[better] = (a[:, None] + b[:, None] * at)[better]
    return found
