"""Weights that vanish, one that outweighs all, responses at their clamp everywhere, scores that drift.

A row weighs u (Y - P)/z with its class's stump. 1 - P is taken as the double 1.0 - P, so that a row whose P rounds to 1
weighs exactly 0, and weights of rows next to settled are true to a few 2^-53 of u, not of themselves.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from thenar.compiler.boosting.boost import boost

from ..checks.class_rounds import see_round
from ..checks.drift import drift
from ..checks.roundings import ROUNDING
from ..checks.rounds import Moment, moments
from ..finding import Case, Finding, Worst
from ..inputs.hard_data import Floats, HardSet, contradictory, imbalanced, intervals, noisy, separable

CASE = Case(
    title="Weights",
    danger="weights underflow, or one holds everything, and answers are made of rounding; scores drift away",
)
REFERENCE = "60 digits"


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of rounds with extreme weights, what settled rows weigh and do, and drift over 10,000 rounds."""
    yield from _extreme(60 if full else 6)
    yield from _settled(10_000 if full else 200)
    yield _underflow(5_000 if full else 1_000)
    yield _clamped()
    yield from drift(10_000 if full else 150)


def extreme_sets() -> Iterator[HardSet]:
    """Yield sets whose row weights are next to the ends of what a double holds, or of each other."""
    base = noisy(3, 24, 0.3, seed=1)
    rng = np.random.default_rng(2)
    n = len(base.labels)
    seventh = np.arange(n) == 7
    weights: dict[str, Floats] = {
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
    """Every round from the scores before it, and that nothing leaves its range."""
    chosen = Worst("stumps chosen under extreme weights", REFERENCE, 1.0, "x rounding")
    answers = Worst("answers of branches under extreme weights", REFERENCE, 1.0, "x rounding")
    outside = Worst("P, scores, losses and answers in range", "the rules themselves", 0.0, "rounds")
    # An empty class beside two that contradict each other sinks for ever: P falls through the smallest doubles to 0.
    sinking = contradictory([[2, 1, 0], [1, 1, 0]])
    for hard, first in [(hard, 0) for hard in extreme_sets()] + [
        (separable(3), 0),
        (imbalanced(10**6), 0),
        (sinking, 1100),
    ]:
        stumps, falling = boost(hard.X, hard.labels, hard.n_classes, rounds=first + rounds, weights=hard.weights)
        for number, moment in enumerate(moments(hard, stumps)):
            outside.see(float(not _in_range(moment, falling[number])), f"{hard.name}, round {number}")
            if first <= number < stumps.n_rounds and (number < first + 12 or number % 10 == 0):
                see_round(hard, stumps, number, moment.scores, 3.0, chosen, answers)
        outside.see(float(not (np.abs(stumps.values) <= 3.0).all()), hard.name)
    yield from (worst.finding() for worst in (chosen, answers, outside))


def _in_range(moment: Moment, loss: float) -> bool:
    finite = np.isfinite(moment.scores).all() and math.isfinite(loss)
    shares, weights = moment.shares, moment.weights
    return bool(finite and moment.loss == loss and ((shares >= 0) & (shares <= 1)).all() and (weights >= 0).all())


def _settled(rounds: int) -> Iterator[Finding]:
    """Rows whose P is 1 weigh exactly 0 with their class; where all are settled, scores stay where they are."""
    weigh = Worst("settled rows that still weigh something", "zero", 0.0, "rows")
    # Only the others' z = -1/(1 - P) are left, and where all members' P round to 1, P is below 2^-52: answers lie
    # between -1 and -1 - 2^-52, but for their 3 roundings, and a step is less than twice what they differ by.
    moved = Worst(
        "how far scores move once all rows are settled", "nothing left to learn", 2 * 5 * ROUNDING, "score a round"
    )
    for hard in (separable(2), separable(14), intervals(5)):
        stumps, _ = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds)
        since: tuple[int, Floats] | None = None
        for number, moment in enumerate(moments(hard, stumps)):
            settled = hard.member & (moment.shares == 1.0)
            weigh.see(
                float(np.count_nonzero(moment.weights[settled])), f"{hard.name}, round {number}", int(settled.sum())
            )
            if since is None and settled.any(axis=0).all():
                since = number, moment.scores
        if since is not None:
            first, scores = since
            moved.see(float(np.abs(moment.scores - scores).max() / (rounds - first)), f"{hard.name} since {first}")
    yield from (weigh.finding(), moved.finding())


def _underflow(rounds: int) -> Finding:
    """A class whose weights have all underflown answers 0: it neither rises nor disturbs the others any more."""
    worst = Worst("answers other than 0 of a class without any weight", "nothing left to learn", 0.0, "answers")
    empty_classes = [contradictory(counts) for counts in ([[2, 1, 0], [1, 1, 0]], [[3, 2, 0, 0, 0], [1, 5, 0, 0, 0]])]
    # Once the two frames' first class is certain, the others' rows are left with it: a third of them rounds to nothing.
    heavy = contradictory([[1, 1], [1, 1]])
    left = replace(heavy, name="rows of the smallest doubles", weights=np.array([1.0, 1e-323, 1.0, 5e-324]))
    for hard in (*empty_classes, left):
        stumps, _ = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds, weights=hard.weights)
        for number, moment in enumerate(moments(hard, stumps)):
            gone = ~moment.weights.any(axis=1)
            if number < rounds and gone.any():
                answers = stumps.values[number, gone]
                worst.see(float(np.count_nonzero(answers)), f"{hard.name}, round {number + 1}", answers.size)
    return worst.finding()


def _clamped() -> Finding:
    """Responses at their clamp on every row, of every class or of one: then every pure branch answers the clamp.

    Before the first round 1/P = K. With two classes and z_max below 2 all rows of both are clamped, with K and below
    K/(K - 1) those of all; under the usual clamp of 3, those of the class that all rows belong to, of 4 declared. (All
    rows of two classes never are: with every P below 1/3 the loss is above ln 3, and it starts at ln 2 and falls.)
    """
    # The weight |Y - P| / z_max rounds with 1/z_max and the product, and twice more here; so do the answers C/W.
    worst = Worst("responses at their clamp on every row", "z_max itself", 4 * ROUNDING, "relative")
    alone = HardSet("one class of 4", np.array([[0], [1], [1], [0]]), np.zeros(4, np.intp), 4, 1)
    for hard, z_max, classes in (
        (separable(2), 1.5, 2),
        (separable(14), 1.05, 14),
        (separable(33), 1.03, 33),
        (alone, 3.0, 1),
    ):
        stumps, _ = boost(hard.X, hard.labels, hard.n_classes, rounds=1, z_max=z_max)
        first = next(moments(hard, stumps, z_max))
        clamps = first.weights[:classes] * z_max / np.abs(first.responses[:classes])
        answers = np.abs(stumps.values[0][:classes, :2]) / z_max
        for name, ratios in (("rows", clamps), ("answers", answers)):
            worst.see(float(np.abs(ratios - 1.0).max()), f"{hard.name}, z_max {z_max:g}, {name}", ratios.size)
    return worst.finding()
