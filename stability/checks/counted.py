"""Rows counted by frame: the shares of the classes on each, and the entropy that they leave."""

from collections import defaultdict

import mpmath
import numpy as np
from mpmath import mpf

from ..inputs.hard_data import HardSet
from ..reference.information import entropy_bits
from ..reference.numbers import precisely
from .roundings import ROUNDING, share_error
from .rounds import Moment

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
