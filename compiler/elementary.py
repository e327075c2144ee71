"""exp, log and softmax with the same bits on every machine.

numpy and the C library pick an exp by processor, and their last bits differ. These are made of single IEEE operations
(add, multiply, divide, round, scale by a power of two) in one fixed order, which every machine rounds alike. Errors
stay below 1 ulp for exp and 2 ulp for log (tests hold them against mpmath).
"""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_INVERSE_LN2 = 1.4426950408889634
# ln 2 in two parts (Cody and Waite): the high one ends in 21 zero bits, so k * _LN2_HIGH is exact for |k| < 2^21.
_LN2_HIGH = 0.6931471803691238
_LN2_LOW = 1.9082149292705877e-10
_EXP_UNDERFLOW = -746.0
_EXP_TERMS = tuple(1.0 / math.factorial(n) for n in range(13, 1, -1))
_LOG_TERMS = tuple(2.0 / n for n in range(23, 1, -2))
_SQRT_HALF = 0.7071067811865476


def exp(x: Floats) -> Floats:
    """Return e^x for x <= 709, any shape; below -746 the result is exactly 0."""
    x = np.maximum(x, _EXP_UNDERFLOW)
    power = np.rint(x * _INVERSE_LN2)
    rest = (x - power * _LN2_HIGH) - power * _LN2_LOW
    series = np.full_like(rest, _EXP_TERMS[0])
    for term in _EXP_TERMS[1:]:
        series *= rest
        series += term
    series *= rest
    series *= rest
    series += rest
    series += 1.0
    return np.ldexp(series, power.astype(np.int32))


def log(x: Floats) -> Floats:
    """Return ln x for finite x > 0, any shape."""
    mantissa, power = np.frexp(x)
    low = mantissa < _SQRT_HALF
    mantissa = np.where(low, mantissa + mantissa, mantissa)
    exponent = (power - low).astype(np.float64)
    f = mantissa - 1.0
    s = f / (mantissa + 1.0)
    square = s * s
    series = np.full_like(s, _LOG_TERMS[0])
    for term in _LOG_TERMS[1:]:
        series *= square
        series += term
    # ln m = 2s + s^3 * series = f - s * (f - s^2 * series): f is exact, so small logarithms keep all their bits.
    return (f - s * (f - square * series)) + exponent * _LN2_LOW + exponent * _LN2_HIGH


def add_up(rows: Floats) -> Floats:
    """Return the sum over axis 0 of (K, n), added strictly in order of the rows."""
    total: Floats = rows[0].copy()
    for row in rows[1:]:
        total += row
    return total


def softmax(scores: Floats) -> Floats:
    """Return P (K, n), each column summing to 1 within K roundings, for scores (K, n)."""
    shares = exp(scores - scores.max(axis=0))
    shares /= add_up(shares)
    return shares


def softmax_and_loss(scores: Floats, labels: NDArray[np.intp], weights: Floats | None) -> tuple[Floats, float]:
    """Return P (K, n) and the weighted mean of -ln P(label) for scores (K, n), labels and weights (n,); None: all 1.

    Its sums are correctly rounded (fsum), and it is taken from the scores, not from P: the loss of a class that is next
    to certain keeps its bits.
    """
    top = scores.max(axis=0)
    shares = exp(scores - top)
    total = add_up(shares)
    shares /= total
    losses = log(total) + (top - scores[labels, np.arange(labels.size)])
    if weights is None:
        return shares, math.fsum(losses.tolist()) / labels.size
    return shares, math.fsum((losses * weights).tolist()) / math.fsum(weights.tolist())
