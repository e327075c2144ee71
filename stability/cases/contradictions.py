"""The same frame with different grasps, one class a million times as frequent as the other, random labels.

The best possible prediction is the share of each class among the rows of a frame: that is the reference here, and its
entropy is the least possible loss. If one switch separates the frames, stumps can reach both, so boosting must converge
to them up to rounding. The case `separable` explains when the loss falls on the way.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product

import mpmath
import numpy as np
from mpmath import mpf

from thenar.compiler.trainers.logitboost import boost
from thenar.runtime.model.tables import winners

from ..checks.rounds import ROUNDING, RoundState, loss_rounding, moments, rise_rounding, share_error
from ..finding import REFERENCE, Finding
from ..inputs.hard_data import HardSet, contradictory, imbalanced, noisy
from ..reference.information import entropy_bits
from ..reference.numbers import distance, precisely


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of the limit on contradictory frames, and the effects of noise."""
    yield from _rest(frames(full), 2_000 if full else 120)
    yield _ties()
    yield from _noise(1_000 if full else 40)


def frames(full: bool) -> Iterator[HardSet]:
    """Yield sets of two frames that one switch separates, with the classes' counts on each."""
    for power in range(1, 8) if full else (1, 6, 7):
        yield imbalanced(10**power)
        yield contradictory([[1, 10**power], [10**power, 3]])
    for percent in (0, 10, 20, 30, 40, 50, 60):
        yield contradictory([[100 - percent, percent], [percent + 1, 99 - percent]])
    yield contradictory([[1, 2, 3], [3, 2, 1]])
    yield contradictory([[10**7, 1, 1], [1, 10**6, 10**3]])
    rng = np.random.default_rng(1)
    for classes in (4, 14, 33) if full else (4,):
        yield contradictory(rng.integers(1, 100, (2, classes)).tolist())


def _rest(sets: Iterator[HardSet], rounds: int) -> Iterator[Finding]:
    """Yield the final errors of P against the shares of the counts, and of losses against the remaining entropy."""
    shares = Finding.of("final P of a class on a contradictory frame", "shares of the counts", 1.0, "x rounding")
    losses = Finding.of("the final loss", "the remaining entropy, 60 digits", 1.0, "x rounding")
    for hard in sets:
        stumps, falling = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds, weights=hard.weights)
        *_, last = moments(hard, stumps)
        shares.see(resting_error(hard, last), hard.name, last.shares.size)
        least = entropy_left(hard)
        # Frames of a single class lose the most that remains if each of K classes keeps `unsettled` there.
        lacking = sum(row.count(0) for row in hard.counts().values())
        idle = lacking * unsettled(last) / float(hard.scaled_weights.sum())
        allowed = loss_rounding(hard.n_classes, float(least)) + idle
        losses.see(distance(falling[-1], least) / allowed, hard.name)
    yield from (shares, losses)


@precisely()
def entropy_left(hard: HardSet) -> mpf:
    """Return the entropy of the class given the frame, in nats: the least possible mean loss of scores of frames."""
    counts = list(hard.counts().values())
    total = sum(map(sum, counts))
    return mpmath.fsum(sum(row) * entropy_bits(row) for row in counts) / total * mpmath.log(2)


@precisely()
def resting_error(hard: HardSet, last: RoundState) -> float:
    """Return the error of shares P against those of the counts, as a share of the rounding bound after convergence.

    Boosting converges to sum u (Y - P) = 0. There 1 - P is off by 2^-54, the resolution of P, and the products round.
    P cannot be more accurate than the scores' last places allow: two scores, each rounded, each at most one place off;
    nor than its own rounding. Each class that a frame lacks may keep the weight of `unsettled`.
    """
    errors, counts = [], hard.counts()
    idle = unsettled(last) * float(hard.row_weights.max() / hard.scaled_weights.max())
    for row, F, got in zip(hard.X.tolist(), last.scores.T.tolist(), last.shares.T.tolist(), strict=True):
        own = counts[tuple(row)]
        for k, P in enumerate(got):
            truth = mpf(own[k]) / sum(own)
            allowed = ROUNDING * (1 + truth * (4 + 4 * max(map(abs, F)))) + share_error(F, k, truth)
            errors.append(abs(P - truth) / (allowed + own.count(0) * idle / sum(own)))
    return float(max(errors))


def unsettled(last: RoundState) -> float:
    """Return the most weight that a frame can keep: below a share of 2^-38 of its class's, its branch counts as empty.

    Then it follows the mean of all rows, which is constant once they have converged, and learns nothing more itself.
    """
    return 2.0**-38 * float(last.weights.sum(axis=1).max())


def _ties() -> Finding:
    """Classes of equal counts on a frame: the lowest-numbered is predicted, by the tie rule."""
    worst = Finding.of("equal counts go to the lowest class", "the rule itself", 0.0, "frames")
    for counts in (
        [[1, 1], [2, 2]],
        [[2, 2, 1], [1, 2, 2]],
        [[10**7, 10**7, 1], [1, 10**6, 10**6]],
        [[7] * 5, [9] * 5],
    ):
        hard = contradictory(counts)
        stumps, _ = boost(hard.X, hard.labels, hard.n_classes, rounds=100, weights=hard.weights)
        predicted = winners(stumps.scores(np.array([[0], [1]]))).tolist()
        for prediction, row in zip(predicted, counts, strict=True):
            worst.see(float(prediction != row.index(max(row))), hard.name)
    return worst


def _noise(rounds: int) -> Iterator[Finding]:
    """Sets of 16 frames with 0 to 60 % random labels: losses, and the fall of the loss where it is required."""
    below = Finding.of("losses below the remaining entropy", REFERENCE, 0.0, "rounds")
    rises = Finding.of("rise of the loss where it must fall", "convexity", 1.0, "x rounding")
    # At a shrinkage of 1/(K - 1) or below the loss must fall.
    for percent, (classes, shrinkage) in product((0, 10, 20, 30, 40, 50, 60), ((2, 1.0), (5, 0.25), (5, 1.0))):
        hard = noisy(classes, 60, percent / 100, seed=percent)
        hard = replace(hard, X=hard.X[:, :4], n_switches=4)
        stumps, falling = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds, shrinkage=shrinkage)
        least = float(entropy_left(hard))
        above = least - loss_rounding(hard.n_classes, least)
        below.see(float(sum(loss < above for loss in falling)), hard.name, len(falling))
        if shrinkage * (hard.n_classes - 1) <= 1:
            for number, (before, after) in enumerate(pairwise(moments(hard, stumps)), 1):
                rise = max(0.0, after.loss - before.loss)
                rises.see(rise / rise_rounding(hard.n_classes, before, after), f"{hard.name}, round {number}")
    yield from (below, rises)
