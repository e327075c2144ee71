"""Doubles as exact numbers of 60 digits, errors of doubles, and rotations."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import mpmath
from mpmath import mpf

DIGITS = 60


@contextmanager
def precisely() -> Iterator[None]:
    """Compute at 60 digits, in a block or in a whole function that it decorates.

    Outside of it mpmath rounds every result to a double's 53 bits, for any precision of the operands.
    Not for generators: their body runs after the block has ended.
    """
    with mpmath.workdps(DIGITS):
        yield


# Of one number, in radians.
sin, cos = precisely()(mpmath.sin), precisely()(mpmath.cos)


@precisely()
def exact(x: float) -> mpf:
    """Return the exact value of the double `x`."""
    return mpf(float(x))


@precisely()
def ulps(got: float, truth: mpf) -> float:
    """Return |got - truth| in units of the last place of the double next to `truth`, 2^-1074 at the least."""
    return float(abs(mpf(float(got)) - truth) / mpf(math.ulp(float(truth))))


@precisely()
def distance(got: float, truth: mpf) -> float:
    """Return |got - truth|, as a double."""
    return float(abs(mpf(float(got)) - truth))


@precisely()
def added(doubles: Sequence[float]) -> mpf:
    """Return the sum of doubles to 60 digits.

    fsum rounds once; the remainder is another sum of doubles, until nothing remains.
    """
    parts: list[float] = []
    while rest := math.fsum([*doubles, *parts]):
        if not math.isfinite(rest):
            return mpf(rest)
        parts.append(-rest)
    return -mpmath.fsum(parts)


@precisely()
def turn(axis: Sequence[float], angle: float) -> list[list[mpf]]:
    """Return the rotation (3, 3) by `angle` radians about `axis`, of any length (Rodrigues).

    R = cos a I + sin a [u]x + (1 - cos a) u u^T, u the unit vector along the axis.
    """
    x, y, z = (mpf(part) for part in axis)
    length = mpmath.sqrt(x**2 + y**2 + z**2)
    u = [x / length, y / length, z / length]
    c, s = mpmath.cos(mpf(angle)), mpmath.sin(mpf(angle))
    crossed = [[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]]
    return [[c * (i == j) + s * crossed[i][j] + (1 - c) * u[i] * u[j] for j in range(3)] for i in range(3)]
