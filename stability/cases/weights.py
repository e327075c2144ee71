"""Weights that vanish, one that outweighs all others, responses clamped everywhere, drifting scores.

A row has weight u (Y - P)/z for its class's stump. 1 - P is the double 1.0 - P, so a row whose P rounds to 1 has weight
exactly 0, and weights of almost settled rows are accurate to a few 2^-53 of u, not relative to themselves.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import Stumps, centred
from thenar.compiler.elementary import Floats, add_up

from ..checks.class_rounds import see_round
from ..checks.roundings import ROUNDING
from ..checks.rounds import RoundState, mean_score, moments
from ..finding import REFERENCE, Case, Finding, Worst
from ..inputs.hard_data import HardSet, contradictory, imbalanced, intervals, noisy, separable
from ..reference import boosting as ensembles
from ..reference.numbers import precisely


def drift(rounds: int) -> Iterator[Finding]:
    """Yield the drift of scores over `rounds` rounds on sets with half of their labels random."""
    means = Worst("mean over the classes of scores", "zero", 1.0, "x rounding")
    scores = Worst("scores after all rounds", "60 digits", 1.0, "x rounding")
    added = Worst("adding up the steps of all rounds", "60 digits", 1.0, "x rounding")
    for hard, shrinkage in ((noisy(33, 66, 0.5, seed=3), 1.0), (noisy(14, 42, 0.5, seed=4), 0.1)):
        stumps, _ = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds, shrinkage=shrinkage)
        rows = hard.X[:2]
        ensemble = stumps.columns.tolist(), stumps.thresholds.tolist(), stumps.values.tolist(), stumps.shrinkage
        steps = _steps(stumps, rows)
        allowed, got = step_rounding(stumps, steps), stumps.scores(rows).T
        for row in range(len(rows)):
            at = f"{hard.name}, shrinkage {shrinkage:g}, row {row}, {rounds} rounds"
            own, ours = allowed[:, row], got[:, row].tolist()
            means.see(mean_score(got[:, row : row + 1]) / float(own.mean()), at)
            truth = ensembles.scores(*ensemble, rows[row].tolist())
            scores.see(worst_share(ours, truth, own.tolist()), at)
            added.see(worst_share(ours, *true_sums(centred_steps(steps[:, :, row], shrinkage))), at)
    yield from (worst.finding() for worst in (means, scores, added))


def _steps(stumps: Stumps, X: NDArray[np.int64]) -> Floats:
    """Return the outputs of the stumps for rows X (n, d), in every round: (M, K, n)."""
    outputs = []
    for columns, thresholds, values in zip(stumps.columns, stumps.thresholds, stumps.values, strict=True):
        inputs = X[:, columns].T
        outputs.append(np.where(inputs <= thresholds[:, np.newaxis], values[:, :1], values[:, 1:2]))
    return np.array(outputs)


def centred_steps(outputs: Floats, shrinkage: float) -> Floats:
    """Return the steps of the scores of one row (M, K), from the outputs (M, K) for it."""
    return np.ascontiguousarray(centred(np.ascontiguousarray(outputs.T), shrinkage).T)


def step_rounding(stumps: Stumps, outputs: Floats) -> Floats:
    """Return the largest rounding error of each score (K, n), from the actual terms of each round.

    A step is (g - sum g / K) (K - 1)/K: g rounds once, each partial sum and the quotient once, the difference once, and
    the product and its quotient once each. The rounded values are known, so 2^-53 of them is the bound; errors of g
    also affect the mean. The scores themselves round once, at the end.
    """
    k = stumps.n_classes
    total = np.zeros(outputs.shape[1:])
    for g in outputs * stumps.shrinkage:
        partial = np.abs(np.cumsum(g, axis=0)[1:]).sum(axis=0) / k
        mean = np.abs(add_up(g)) / k
        multiplied = 0.0 if stumps.shrinkage == 1.0 else np.abs(g) + np.abs(g).mean(axis=0)
        total += multiplied + partial + mean + 3 * np.abs(g - add_up(g) / k)
    final = np.abs(centred(outputs.sum(axis=0), stumps.shrinkage))
    bound: Floats = ROUNDING * (total + final)
    return bound


@precisely()
def true_sums(steps: Floats) -> tuple[list[mpf], list[float]]:
    """Return the sums (K,) of steps (M, K), and the largest error of each compensated sum.

    The sum rounds once; the carry, M errors of 2^-53 of partial sums, rounds M times itself.
    """
    sums = [mpmath.fsum(column) for column in steps.T.tolist()]
    largest = np.abs(np.cumsum(steps, axis=0)).max(axis=0)
    carried = (len(steps) * ROUNDING) ** 2 * largest
    return sums, [float(ROUNDING * abs(total) + lost) for total, lost in zip(sums, carried.tolist(), strict=True)]


@precisely()
def worst_share(got: Sequence[float], truth: Sequence[mpf], allowed: Sequence[float]) -> float:
    """Return the largest error as a share of the allowed one."""
    errors = zip(got, truth, allowed, strict=True)
    return float(max(abs(ours - theirs) / bound for ours, theirs, bound in errors))


CASE = Case(
    title="Weights",
    danger="weights underflow, or one holds everything, and outputs are rounding residue; scores drift",
)


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of rounds with extreme weights, the effect of settled rows, and drift over 10,000 rounds."""
    yield from _extreme(60 if full else 6)
    yield from _settled(10_000 if full else 200)
    yield _underflow(5_000 if full else 1_000)
    yield _clamped()
    yield from drift(10_000 if full else 150)


