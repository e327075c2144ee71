"""Probabilities of scores, their loss, and what LogitBoost wants of them.

Friedman, Hastie and Tibshirani, Annals of Statistics 28 (2000), algorithm 6, with the clamp of the working response
that they recommend in section 5 and that Weka 3.6 has.
"""

from collections.abc import Sequence

import mpmath
from mpmath import mpf

from .numbers import precisely


@precisely()
def exp(x: float) -> mpf:
    """Return e^x."""
    return mpmath.exp(mpf(x))


@precisely()
def log(x: float) -> mpf:
    """Return ln x."""
    return mpmath.log(mpf(x))


@precisely()
def softmax(scores: Sequence[float]) -> list[mpf]:
    """Return P_k = e^F_k / sum_j e^F_j; no F is too large here."""
    powers = [mpmath.exp(mpf(score)) for score in scores]
    total = mpmath.fsum(powers)
    return [power / total for power in powers]


@precisely()
def loss(scores: Sequence[float], label: int) -> mpf:
    """Return -ln P of class `label`, = ln(1 + sum over the others of e^(F_k - F_label)), however small."""
    own = mpf(scores[label])
    others = (mpmath.exp(mpf(score) - own) for k, score in enumerate(scores) if k != label)
    return mpmath.log1p(mpmath.fsum(others))


@precisely()
def mean_loss(scores: Sequence[Sequence[float]], labels: Sequence[int], weights: Sequence[float] | None = None) -> mpf:
    """Return the mean of -ln P(label) over n rows of scores (n, K), weighted by `weights` (None: all 1)."""
    shares = [mpf(weight) for weight in ([1] * len(labels) if weights is None else weights)]
    losses = [loss(row, label) for row, label in zip(scores, labels, strict=True)]
    return mpmath.fsum(share * each for share, each in zip(shares, losses, strict=True)) / mpmath.fsum(shares)


@precisely()
def target(probability: float, is_member: bool, z_max: float, row_weight: float = 1) -> tuple[mpf, mpf]:
    """Return weight and working response (w, z) of a row: z = 1/P or -1/(1 - P) within +-z_max, w = u (Y - P) / z."""
    own = mpf(probability) if is_member else 1 - mpf(probability)
    size = 1 / own if own * z_max > 1 else mpf(z_max)
    z = size if is_member else -size
    return row_weight * (int(is_member) - mpf(probability)) / z, z
