"""Rounding error bounds of shares, losses and targets, used by the cases.

One rounding to nearest is off by at most 2^-53 of the number. All bounds are of first order, given as exact numbers:
products of two of them are negligible.
"""

import math
from collections.abc import Sequence

import mpmath
from mpmath import mpf

from ..reference.boosting import loss
from ..reference.numbers import precisely

ROUNDING = 2.0**-53  # the largest relative error of one rounding
SMALLEST = mpf(2) ** -1074
# exp within 1.06 ulp, each of at most 2^-52 of the number.
EXP_ROUNDINGS = 2.12


@precisely()
def part_of(got: float, truth: mpf, allowed: mpf) -> float:
    """Return |got - truth| as a part of the allowed error; if that is 0, any error is infinite."""
    error = abs(mpf(float(got)) - truth)
    return float(error / allowed) if allowed else math.inf if error else 0.0


@precisely()
def share_error(scores: Sequence[float], k: int, share: mpf) -> mpf:
    """Bound the error of P_k = e^x_k / sum e^x_j, x_j = F_j - max F, of the scores F (K,).

    x is rounded once, by 2^-53 |x|, which e^x turns into a relative error; exp and the quotient round, as do the K - 1
    additions. In the sum an error of x_j counts only with its share, and e^x |x| <= 1/e: K/e altogether; that of exp
    counts 2.12 once. An underflow is off by two of the smallest doubles, one in exp and one in the quotient.
    """
    classes, below = len(scores), max(scores) - mpf(scores[k])
    relative = below + EXP_ROUNDINGS + 1 + (classes - 1) * (1 + 1 / mpmath.e) + EXP_ROUNDINGS
    return relative * ROUNDING * share + 2 * SMALLEST


@precisely()
def loss_error(rows: Sequence[Sequence[float]], labels: Sequence[int], weights: Sequence[float]) -> mpf:
    """Bound the error of the mean of -ln P(label) over rows of scores (n, K), weighted.

    The weight and the mean, a quotient of two correctly rounded sums, round 3 times. A power of two has scaled the
    heaviest weight to [1/2, 1) before: a subnormal weight or product may be off by half of the smallest double, the
    former times its loss. The sum that divides them is at least 1/2, so that each counts once; an error of this size in
    that sum is negligible. The mean itself may be subnormal: 2 is more than enough for that.
    """
    errors = [_row_error(row, label) for row, label in zip(rows, labels, strict=True)]
    losses = [loss(row, label) for row, label in zip(rows, labels, strict=True)]
    parts = (u * (error + 3 * ROUNDING * each) for u, error, each in zip(weights, errors, losses, strict=True))
    return mpmath.fsum(parts) / mpmath.fsum(weights) + (2 + mpmath.fsum(1 + each for each in losses)) * SMALLEST


def _row_error(row: Sequence[float], label: int) -> mpf:
    """Bound the error of the loss of one row.

    For the largest score the loss is ln(1 + s), s = sum of e^x over the others: relative errors of s, and so of the
    logarithm, are |x| of each by its part of s, that of exp and those of K - 2 additions; ln within 2 ulp counts for 4,
    and the last two operations for one each. For another score it is ln t + gap, t = sum of all e^x: a relative error
    of t is an absolute one of its logarithm; in t, x counts as in `share_error`. The gap rounds, and so does the sum.
    """
    classes, gap = len(row), max(row) - mpf(row[label])
    if gap:
        inner = (classes - 1) * (1 + 1 / mpmath.e) + EXP_ROUNDINGS + 4 * math.log(classes)
        return (inner + gap + loss(row, label)) * ROUNDING
    others = [mpf(row[label]) - score for k, score in enumerate(row) if k != label]
    powers = [mpmath.exp(-x) for x in others]
    spread = mpmath.fsum(x * power for x, power in zip(others, powers, strict=True)) / mpmath.fsum(powers)
    return (spread + EXP_ROUNDINGS + classes + 4) * ROUNDING * loss(row, label) + classes * SMALLEST
