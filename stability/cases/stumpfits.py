"""The best stump of a round, its thresholds and outputs; and whole trainings, round by round."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.boosting.binning import bin_columns, midpoints
from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumpfit import FittedStumps, Targets, fit_stumps
from thenar.compiler.boosting.stumps import Stumps
from thenar.compiler.elementary import Floats

from ..checks.class_rounds import ClassRound, Step, branches, choice_error, class_rounds, grown, see_stump, step_of
from ..finding import REFERENCE, Case, Finding, Worst
from ..reference import boosting as truth
from ..reference.boosting import Round, boost_rounds
from ..reference.numbers import precisely


@dataclass(frozen=True, slots=True)
class Problem:
    """One class's round: inputs X (n, d), weights w (n,) and weighted responses w z (n,), and its difficulty."""

    name: str
    X: Floats
    weights: Floats
    responses: Floats


def problems(rng: np.random.Generator, n: int, z_max: float) -> Iterator[Problem]:
    """Yield n problems of every kind, 5 to 80 rows of 2 to 6 columns each."""
    for _ in range(n):
        for name, kind in KINDS.items():
            rows = int(rng.integers(5, 80))
            X = columns(rng, rows)[:, : int(rng.integers(2, 7))]
            weights, ratios = kind(rng, rows, z_max)
            yield Problem(name, X, weights, weights * ratios)


def neighbours(rng: np.random.Generator, n: int) -> Iterator[list[float]]:
    """Yield ascending values: tiny, the largest, adjacent doubles, 16-bit codes."""
    largest, least = float(np.finfo(np.float64).max), 5e-324
    yield from ([0.0, least, 2 * least, 3 * least], [-least, least], [-largest, largest])
    yield [float(np.nextafter(largest, 0)), largest]
    for _ in range(n):
        one = np.ldexp(rng.uniform(0.5, 1), rng.integers(-1073, 1022))
        yield (one + np.spacing(one) * np.arange(4)).tolist()
        yield np.unique(rng.integers(0, 1 << 16, 9)).astype(np.float64).tolist()


def columns(rng: np.random.Generator, n: int) -> Floats:
    """Return inputs (n, 6), n >= 2: codes, a switch and its opposite, adjacent doubles, one with missing values."""
    codes, switch = rng.integers(0, 256, n).astype(np.float64), rng.integers(0, 2, n).astype(np.float64)
    codes[:2] = 0, 255
    close = 1.0 + np.spacing(1.0) * rng.integers(0, 3, n)
    lacking = np.where(rng.random(n) < 0.2, np.nan, codes)
    return np.column_stack([codes, switch, close, 1.0 - switch, lacking, np.arange(n)])


def tied(rng: np.random.Generator, z_max: float) -> Problem:
    """Return a problem in which the first row equals the sum of the next two, in columns of all orders."""
    weights, ratios = rng.random(40), np.full(40, -1.7)
    weights[1:3] = weights[0] / 2
    ratios[:3] = rng.choice([1.9, z_max])
    responses = weights * ratios
    responses[1:3] = responses[0] / 2
    one, two = np.arange(40) == 0, np.isin(np.arange(40), (1, 2))
    either = 1.0 + one - two  # one at 2, two at 0: the first split separates two, the second one
    inputs = [one, two, 1.0 - one, either, 2.0 - either, rng.integers(0, 2, 40)]
    order = rng.permutation(len(inputs))
    return Problem(f"columns in order {order.tolist()}", np.column_stack(inputs)[:, order], weights, responses)


def _ratios(rng: np.random.Generator, n: int, z_max: float) -> Floats:
    return rng.choice([-1.0, 1.0], n) * rng.uniform(1.0, z_max, n)


def _light_branch(rng: np.random.Generator, n: int, z_max: float) -> tuple[Floats, Floats]:
    """Return rows mostly of about 2^-38 of the weight, where a branch almost counts as empty, and of opposite sign."""
    light = np.arange(n) >= 3
    return np.where(light, 2.0**-38 * rng.uniform(0.25, 4, n) / n, 1.0), np.where(light, -z_max, 1.0)


