"""The best stump of a round, its thresholds and outputs."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from mpmath import mpf

from thenar.compiler.elementary import Floats
from thenar.compiler.trainers.binning import bin_columns, midpoints
from thenar.compiler.trainers.stumps import FittedStumps, Targets, fit_stumps

from ..checks.rounds import ClassRound
from ..finding import REFERENCE, Finding
from ..reference import boosting as truth
from ..reference.numbers import exact

Z_MAX = 3.0


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


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of thresholds, of the choice of stumps, and of their outputs."""
    rng, more = np.random.default_rng(4), 12 if full else 1
    yield thresholds_of(neighbours(rng, 100 * more))
    fits = [(problem, fit(problem)) for problem in problems(rng, 8 * more, Z_MAX)]
    yield choices_of(fits)
    yield from outputs_of(fits)
    yield ties_of(tied(rng, Z_MAX) for _ in range(40 * more))


def fit(problem: Problem) -> FittedStumps:
    """Return our stump."""
    targets = Targets(problem.weights[np.newaxis], problem.responses[np.newaxis])
    return fit_stumps([bin_columns(problem.X)], targets, Z_MAX)


def thresholds_of(sets: Iterable[list[float]]) -> Finding:
    """Count thresholds that are not the once-rounded middle of their neighbours, or equal the upper one."""
    worst = Finding.of("thresholds between neighbours", "fractions", 0.0, "thresholds")
    for values in sets:
        for lower, upper, got in zip(values[:-1], values[1:], midpoints(np.array(values)).tolist(), strict=True):
            # The sum rounds to half of its last place, which its half keeps; so do the halves of the largest doubles.
            off = abs(Fraction(got) - (Fraction(lower) + Fraction(upper)) / 2)
            parts = lower <= got < upper and off <= Fraction(math.ulp(max(abs(lower), abs(upper)))) / 2
            worst.see(float(not parts), f"between {lower!r} and {upper!r}")
    return worst


def choices_of(fits: Iterable[tuple[Problem, FittedStumps]]) -> Finding:
    """Return how much less variation the chosen stump explains than the best one."""
    worst = Finding.of("variation explained by the chosen stump", REFERENCE, 1.0, "x rounding")
    for problem, fitted in fits:
        worst.see(_given(problem).lost(*_place(fitted)), problem.name)
    return worst


def outputs_of(fits: Iterable[tuple[Problem, FittedStumps]]) -> Iterator[Finding]:
    """Check the outputs of branches: their mean, or for almost empty ones the mean of all rows."""
    means = Finding.of("outputs of branches", REFERENCE, 1.0, "x rounding")
    empty = Finding.of("outputs of almost empty branches", REFERENCE, 1.0, "x rounding")
    outside = Finding.of("outputs within the clamp", "the rule itself", 0.0, "outputs")
    for problem, fitted in fits:
        values = fitted.values[0].tolist()
        for error, is_light in _given(problem).errors(*_place(fitted), values):
            (empty if is_light else means).see(error, problem.name)
        for value in values:
            outside.see(float(not abs(value) <= Z_MAX), problem.name)
    yield from (means, empty, outside)


def _given(problem: Problem) -> ClassRound:
    """Return the problem as a round of one class with exact weights and responses."""
    weights, responses = ([exact(x) for x in part.tolist()] for part in (problem.weights, problem.responses))
    return ClassRound(problem.X.T.tolist(), weights, responses, [mpf(0)] * len(weights), Z_MAX)


def _place(fitted: FittedStumps) -> tuple[int, float]:
    return int(fitted.columns[0]), float(fitted.thresholds[0])


def ties_of(sets: Iterable[Problem]) -> Finding:
    """Count problems with equal stumps in which the lowest column and value is not chosen."""
    worst = Finding.of("which of equal stumps is chosen", REFERENCE, 0.0, "stumps")
    for problem in sets:
        fitted, w, r = fit(problem), problem.weights.tolist(), problem.responses.tolist()
        _, column, lower, upper = truth.best_splits(problem.X.T.tolist(), w, r)[0]
        agrees = fitted.columns[0] == column and lower <= fitted.thresholds[0] < upper
        worst.see(float(not agrees), problem.name)
    return worst
