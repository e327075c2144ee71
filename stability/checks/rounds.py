"""What a training saw, round by round, and rows counted by frame: the shares and the entropy that they leave."""

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import mpmath
import numpy as np
from mpmath import mpf

from thenar.compiler.boosting.boost import weights_and_responses
from thenar.compiler.boosting.stumps import Stumps
from thenar.compiler.elementary import Floats, softmax_and_loss

from ..inputs.hard_data import HardSet
from ..reference.information import entropy_bits
from ..reference.numbers import precisely
from .roundings import ROUNDING, share_error


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """After a round: scores F and shares P (K, n), the weights w and weighted responses w z (K, n) that the next round
    is fitted to, and the loss.
    """

    scores: Floats
    shares: Floats
    weights: Floats
    responses: Floats
    loss: float


def moments(hard: HardSet, stumps: Stumps, z_max: float = 3.0) -> Iterator[Moment]:
    """Yield the moment before the first round and after every one; the bits are those that training had."""
    weights = None if hard.weights is None else hard.scaled_weights
    stages = (np.ascontiguousarray(scores.T) for scores in stumps.staged_scores(hard.X))
    for scores in chain([np.zeros(hard.member.shape)], stages):
        shares, loss = softmax_and_loss(scores, hard.labels, weights)
        yield Moment(scores, shares, *weights_and_responses(shares, hard.member, z_max, weights), loss)


def loss_rounding(n_classes: int, loss: float) -> float:
    """Return the most by which a loss of K classes, as it is computed, can be off the loss of the same scores.

    Of a row, in units of 2^-53, with d the distances of the scores to their largest: exp is within 2 of e^-d, d rounded
    puts sum p d <= ln K on their sum, K - 1 additions as many again; ln is within 2 ulp, 4 of ln K at most; the largest
    score less the label's, and adding it, 2 of the loss; its weight, the two sums and their quotient 4 of the loss.
    """
    return ROUNDING * (2 + math.log(n_classes) + (n_classes - 1) + 4 * math.log(n_classes) + 6 * loss)


def rise_rounding(n_classes: int, before: Moment, after: Moment, z_max: float = 3.0) -> float:
    """Return the most by which the computed loss can rise in a round that does not raise the loss of exact numbers.

    Both losses are rounded. Scores are rounded to doubles, which a loss L feels by 2 |F| L at most: |dL/dF| is at most
    2 (1 - P), and 1 - P <= L. And a row whose P rounds to 1 has no weight with its own class's stump, though it lacks
    up to (K - 1) 2^-53 of certainty: one class of K moves it blindly, which can multiply what it lacks by e^z_max.
    """
    rounded = loss_rounding(n_classes, before.loss) + loss_rounding(n_classes, after.loss)
    largest = max(float(np.abs(moment.scores).max()) for moment in (before, after))
    held = ROUNDING * 2 * largest * (before.loss + after.loss)
    blind = ROUNDING * (n_classes - 1) / n_classes * math.expm1(z_max)
    return rounded + held + blind


def mean_score(scores: Floats) -> float:
    """Return the largest |mean over the classes| of scores F (K, n)."""
    return max(abs(math.fsum(row)) for row in scores.T.tolist()) / len(scores)


Counts = dict[tuple[int, ...], list[int]]


def counted(hard: HardSet) -> Counts:
    """Return how often each class occurs on each frame; weights are whole numbers."""
    weights = np.ones(len(hard.labels)) if hard.weights is None else hard.weights
    counts: Counts = defaultdict(lambda: [0] * hard.n_classes)
    for row, label, weight in zip(hard.X.tolist(), hard.labels.tolist(), weights.tolist(), strict=True):
        counts[tuple(row)][label] += int(weight)
    return counts


@precisely()
def entropy_left(hard: HardSet) -> mpf:
    """Return the entropy of the class given the frame, in nats: the least mean loss that any scores of frames have."""
    counts = list(counted(hard).values())
    total = sum(map(sum, counts))
    return mpmath.fsum(sum(row) * entropy_bits(row) for row in counts) / total * mpmath.log(2)


@precisely()
def resting_error(hard: HardSet, last: Moment) -> float:
    """Return how far shares P are off those of the counts, as a share of what rounding allows where boosting rests.

    It rests where sum u (Y - P) is 0. There 1 - P is off by 2^-54, which is all that P can then be told to, and the
    products round. P cannot be nearer than the scores' last places let it: two scores, each rounded, each at most one
    place off; nor than its own rounding. Each class that a frame lacks may keep what `unsettled` says.
    """
    errors, counts, idle = [], counted(hard), unsettled(last)
    for row, F, got in zip(hard.X.tolist(), last.scores.T.tolist(), last.shares.T.tolist(), strict=True):
        own = counts[tuple(row)]
        for k, P in enumerate(got):
            truth = mpf(own[k]) / sum(own)
            allowed = ROUNDING * (1 + truth * (4 + 4 * max(map(abs, F)))) + share_error(F, k, truth)
            errors.append(abs(P - truth) / (allowed + own.count(0) * idle * hard.scale / sum(own)))
    return float(max(errors))


def unsettled(last: Moment) -> float:
    """Return the most weight that a frame can keep: below a share of 2^-38 of its class's, its branch counts as empty.

    Then it follows the mean of all rows, which is at rest where they are, and learns no more of its own.
    """
    return 2.0**-38 * float(last.weights.sum(axis=1).max())


def idle_loss(hard: HardSet, last: Moment) -> float:
    """Return the most loss that frames of one class only can keep, of which each class of K has `unsettled` at most."""
    lacking = sum(row.count(0) for row in counted(hard).values())
    return lacking * unsettled(last) / float(hard.scaled_weights.sum())
