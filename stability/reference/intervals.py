"""Intervals of rates: Wilson's of one proportion, Student's of several; and their quantiles."""

from collections.abc import Sequence
from functools import lru_cache

import mpmath
from mpmath import mpf

from .numbers import precisely

Interval = tuple[mpf, mpf]


@precisely()
def wilson(correct: float, total: int, level: float = 0.95) -> Interval:
    """Return the two p with (correct/total - p)^2 = z^2 p (1 - p) / total: E. B. Wilson 1927. `correct` may be a mean.

    A rate's complement has the complement of its interval: the upper end is 1 minus the lower end for the errors.
    """
    z = normal_quantile((1 + mpf(str(level))) / 2)
    return wilson_of(mpf(correct) / total, z**2 / total)


@precisely()
def wilson_of(rate: mpf, q: mpf) -> Interval:
    """Return the two p with (rate - p)^2 = q p (1 - p)."""
    return _lower(rate, q), 1 - _lower(1 - rate, q)


def _lower(rate: mpf, q: mpf) -> mpf:
    """Return the lesser root p of (1 + q) p^2 - (2 rate + q) p + rate^2; exactly 0 at rate 0."""
    half = rate + q / 2
    return rate**2 / (half + mpmath.sqrt(half**2 - (1 + q) * rate**2))


@precisely()
def student(rates: Sequence[float], level: float = 0.95) -> Interval:
    """Return mean -+ t s / sqrt(n) of n >= 2 numbers, s^2 their sum of squares about the mean over n - 1."""
    n, numbers = len(rates), [mpf(rate) for rate in rates]
    mean = mpmath.fsum(numbers) / n
    deviation = mpmath.sqrt(mpmath.fsum((x - mean) ** 2 for x in numbers) / (n - 1))
    reach = student_quantile(n - 1, (1 + mpf(str(level))) / 2) * deviation / mpmath.sqrt(n)
    return mean - reach, mean + reach


@lru_cache
@precisely()
def normal_quantile(p: float) -> mpf:
    """Return z with P(N(0, 1) <= z) = p, 0 < p < 1."""
    return mpmath.sqrt(2) * mpmath.erfinv(2 * mpf(p) - 1)


@lru_cache
@precisely()
def student_quantile(freedom: int, p: mpf) -> mpf:
    """Return t with P(T <= t) = p > 1/2 at `freedom` degrees: 2 (1 - p) = I_x(freedom/2, 1/2), x = v/(v + t^2)."""
    half = mpf(1) / 2

    def beyond(x: mpf) -> mpf:
        return mpmath.betainc(freedom * half, half, 0, x, regularized=True) - 2 * (1 - p)

    x = mpmath.findroot(beyond, (mpf(0), mpf(1)), solver="illinois", maxsteps=200)
    return mpmath.sqrt(freedom * (1 - x) / x)
