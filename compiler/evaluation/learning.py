"""Learning curves: the accuracy after 2, 4, 8, ... repetitions of each grasp type by each person, and what to expect
of more.

The error after n repetitions is taken to be a + b n^-c with a, b >= 0: it falls as a power of n to what more recordings
cannot mend. The least weighted squares are taken over all exponents of a grid. Nobody knows whether the law goes on:
it is followed to at most FURTHER times the repetitions that were trained on, and only where LEAST points hold it.
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
from .rates import Rate
from .tables import Reader

Floats = NDArray[np.float64]

FURTHER, LEAST = (2, 4), 4
_EXPONENTS = np.arange(1, 61) / 30  # of n, from 1/30 to 2


@dataclass(frozen=True, slots=True)
class Expected:
    """The rate to expect after so many repetitions, of a law that was fitted, and its 95 % interval."""

    repetitions: int
    mean: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class LearningCurve:
    """A trainer's, or a baseline's, rates after each number of repetitions, and those to expect of more of them."""

    learner: str
    rates: tuple[Rate, ...]
    expected: tuple[Expected, ...]


@dataclass(frozen=True, slots=True)
class Learning:
    """Learning curves of the same trials.

    inputs       what the classifiers read            of     what the rates are of
    repetitions  trials of each grasp type and person that were trained on; the last, all there are: the mean
    curves       one a trainer or baseline               note   why nothing is expected of more; "" where something is
    """

    inputs: str
    of: Of
    repetitions: tuple[int, ...]
    curves: tuple[LearningCurve, ...]
    note: str

    @property
    def title(self) -> str:
        """What the curves show."""
        return f"Learning curves, {self.inputs}, nested: {self.of}, trials, by repetitions a grasp type and person"

    @property
    def further(self) -> tuple[int, ...]:
        """The numbers of repetitions for which rates are expected."""
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

    def read(self, reader: Reader, groups: NDArray[np.str_] | None, seed: int) -> Learning:
        """Return the curves; groups (n,) are the subjects, where those are left out."""
        enough, curves = len(self.repetitions) >= LEAST, []
        for learner, cells in self.cells.items():
            rates = tuple(reader.rates((cell,))[0] for cell in cells)
            hits = np.array([reader.hits((cell,)) for cell in cells])
            units = np.arange(hits.shape[2])
            if groups is not None:
                units = np.unique(groups[np.unique(reader.trials, return_index=True)[1]], return_inverse=True)[1]
            found = expected(self.repetitions, rates, hits, units, seed) if enough else ()
            curves.append(LearningCurve(learner, rates, found))
        note = f"What more repetitions would bring is not extrapolated from fewer than {LEAST} points: record more."
        return Learning(self.inputs, self.of, self.repetitions, tuple(curves), "" if enough else note)


def plan_learning(
    data: Data, subjects: NDArray[np.str_], planner: Planner, scheme: Scheme, n_folds: int, repeats: int
) -> LearningPlan:
    """Return what to fit: everybody's trials in folds, or a subject left out; of what is trained on, so many of each
    type.

    Trials of a fold that are trained on are put in random order, and the first of them taken: a curve's larger training
    sets hold its smaller ones. Raises EvaluationError where trials are cut in other ways, or are too few.
    """
    if scheme not in ("trial", "subject"):
        raise EvaluationError(
            f"a learning curve tests trials, or subjects left out, and no {scheme} left out: choose another cut"
        )
    everyone = np.arange(len(data.labels))
    several = len(np.unique(subjects)) > 1
    numbers = np.unique(subjects, return_inverse=True)[1]
    parts = leave_groups_out(subjects, "subject") if scheme == "subject" else []
    cuts, counts = [], []
    for repeat in range(repeats):
        random = np.random.default_rng((planner.seed, repeat))
        place = random.permutation(int(data.trials.max()) + 1)
        for fold in parts or trial_folds(data.labels, data.trials, n_folds, planner.seed + repeat):
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
    """Return for each of these rows (n,) the number of its trial among those of its type and subject, by their `place`;
    and how many trials a type and subject have, on average.
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
) -> tuple[Expected, ...]:
    """Return the rates to expect after FURTHER times the last number of repetitions.

    The interval holds 95 % of the laws that are fitted to bootstrap draws of units (m,), trials or subjects, and of
    repeats, by hits (sizes, repeats, m). It is at least as wide as that of the last rate, and holds that rate.
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
        found.append(Expected(times * repetitions[-1], mean, max(0.0, min(ends[0])), min(1.0, max(ends[1]))))
    return tuple(found)


def power_law(n: Floats, errors: Floats, weights: Floats, wanted: Floats) -> Floats:
    """Return a + b w^-c for each of `wanted` (w,), with the least sum of weights (s,) times squares over errors (r, s)
    at n (s,): (r, w).
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
