"""Doubles as exact numbers of 60 digits, and how far another double is from the truth in units of its last place."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction

import mpmath
from mpmath import mpf

DIGITS = 60


@contextmanager
def precisely() -> Iterator[None]:
    """Compute at 60 digits, in a block or in a whole function that it decorates.

    Outside of it mpmath rounds every result to a double's 53 bits, whatever the digits of what went in.
    Not for generators: the body of one runs when the block is long left.
    """
    with mpmath.workdps(DIGITS):
        yield


@precisely()
def exact(x: float) -> mpf:
    """Return the number that the double `x` is, every bit of it."""
    return mpf(float(x))


@precisely()
def ratio(of: Fraction) -> mpf:
    """Return a fraction; exact, where the denominator is a power of two and the numerator below 2^199."""
    return mpf(of.numerator) / of.denominator


@precisely()
def ulps(got: float, truth: mpf) -> float:
    """Return |got - truth| in units of the last place of the double next to `truth`, 2^-1074 at the least."""
    return float(abs(mpf(float(got)) - truth) / mpf(math.ulp(float(truth))))


@precisely()
def distance(got: float, truth: mpf) -> float:
    """Return |got - truth|, as a double."""
    return float(abs(mpf(float(got)) - truth))
