"""Vectors and matrices of mpf, as lists: at whatever digits the caller works."""

from collections.abc import Sequence

import mpmath
from mpmath import mpf

Vector = list[mpf]
Matrix = list[Vector]


def matrix(rows: Sequence[Sequence[float]]) -> Matrix:
    """Return a matrix of doubles, exactly."""
    return [[mpf(x) for x in row] for row in rows]


def column(of: Matrix, k: int) -> Vector:
    """Return column k."""
    return [row[k] for row in of]


def times(of: Matrix, vector: Sequence[mpf]) -> Vector:
    """Return matrix times vector."""
    return [dot(row, vector) for row in of]


def dot(a: Sequence[mpf], b: Sequence[mpf]) -> mpf:
    """Return a . b."""
    return mpmath.fsum(x * y for x, y in zip(a, b, strict=True))


def cross(a: Sequence[mpf], b: Sequence[mpf]) -> Vector:
    """Return a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def plus(a: Sequence[mpf], b: Sequence[mpf], factor: mpf | int = 1) -> Vector:
    """Return a + factor b."""
    return [x + factor * y for x, y in zip(a, b, strict=True)]


def length(vector: Sequence[mpf]) -> mpf:
    """Return the length of a vector."""
    return mpmath.sqrt(mpmath.fsum(x * x for x in vector))


def product(a: Matrix, b: Matrix) -> Matrix:
    """Return matrix times matrix."""
    return [[dot(row, column(b, k)) for k in range(3)] for row in a]
