"""What a training saw, round by round, taken from the ensemble that it left."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from thenar.compiler.boosting.boost import weights_and_responses
from thenar.compiler.boosting.stumps import Stumps
from thenar.compiler.elementary import softmax_and_loss

from ..inputs.hard_data import Floats, HardSet
from .roundings import ROUNDING


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
