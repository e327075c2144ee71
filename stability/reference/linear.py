"""Linear equations, angles and rotations."""

from collections.abc import Sequence

import mpmath
from mpmath import mpf

from .numbers import precisely

Vector = Sequence[float]


@precisely()
def sin(x: float) -> mpf:
    """Return the sine of x radians."""
    return mpmath.sin(mpf(x))


@precisely()
def cos(x: float) -> mpf:
    """Return the cosine of x radians."""
    return mpmath.cos(mpf(x))


@precisely()
def solve(matrix: Sequence[Vector], right: Vector) -> list[mpf]:
    """Return x with matrix (n, n) x = right (n,), by elimination, as many digits short of 60 as its condition has.

    Raises ZeroDivisionError where nothing is left of a column.
    """
    n = len(right)
    rows = [[*(mpf(x) for x in row), mpf(b)] for row, b in zip(matrix, right, strict=True)]
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(k + 1, n):
            factor = rows[i][k] / rows[k][k]
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k], strict=True)]
    x = [mpf(0)] * n
    for k in reversed(range(n)):
        x[k] = (rows[k][n] - mpmath.fsum(rows[k][j] * x[j] for j in range(k + 1, n))) / rows[k][k]
    return x


@precisely()
def turn(axis: Vector, angle: float) -> list[list[mpf]]:
    """Return the rotation (3, 3) by `angle` radians about `axis`, of any length (Rodrigues).

    R = cos a I + sin a [u]x + (1 - cos a) u u^T, u the unit vector along the axis.
    """
    x, y, z = (mpf(part) for part in axis)
    length = mpmath.sqrt(x**2 + y**2 + z**2)
    u = [x / length, y / length, z / length]
    c, s = mpmath.cos(mpf(angle)), mpmath.sin(mpf(angle))
    crossed = [[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]]
    return [[c * (i == j) + s * crossed[i][j] + (1 - c) * u[i] * u[j] for j in range(3)] for i in range(3)]
