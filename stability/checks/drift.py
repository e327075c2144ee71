"""How far scores are off after thousands of rounds that never settle, and their mean over the classes is."""

from collections.abc import Iterator, Sequence

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import Stumps, centred
from thenar.compiler.elementary import add_up

from ..finding import Finding, Worst
from ..inputs.hard_data import Floats, noisy
from ..reference import ensembles
from ..reference.numbers import precisely
from .roundings import ROUNDING
from .rounds import mean_score


def drift(rounds: int) -> Iterator[Finding]:
    """Yield the drift of scores over so many rounds of sets half of whose labels are noise."""
    means = Worst("mean over the classes of scores", "zero", 1.0, "x rounding")
    scores = Worst("scores after all rounds", "60 digits", 1.0, "x rounding")
    added = Worst("adding up the steps of all rounds", "60 digits", 1.0, "x rounding")
    for hard, shrinkage in ((noisy(33, 66, 0.5, seed=3), 1.0), (noisy(14, 42, 0.5, seed=4), 0.1)):
        stumps, _ = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds, shrinkage=shrinkage)
        rows = hard.X[:2]
        steps = _steps(stumps, rows)
        allowed, got = step_rounding(stumps, steps), stumps.scores(rows).T
        for row in range(len(rows)):
            at = f"{hard.name}, shrinkage {shrinkage:g}, row {row}, {rounds} rounds"
            own, ours = allowed[:, row], got[:, row].tolist()
            means.see(mean_score(got[:, row : row + 1]) / float(own.mean()), at)
            scores.see(worst_share(ours, _true_scores(stumps, rows[row].tolist()), own.tolist()), at)
            added.see(worst_share(ours, *true_sums(centred_steps(steps[:, :, row], shrinkage))), at)
    yield from (worst.finding() for worst in (means, scores, added))


def _steps(stumps: Stumps, X: NDArray[np.int64]) -> Floats:
    """Return what the stumps answer to rows X (n, d), in every round: (M, K, n)."""
    answers = []
    for columns, thresholds, values in zip(stumps.columns, stumps.thresholds, stumps.values, strict=True):
        inputs = X[:, columns].T
        answers.append(np.where(inputs <= thresholds[:, np.newaxis], values[:, :1], values[:, 1:2]))
    return np.array(answers)


def centred_steps(answers: Floats, shrinkage: float) -> Floats:
    """Return what every round adds to the scores of one row (M, K), from the answers (M, K) to it."""
    return np.ascontiguousarray(centred(np.ascontiguousarray(answers.T), shrinkage).T)


def step_rounding(stumps: Stumps, answers: Floats) -> Floats:
    """Return by how much rounding can move each score (K, n), from what each round really adds up.

    A step is (g - sum g / K) (K - 1)/K: g rounds once, each partial sum and the quotient once, the difference once, and
    the product and its quotient once each. What rounds is known, so 2^-53 of it is the bound; errors of g reach the
    mean as well. The scores themselves round once, at the end.
    """
    k = stumps.n_classes
    total = np.zeros(answers.shape[1:])
    for g in answers * stumps.shrinkage:
        partial = np.abs(np.cumsum(g, axis=0)[1:]).sum(axis=0) / k
        mean = np.abs(add_up(g)) / k
        multiplied = 0.0 if stumps.shrinkage == 1.0 else np.abs(g) + np.abs(g).mean(axis=0)
        total += multiplied + partial + mean + 3 * np.abs(g - add_up(g) / k)
    final = np.abs(centred(answers.sum(axis=0), stumps.shrinkage))
    bound: Floats = ROUNDING * (total + final)
    return bound


@precisely()
def _true_scores(stumps: Stumps, row: Sequence[float]) -> list[mpf]:
    return ensembles.scores(
        stumps.columns.tolist(), stumps.thresholds.tolist(), stumps.values.tolist(), stumps.shrinkage, row
    )


@precisely()
def true_sums(steps: Floats) -> tuple[list[mpf], list[float]]:
    """Return the sums (K,) of steps (M, K), and by how much a sum with compensation may be off each.

    One rounding of the sum; and what is carried, M errors of 2^-53 of partial sums, rounds M times itself.
    """
    sums = [mpmath.fsum(column) for column in steps.T.tolist()]
    largest = np.abs(np.cumsum(steps, axis=0)).max(axis=0)
    carried = (len(steps) * ROUNDING) ** 2 * largest
    return sums, [float(ROUNDING * abs(total) + lost) for total, lost in zip(sums, carried.tolist(), strict=True)]


@precisely()
def worst_share(got: Sequence[float], truth: Sequence[mpf], allowed: Sequence[float]) -> float:
    """Return the largest error, each as a share of what is allowed."""
    errors = zip(got, truth, allowed, strict=True)
    return float(max(abs(ours - theirs) / bound for ours, theirs, bound in errors))