# Weights and responses over weights of n rows.
KINDS: dict[str, Callable[[np.random.Generator, int, float], tuple[Floats, Floats]]] = {
    "ordinary": lambda rng, n, z_max: (rng.random(n), _ratios(rng, n, z_max)),
    "decades": lambda rng, n, z_max: (np.power(10.0, rng.uniform(-300, 0, n)), _ratios(rng, n, z_max)),
    "settled": lambda rng, n, _: (np.ldexp(1.0, -rng.integers(30, 53, n)), rng.choice([-1.0, 1.0], n)),
    "clamped": lambda rng, n, z_max: (np.full(n, 1 / z_max), rng.choice([-z_max, z_max], n)),
    "one heavy": lambda rng, n, z_max: (
        np.where(np.arange(n) == n // 2, 1.0, rng.random(n) * 2.0**-52),
        _ratios(rng, n, z_max),
    ),
    "light branch": _light_branch,
    "subnormal": lambda rng, n, z_max: (
        np.ldexp(rng.integers(0, 1000, n).astype(np.float64), -1074),
        rng.choice([-1.0, 1.0, z_max], n),
    ),
}


@dataclass(frozen=True, slots=True)
class Training:
    """A small training set, X (n, d) and labels (n,), and its options."""

    name: str
    X: Floats
    labels: NDArray[np.intp]
    classes: int
    shrinkage: float
    z_max: float

    def boosted(self, rounds: int) -> Stumps:
        """Return our ensemble."""
        return boost(self.X, self.labels, self.classes, rounds=rounds, shrinkage=self.shrinkage, z_max=self.z_max)[0]

    def boosted_precisely(self, rounds: int) -> list[Round]:
        """Return the reference's rounds."""
        X, labels = self.X.tolist(), self.labels.tolist()
        return boost_rounds(X, labels, self.classes, rounds, self.shrinkage, self.z_max)


def trainings(full: bool) -> Iterator[Finding]:
    """Yield errors of rounds, given the scores before them, and of scores after all rounds."""
    rng, rounds = np.random.default_rng(5), 40 if full else 8
    stumps = Worst("stumps of whole trainings", REFERENCE, 1.0, "x rounding")
    outputs = Worst("outputs of a round, from its scores", REFERENCE, 1.0, "x rounding")
    scores = Worst("scores after all rounds, from the start", REFERENCE, 1.0, "x growth")
    for training in _sets(rng, 36 if full else 20):
        ours = training.boosted(rounds)
        stages = [np.zeros((len(training.X), training.classes)), *ours.staged_scores(training.X)]
        for number, F in enumerate(stages[:-1]):
            at = f"{training.name}, round {number + 1}"
            for given in class_rounds(F.tolist(), training.labels.tolist(), training.z_max):
                see_stump(given, training.X, ours, number, training.z_max, at, stumps, outputs)
        _see_scores(training, stages, scores)
    yield from (stumps.finding(), outputs.finding(), scores.finding())


def _see_scores(training: Training, stages: Sequence[Floats], scores: Worst) -> None:
    """Compare the scores of our training with the reference, as long as none of its choices is in doubt."""
    rounds = training.boosted_precisely(len(stages) - 1)
    F = [[mpf(0)] * training.classes for _ in training.labels]
    labels, steps, truth = training.labels.tolist(), list[Step](), F
    for each, ours in zip(rounds, stages[1:], strict=True):
        given = class_rounds(truth, labels, training.z_max)
        if _in_doubt(training, each, given):
            break
        parts = [branches(training.X[:, splits[0][1]], splits[0][2]) for splits in each.splits]
        largest = float(np.abs(ours).max())
        steps.append(step_of(given, parts, labels, training.shrinkage, training.z_max).on_scores_of(largest))
        truth = each.scores
    if not steps:
        return
    reached = stages[len(steps)]
    with precisely():
        errors = [
            abs(mpf(a) - b)
            for row, true in zip(reached.tolist(), truth, strict=True)
            for a, b in zip(row, true, strict=True)
        ]
    ratios = np.array([float(error) for error in errors]) / grown(steps)
    scores.see(float(ratios.max()), f"{training.name}, {len(steps)} rounds, off by {float(max(errors)):.2g}")


def _in_doubt(training: Training, each: Round, given: Sequence[ClassRound]) -> bool:
    """Whether rounding may decide between equal and unequal stumps, or whether a branch is empty."""
    for splits, lead, of in zip(each.splits, each.leads(), given, strict=True):
        best, column, lower, _ = splits[0]
        light = [of.branch(rows).is_light for rows in branches(training.X[:, column], lower) if rows]
        if any(light) or lead * best <= 2 * choice_error(of.weights, of.responses, training.z_max):
            return True
    return False


def _sets(rng: np.random.Generator, n: int) -> Iterator[Training]:
    """Yield sets of switches, codes and numbers that may be missing: noisy, separable, and of random labels."""
    for name, classes, noise, shrinkage, z_max in (
        ("noisy", 3, 0.2, 1.0, 3.0),
        ("separable", 4, 0.0, 1.0, 3.0),
        ("random labels", 2, 1.0, 1.0, 3.0),
        ("shrunk", 3, 0.1, 0.3, 2.0),
        ("hardly clamped", 3, 0.1, 1.0, 100.0),
    ):
        labels = np.arange(n) % classes
        switches = rng.random((classes, 3))[labels] + noise * rng.normal(0, 1, (n, 3)) > 0.5
        codes = 20 * labels + rng.integers(0, 20, n) + (200 * noise * rng.random(n)).astype(np.int64)
        lacking = np.where(rng.random(n) < 0.3, np.nan, rng.integers(0, 5, n))
        yield Training(name, np.column_stack([switches, codes, lacking]), labels, classes, shrinkage, z_max)


CASE = Case(
    title="Stump fits",
    danger="a branch's output is the residue of rounding its weight, and rounding breaks ties between columns",
)
Z_MAX = 3.0


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of thresholds, of the choice of stumps, of their outputs, and of whole trainings."""
    rng, more = np.random.default_rng(4), 12 if full else 1
    yield thresholds_of(neighbours(rng, 100 * more))
    fits = [(problem, fit(problem)) for problem in problems(rng, 8 * more, Z_MAX)]
    yield choices_of(fits)
    yield from outputs_of(fits)
    yield ties_of(tied(rng, Z_MAX) for _ in range(40 * more))
    yield from trainings(full)


def fit(problem: Problem) -> FittedStumps:
    """Return our stump."""
    targets = Targets(problem.weights[np.newaxis], problem.responses[np.newaxis])
    return fit_stumps(bin_columns(problem.X), targets, Z_MAX)


def thresholds_of(sets: Iterable[list[float]]) -> Finding:
    """Count thresholds that are not the once-rounded middle of their neighbours, or equal the upper one."""
    worst = Worst("thresholds between neighbours", "fractions", 0.0, "thresholds")
    for values in sets:
        for lower, upper, got in zip(values[:-1], values[1:], midpoints(np.array(values)).tolist(), strict=True):
            # The sum rounds to half of its last place, which its half keeps; so do the halves of the largest doubles.
            off = abs(Fraction(got) - (Fraction(lower) + Fraction(upper)) / 2)
            parts = lower <= got < upper and off <= Fraction(math.ulp(max(abs(lower), abs(upper)))) / 2
            worst.see(float(not parts), f"between {lower!r} and {upper!r}")
    return worst.finding()


def choices_of(fits: Iterable[tuple[Problem, FittedStumps]]) -> Finding:
    """Return how much less variation the chosen stump explains than the best one."""
    worst = Worst("variation explained by the chosen stump", REFERENCE, 1.0, "x rounding")
    for problem, fitted in fits:
        given = _given(problem)
        with precisely():
            short = given.best(problem.X) - given.explained(problem.X, *_place(fitted))
            allowed = given.doubt(Z_MAX)
            worst.see(float(short / allowed) if allowed else 0.0, problem.name)
    return worst.finding()


def outputs_of(fits: Iterable[tuple[Problem, FittedStumps]]) -> Iterator[Finding]:
    """Check the outputs of branches: their mean, or for almost empty ones the mean of all rows."""
    means = Worst("outputs of branches", REFERENCE, 1.0, "x rounding")
    empty = Worst("outputs of almost empty branches", REFERENCE, 1.0, "x rounding")
    outside = Worst("outputs within the clamp", "the rule itself", 0.0, "outputs")
    for problem, fitted in fits:
        given, (column, threshold) = _given(problem), _place(fitted)
        parts = branches(problem.X[:, column], threshold)
        for value, rows in zip(fitted.values[0].tolist(), parts, strict=True):
            of = given.branch(rows)
            (empty if of.is_light else means).see(of.error(value, Z_MAX), problem.name)
            outside.see(float(not abs(value) <= Z_MAX), problem.name)
    yield from (means.finding(), empty.finding(), outside.finding())


def _given(problem: Problem) -> ClassRound:
    """Return the problem as a round of one class with exact weights and responses."""
    exact = [mpf(0)] * len(problem.weights)
    return ClassRound(0, [], problem.weights.tolist(), problem.responses.tolist(), exact)


def _place(fitted: FittedStumps) -> tuple[int, float]:
    return int(fitted.columns[0]), float(fitted.thresholds[0])


def ties_of(sets: Iterable[Problem]) -> Finding:
    """Count problems with equal stumps in which the lowest column and value is not chosen."""
    worst = Worst("which of equal stumps is chosen", REFERENCE, 0.0, "stumps")
    for problem in sets:
        fitted, w, r = fit(problem), problem.weights.tolist(), problem.responses.tolist()
        _, column, lower, upper = truth.best_splits(problem.X.T.tolist(), w, r)[0]
        agrees = fitted.columns[0] == column and lower <= fitted.thresholds[0] < upper
        worst.see(float(not agrees), problem.name)
    return worst.finding()
