"""The best stump of a round, its thresholds and answers; and whole trainings, round by round."""

import math
from collections.abc import Iterable, Iterator
from fractions import Fraction

import numpy as np
from mpmath import mpf

from thenar.compiler.boosting.binning import bin_columns, midpoints
from thenar.compiler.boosting.stumpfit import FittedStumps, Targets, fit_stumps

from ..checks.class_rounds import ClassRound, branches
from ..checks.trainings import trainings
from ..finding import Case, Finding, Worst
from ..inputs.hard_stumps import Problem, neighbours, problems, tied
from ..reference import stumps as truth
from ..reference.numbers import precisely

CASE = Case(
    title="Stump fits",
    danger="a branch answers with what rounding left of its weight, and ties between columns go where rounding likes",
)
REFERENCE = "60 digits"
Z_MAX = 3.0


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of thresholds, of the choice of stumps, of their answers, and of whole trainings."""
    rng, more = np.random.default_rng(4), 12 if full else 1
    yield thresholds_of(neighbours(rng, 100 * more))
    fits = [(problem, fit(problem)) for problem in problems(rng, 8 * more, Z_MAX)]
    yield choices_of(fits)
    yield from answers_of(fits)
    yield ties_of(tied(rng, Z_MAX) for _ in range(40 * more))
    yield from trainings(full)


def fit(problem: Problem) -> FittedStumps:
    """Return our stump."""
    targets = Targets(problem.weights[np.newaxis], problem.responses[np.newaxis])
    return fit_stumps(bin_columns(problem.X), targets, Z_MAX)


def thresholds_of(sets: Iterable[list[float]]) -> Finding:
    """Count thresholds that are not the middle of their neighbours, rounded once, or are the upper of both."""
    worst = Worst("thresholds between neighbours", "fractions", 0.0, "thresholds")
    for values in sets:
        for lower, upper, got in zip(values[:-1], values[1:], midpoints(np.array(values)).tolist(), strict=True):
            # The sum rounds to half of its last place, which its half keeps; so do the halves of the largest doubles.
            off = abs(Fraction(got) - (Fraction(lower) + Fraction(upper)) / 2)
            parts = lower <= got < upper and off <= Fraction(math.ulp(max(abs(lower), abs(upper)))) / 2
            worst.see(float(not parts), f"between {lower!r} and {upper!r}")
    return worst.finding()


def choices_of(fits: Iterable[tuple[Problem, FittedStumps]]) -> Finding:
    """How much less the chosen stump explains than the best one."""
    worst = Worst("what the chosen stump explains", REFERENCE, 1.0, "x rounding")
    for problem, fitted in fits:
        given = _given(problem)
        with precisely():
            short = given.best(problem.X) - given.explained(problem.X, *_place(fitted))
            allowed = given.doubt(Z_MAX)
            worst.see(float(short / allowed) if allowed else 0.0, problem.name)
    return worst.finding()


def answers_of(fits: Iterable[tuple[Problem, FittedStumps]]) -> Iterator[Finding]:
    """What branches answer: their mean, or where they are next to empty the mean of all rows."""
    means = Worst("answers of branches", REFERENCE, 1.0, "x rounding")
    empty = Worst("answers of branches next to empty", REFERENCE, 1.0, "x rounding")
    outside = Worst("answers within the clamp", "the rule itself", 0.0, "answers")
    for problem, fitted in fits:
        given, (column, threshold) = _given(problem), _place(fitted)
        parts = branches(problem.X[:, column], threshold)
        for value, rows in zip(fitted.values[0].tolist(), parts, strict=True):
            of = given.branch(rows)
            (empty if of.is_light else means).see(of.error(value, Z_MAX), problem.name)
            outside.see(float(not abs(value) <= Z_MAX), problem.name)
    yield from (means.finding(), empty.finding(), outside.finding())


def _given(problem: Problem) -> ClassRound:
    """Return the problem as a round of one class, of weights and responses that are exact."""
    exact = [mpf(0)] * len(problem.weights)
    return ClassRound(0, [], problem.weights.tolist(), problem.responses.tolist(), exact)


def _place(fitted: FittedStumps) -> tuple[int, float]:
    return int(fitted.columns[0]), float(fitted.thresholds[0])


def ties_of(sets: Iterable[Problem]) -> Finding:
    """Count problems with stumps of equal sums in which another than the lowest column and value is chosen."""
    worst = Worst("which of equal stumps is chosen", REFERENCE, 0.0, "stumps")
    for problem in sets:
        fitted, w, r = fit(problem), problem.weights.tolist(), problem.responses.tolist()
        _, column, lower, upper = truth.best_splits(problem.X.T.tolist(), w, r)[0]
        agrees = fitted.columns[0] == column and lower <= fitted.thresholds[0] < upper
        worst.see(float(not agrees), problem.name)
    return worst.finding()
