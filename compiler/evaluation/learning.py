"""Learning curves: the accuracy after 2, 4, 8, ... repetitions of each grasp type by each person, and its
extrapolation.

The error after n repetitions is modelled as a + b n^-c with a, b >= 0: a power law with a floor that more recordings
cannot lower. It is fitted by weighted least squares over a grid of exponents. Since the law may not hold further on, it
is extrapolated to at most FURTHER times the largest number of repetitions, and only with at least LEAST points.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.files import write_atomically
from thenar.runtime.manifest import Of

from ..pictures import on_paper, rendered
from ..samples import Samples
from .folds import EvaluationError, Fold, Population, Rows, Scheme, leave_groups_out, trial_folds
from .plan import CellPlan, Planner, learners
from .rates import Draws, ExpectedAccuracy, Floats, Rate, RecipeWords
from .tables import RateReader

FURTHER, LEAST = (2, 4), 4
_EXPONENTS = np.arange(1, 61) / 30  # of n, from 1/30 to 2
# Curves are not inputs, so they get other colours.
_COLOURS, _MARKERS = ("ink", "picked", "link", "baseline-1", "baseline-2", "baseline-3"), "os^Dv"


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
        return tuple(ahead.repetitions for ahead in self.curves[0].expected)

    def draw(self, path: Path) -> Path:
        """Write the curves as a picture."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9.0, 5.4), layout="constrained", dpi=120)
        axes = figure.subplots()
        axes.set_xscale("log")
        for number, curve in enumerate(self.curves):
            colour, marker = on_paper(_COLOURS[number % len(_COLOURS)]), _MARKERS[number % len(_MARKERS)]
            # Shift curves sideways so that whiskers do not hide each other.
            shift = 1 + 0.025 * (number - (len(self.curves) - 1) / 2)
            xs, means = [shift * n for n in self.repetitions], [100 * rate.mean for rate in curve.rates]
            reach = [[100 * (r.mean - r.low) for r in curve.rates], [100 * (r.high - r.mean) for r in curve.rates]]
            axes.errorbar(xs, means, reach, color=colour, marker=marker, ms=4, lw=1.5, elinewidth=0.8)
            axes.plot([], [], color=colour, marker=marker, ms=4, label=curve.learner)
            if curve.expected:
                shown: list[Rate | ExpectedAccuracy] = [curve.rates[-1], *curve.expected]
                ahead = [self.repetitions[-1], *self.further]
                lows, highs = [100 * rate.low for rate in shown], [100 * rate.high for rate in shown]
                axes.plot(ahead, [100 * rate.mean for rate in shown], color=colour, lw=1.5, ls=(0, (2, 2)))
                axes.fill_between(ahead, lows, highs, color=colour, alpha=0.08, lw=0)
        if self.further:
            axes.plot([], [], color=on_paper("soft"), ls=(0, (2, 2)), label="expected, 95 % shaded")
        ticks = [*self.repetitions, *self.further]
        axes.set_xticks(ticks, [str(tick) for tick in ticks])
        axes.minorticks_off()
        axes.set_xlabel("repetitions of each grasp type by each person that were trained on")
        axes.set_ylabel(f"accuracy in %: {self.of}, trials")
        axes.set_title(f"Learning curves, {self.inputs}", fontsize=11)
        axes.grid(color=on_paper("line"), lw=0.6)
        axes.legend(loc="lower right")
        write_atomically(path, rendered(figure, "svg"))
        return path


@dataclass(frozen=True, slots=True)
class LearningPlan:
    """The fits of learning curves: for each learner a cell for each number of repetitions."""

    inputs: str
    of: Of
    repetitions: tuple[int, ...]
    cells: Mapping[str, tuple[CellPlan, ...]]

    def read(self, reader: RateReader, seed: int, recipe: RecipeWords) -> Learning:
        """Return the curves."""
        reader, curves, note = replace(reader, of=self.of), [], ""
        first = np.unique(reader.samples.trials, return_index=True)[1]
        units = np.arange(len(first))
        if reader.groups is not None:
            units = np.unique(reader.groups[first], return_inverse=True)[1]
        if len(self.repetitions) < LEAST:
            note = f"The effect of more repetitions is not extrapolated from fewer than {LEAST} points: record more."
        for learner, cells in self.cells.items():
            rates = tuple(reader.rates((cell,))[0] for cell in cells)
            hits = np.array([reader.hits((cell,)) for cell in cells])
            ahead = () if note else expected(self.repetitions, rates, hits, units, seed)
            curves.append(LearningCurve(learner, rates, ahead))
        return Learning(self.inputs, self.of, self.repetitions, tuple(curves), note, recipe)