def extreme_sets() -> Iterator[HardSet]:
    """Yield sets whose row weights are near the limits of a double, or far from each other."""
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
    """Check every round from the scores before it, and that all values stay in range."""
    chosen = Worst("stumps chosen under extreme weights", REFERENCE, 1.0, "x rounding")
    outputs = Worst("outputs of branches under extreme weights", REFERENCE, 1.0, "x rounding")
    outside = Worst("P, scores, losses and outputs in range", "the rules themselves", 0.0, "rounds")
    # The score of an empty class falls forever if two others contradict each other: P underflows to 0.
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
                see_round(hard, stumps, number, moment.scores, 3.0, chosen, outputs)
        outside.see(float(not (np.abs(stumps.values) <= 3.0).all()), hard.name)
    yield from (worst.finding() for worst in (chosen, outputs, outside))


def _in_range(moment: RoundState, loss: float) -> bool:
    finite = np.isfinite(moment.scores).all() and math.isfinite(loss)
    shares, weights = moment.shares, moment.weights
    return bool(finite and moment.loss == loss and ((shares >= 0) & (shares <= 1)).all() and (weights >= 0).all())


def _settled(rounds: int) -> Iterator[Finding]:
    """Rows whose P is 1 have weight exactly 0 for their class; once all are settled, scores stay constant."""
    weigh = Worst("settled rows with a nonzero weight", "zero", 0.0, "rows")
    # Only the others' z = -1/(1 - P) are left, and if all members' P round to 1, P is below 2^-52: outputs lie between
    # -1 and -1 - 2^-52, up to 3 roundings, and a step is less than twice their difference.
    moved = Worst(
        "change of scores once all rows are settled", "nothing left to learn", 2 * 5 * ROUNDING, "score a round"
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
    """A class whose weights have all underflown has output 0: its score is constant, and it does not affect others."""
    worst = Worst("nonzero outputs of a class without weight", "nothing left to learn", 0.0, "outputs")
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
    return worst.finding()


def _clamped() -> Finding:
    """Responses clamped on every row, of every class or of one: then every pure branch has the clamp as output.

    Before the first round 1/P = K. With two classes and z_max below 2 all rows of both are clamped, with K and below
    K/(K - 1) those of all; with the usual clamp of 3, those of the class that all rows belong to, of 4 declared. (All
    rows of two classes never are: with every P below 1/3 the loss is above ln 3, and it starts at ln 2 and falls.)
    """
    # The weight |Y - P| / z_max rounds with 1/z_max and the product, and twice more here; so do the outputs C/W.
    worst = Worst("responses clamped on every row", "z_max itself", 4 * ROUNDING, "relative")
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
        outputs = np.abs(stumps.values[0][:classes, :2]) / z_max
        for name, ratios in (("rows", clamps), ("outputs", outputs)):
            worst.see(float(np.abs(ratios - 1.0).max()), f"{hard.name}, z_max {z_max:g}, {name}", ratios.size)
    return worst.finding()
