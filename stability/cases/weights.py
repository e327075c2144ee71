"""Weights that vanish, and one that outweighs all others.

A row has weight u (Y - P)/z for its class's stump. 1 - P is the double 1.0 - P, so a row whose P rounds to 1 has weight
exactly 0, and weights of almost settled rows are accurate to a few 2^-53 of u, not relative to themselves.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from thenar.compiler.trainers.logitboost import boost

from ..checks.rounds import ROUNDING, RoundState, moments, see_round
from ..finding import REFERENCE, Finding
from ..inputs.hard_data import HardSet, contradictory, imbalanced, intervals, noisy, separable


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of rounds with extreme weights, and the effect of settled rows."""
    yield from _extreme(60 if full else 6)
    yield from _settled(10_000 if full else 200)
    yield _underflow(5_000 if full else 1_000)


def extreme_sets() -> Iterator[HardSet]:
    """Yield sets whose row weights are near the limits of a double, or far from each other."""
    base = noisy(3, 24, 0.3, seed=1)
    rng = np.random.default_rng(2)
    n = len(base.labels)
    seventh = np.arange(n) == 7
    weights = {
        "one weight holds all but 2^-50": np.where(seventh, 1.0, 2.0**-50 / n),
        "one weight is 1e300, all others 1e-300": np.where(seventh, 1e300, 1e-300),
        "weights of the smallest doubles": np.ldexp(rng.integers(1, 9, n).astype(np.float64), -1074),
        "weights of the largest doubles": 1.7e308 * rng.random(n),
        "weights over 600 decades": 10.0 ** rng.uniform(-300, 300, n),
        "weights of 1 to 10^7": 10.0 ** rng.uniform(0, 7, n),
    }
    for name, of in weights.items():
        yield replace(base, name=name, weights=of)


def _extreme(rounds: int) -> Iterator[Finding]:
    """Check every round from the scores before it, and that all values stay in range."""
    chosen = Finding.of("stumps chosen under extreme weights", REFERENCE, 1.0, "x rounding")
    outputs = Finding.of("outputs of branches under extreme weights", REFERENCE, 1.0, "x rounding")
    outside = Finding.of("P, scores, losses and outputs in range", "the rules themselves", 0.0, "rounds")
    # The score of an empty class falls forever if two others contradict each other: P underflows to 0.
    sinking = contradictory([[2, 1, 0], [1, 1, 0]])
    for hard in (*extreme_sets(), separable(3), imbalanced(10**6), sinking):
        first = 1100 if hard is sinking else 0
        stumps, falling = boost(hard.X, hard.labels, hard.n_classes, rounds=first + rounds, weights=hard.weights)
        for number, moment in enumerate(moments(hard, stumps)):
            shares, is_finite = moment.shares, np.isfinite(moment.scores).all() and math.isfinite(moment.loss)
            in_range = ((shares >= 0) & (shares <= 1)).all() and (moment.weights >= 0).all()
            is_right = is_finite and in_range and moment.loss == falling[number]
            outside.see(float(not is_right), f"{hard.name}, round {number}")
            if first <= number < stumps.n_rounds and (number < first + 12 or number % 10 == 0):
                see_round(hard, stumps, number, moment.scores, 3.0, chosen, outputs)
        outside.see(float(not (np.abs(stumps.values) <= 3.0).all()), hard.name)
    yield from (chosen, outputs, outside)


def _settled(rounds: int) -> Iterator[Finding]:
    """Rows whose P is 1 have weight exactly 0 for their class; once all are settled, scores stay constant."""
    weigh = Finding.of("settled rows with a nonzero weight", "zero", 0.0, "rows")
    # Only the others' z = -1/(1 - P) are left, and if all members' P round to 1, P is below 2^-52: outputs lie between
    # -1 and -1 - 2^-52, up to 3 roundings, and a step is less than twice their difference.
    moved = Finding.of(
        "change of scores once all rows are settled", "nothing left to learn", 2 * 5 * ROUNDING, "score a round"
    )
    for hard in (separable(2), separable(14), intervals(5)):
        stumps, _ = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds)
        rest: RoundState | None = None
        first = 0
        for number, moment in enumerate(moments(hard, stumps)):
            settled = hard.member & (moment.shares == 1.0)
            weigh.see(
                float(np.count_nonzero(moment.weights[settled])), f"{hard.name}, round {number}", int(settled.sum())
            )
            if rest is None and settled.any(axis=0).all():
                first, rest = number, moment
        if rest is not None:
            moved.see(float(np.abs(moment.scores - rest.scores).max() / (rounds - first)), f"{hard.name} since {first}")
    yield from (weigh, moved)


def _underflow(rounds: int) -> Finding:
    """A class whose weights have all underflown has output 0: its score is constant, and it does not affect others."""
    worst = Finding.of("nonzero outputs of a class without weight", "nothing left to learn", 0.0, "outputs")
    empty_classes = [contradictory(counts) for counts in ([[2, 1, 0], [1, 1, 0]], [[3, 2, 0, 0, 0], [1, 5, 0, 0, 0]])]
    # Once the first class of both frames is certain, the others' rows remain: a third of their weight rounds to 0.
    heavy = contradictory([[1, 1], [1, 1]])
    left = replace(heavy, name="rows of the smallest doubles", weights=np.array([1.0, 1e-323, 1.0, 5e-324]))
    for hard in (*empty_classes, left):
        stumps, _ = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds, weights=hard.weights)
        for number, moment in enumerate(moments(hard, stumps)):
            gone = ~moment.weights.any(axis=1)
            if number < rounds and gone.any():
                outputs = stumps.values[number, gone]
                worst.see(float(np.count_nonzero(outputs)), f"{hard.name}, round {number + 1}", outputs.size)
    return worst
