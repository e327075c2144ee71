"""The state of a training, round by round, and counts of rows by frame."""

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from thenar.compiler.elementary import Floats, softmax_and_loss
from thenar.compiler.trainers.logitboost import weights_and_responses
from thenar.compiler.trainers.stumps import Stumps

from ..inputs.hard_data import HardSet
from .roundings import ROUNDING


@dataclass(frozen=True, slots=True, eq=False)
class RoundState:
    """The state after a round: scores F and shares P (K, n), weights w and weighted responses w z (K, n) of the next
    round, and the loss.
    """

    scores: Floats
    shares: Floats
    weights: Floats
    responses: Floats
    loss: float


def moments(hard: HardSet, stumps: Stumps, z_max: float = 3.0) -> Iterator[RoundState]:
    """Yield the state before the first round and after every round, equal to the training's to the last bit."""
    weights = None if hard.weights is None else hard.scaled_weights
    stages = (np.ascontiguousarray(scores.T) for scores in stumps.staged_scores(hard.X))
    for scores in chain([np.zeros(hard.member.shape)], stages):
        shares, loss = softmax_and_loss(scores, hard.labels, weights)
        yield RoundState(scores, shares, *weights_and_responses(shares, hard.member, z_max, weights), loss)


def loss_rounding(n_classes: int, loss: float) -> float:
    """Return the largest error of the computed loss of K classes, given the scores.

    For a row, in units of 2^-53, with d the distances of the scores to their largest: exp is within 2 of e^-d, rounding
    of d adds sum p d <= ln K to their sum, K - 1 additions as many again; ln is within 2 ulp, at most 4 of ln K; the
    difference of the largest and the label's score, and its addition, 2 of the loss; the weight, the two sums and their
    quotient 4 of the loss.
    """
    return ROUNDING * (2 + math.log(n_classes) + (n_classes - 1) + 4 * math.log(n_classes) + 6 * loss)


def rise_rounding(n_classes: int, before: RoundState, after: RoundState, z_max: float = 3.0) -> float:
    """Return the largest rise of the computed loss in a round that does not raise the exact loss.

    Both losses are rounded. Scores are rounded to doubles, which changes a loss L by at most 2 |F| L: |dL/dF| is at
    most 2 (1 - P), and 1 - P <= L. Also, a row whose P rounds to 1 has no weight for its own class's stump, though
    1 - P is up to (K - 1) 2^-53: one class of K changes its score blindly, which can multiply this gap by e^z_max.
    """
    rounded = loss_rounding(n_classes, before.loss) + loss_rounding(n_classes, after.loss)
    largest = max(float(np.abs(moment.scores).max()) for moment in (before, after))
    held = ROUNDING * 2 * largest * (before.loss + after.loss)
    blind = ROUNDING * (n_classes - 1) / n_classes * math.expm1(z_max)
    return rounded + held + blind


Counts = dict[tuple[int, ...], list[int]]


def counted(hard: HardSet) -> Counts:
    """Return the count of each class on each frame; weights are integers."""
    weights = np.ones(len(hard.labels)) if hard.weights is None else hard.weights
    counts: Counts = defaultdict(lambda: [0] * hard.n_classes)
    for row, label, weight in zip(hard.X.tolist(), hard.labels.tolist(), weights.tolist(), strict=True):
        counts[tuple(row)][label] += int(weight)
    return counts