def plan_learning(planner: Planner, subjects: NDArray[np.str_], scheme: Scheme, repeats: int) -> LearningPlan:
    """Plan the fits: folds of everybody's trials, or a subject left out, with a limited number of training trials.

    The training trials of each type in a fold are put in random order and the first ones taken, so larger training sets
    of a curve contain the smaller ones. Raises EvaluationError for other schemes, or too few trials.
    """
    if scheme not in ("trial", "subject"):
        raise EvaluationError(
            f"a learning curve tests trials, or subjects left out, not {scheme}s left out: choose another scheme"
        )
    samples, recipe = planner.samples, planner.recipe
    if scheme == "subject":
        runs = [leave_groups_out(subjects, "subject")] * repeats
    else:
        seeds = range(recipe.seed, recipe.seed + repeats)
        runs = [trial_folds(samples.labels, samples.trials, recipe.folds, seed) for seed in seeds]
    orders = [
        np.random.default_rng((recipe.seed, repeat)).permutation(int(samples.trials.max()) + 1)
        for repeat in range(repeats)
    ]
    ranked = [
        [_ranks(samples.rows(fold.train), order) for fold in run] for run, order in zip(runs, orders, strict=True)
    ]
    counts = [count for run in ranked for _, count in run]
    most = round(float(np.mean(counts)))
    sizes = tuple(2**power for power in range(1, most.bit_length()) if 2**power < most)
    if not sizes:
        raise EvaluationError(f"a learning curve needs more than 2 repetitions to train on, and there are {most}")

    def limited(size: int) -> list[list[Fold]]:
        """Return the folds with at most `size` training trials of each type and person."""
        return [
            [Fold(fold.train[rank < size], fold.test, fold.name) for fold, (rank, _) in zip(*run, strict=True)]
            for run in zip(runs, ranked, strict=True)
        ]

    everyone, grasps = np.arange(len(samples.labels)), tuple(range(samples.n_classes))
    populations = [
        Population("all", everyone, grasps, tuple(map(tuple, folds))) for folds in (*map(limited, sizes), runs)
    ]
    kind, chosen = planner.kinds[0], partial(planner.placement, "nested")
    cells = {
        name: tuple(planner.cell(population, kind, chosen, name) for population in populations) for name in learners()
    }
    several = len(np.unique(subjects)) > 1
    of: Of = "new subject" if scheme == "subject" else "pooled" if several else "within subject"
    return LearningPlan(str(kind), of, (*sizes, most), cells)


def _ranks(samples: Samples, order: Rows) -> tuple[Rows, float]:
    """Return the rank (n,) of each row's trial among those of its type and subject, by the trials' `order`, and the
    mean number of trials per type and subject.
    """
    trials, first, back = np.unique(samples.trials, return_index=True, return_inverse=True)
    pairs = np.stack([samples.labels, samples.subjects])[:, first]
    kind = np.unique(pairs, axis=1, return_inverse=True)[1].ravel()
    place = np.lexsort((order[trials], kind))
    starts = np.searchsorted(kind[place], np.arange(kind.max() + 1))
    rank = np.empty(len(trials), np.intp)
    rank[place] = np.arange(len(trials)) - starts[kind[place]]
    return rank[back], len(trials) / (int(kind.max()) + 1)


def expected(
    repetitions: Sequence[int], rates: Sequence[Rate], hits: NDArray[np.bool_], units: Rows, seed: int
) -> tuple[ExpectedAccuracy, ...]:
    """Return the expected accuracies up to FURTHER times the last number of repetitions.

    The interval covers 95 % of the laws fitted to bootstrap draws of units (m,), trials or subjects, and of repeats, by
    hits (sizes, repeats, m). It is at least as wide as that of the last accuracy, and contains that accuracy.
    """
    sizes, repeats, _ = hits.shape
    further = np.array([times * repetitions[-1] for times in FURTHER], np.float64)
    n = np.array(repetitions, np.float64)
    errors = np.array([1 - rate.mean for rate in rates])
    weights = rates[0].total / (errors * (1 - errors) + 1 / rates[0].total)
    drawn = Draws.of(hits.reshape(sizes * repeats, -1).astype(np.intp), units, seed).drawn
    numbers = np.random.default_rng(seed).integers(repeats, size=(len(drawn), 1, repeats))
    several = np.take_along_axis(drawn.reshape(len(drawn), sizes, repeats), numbers, axis=2).mean(axis=2)
    (means,) = 1 - power_law(n, errors[np.newaxis], weights, further)
    laws = 1 - power_law(n, 1 - several, weights, further)
    lows, highs = np.quantile(laws, (0.025, 0.975), axis=0)
    last, ahead = rates[-1], []
    for times, mean, low, high in zip(FURTHER, means.tolist(), lows.tolist(), highs.tolist(), strict=True):
        ends = (low, mean - last.mean + last.low, last.mean), (high, mean - last.mean + last.high, last.mean)
        ahead.append(ExpectedAccuracy(times * repetitions[-1], mean, max(0.0, min(ends[0])), min(1.0, max(ends[1]))))
    return tuple(ahead)


def power_law(n: Floats, errors: Floats, weights: Floats, further: Floats) -> Floats:
    """Return a + b w^-c for each of the numbers `further` (w,), as (r, w).

    The law minimises the sum of weights (s,) times squared residuals over errors (r, s) at n (s,).
    """
    best, laws = np.full(len(errors), np.inf), np.zeros((len(errors), len(further)))
    total = weights.sum()
    for exponent in _EXPONENTS:
        x, at = (n / n[0]) ** -exponent, (further / n[0]) ** -exponent
        centre, mean = (weights @ x) / total, errors @ weights / total
        b = np.maximum((errors - mean[:, None]) @ (weights * (x - centre)) / (weights @ (x - centre) ** 2), 0.0)
        a = mean - b * centre
        b = np.where(a < 0, (errors @ (weights * x)) / (weights @ x**2), b)
        a = np.maximum(a, 0.0)
        squares = (errors - a[:, None] - b[:, None] * x) ** 2 @ weights
        better = squares < best
        best[better] = squares[better]
        laws[better] = (a[:, None] + b[:, None] * at)[better]
    return laws
