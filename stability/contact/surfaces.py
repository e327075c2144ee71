"""Surfaces and rotations in hard cases: middles, creases, half turns, tiny depths."""

from collections.abc import Iterator
from itertools import product

import mpmath
import numpy as np
from mpmath import mpf

from thenar.compiler.elementary import Floats
from thenar.simulator.body.shapes import Box, Cylinder, Shape, Sphere, rotation, rotation_vector

from ..checks.roundings import ROUNDING
from ..finding import REFERENCE, Finding, Worst
from ..reference.numbers import precisely, turn
from .posed import Matrix, exactly, length, surface

_TINY = (5e-324, 1e-200, 1e-155, 1e-149, 1e-15, 1e-12, 1e-9)
_THIN = 5e-324
_LOST_MM = mpf(10) ** -150  # the squares of smaller lengths underflow
_BARS = ((_THIN, 1.0, 0.0), (40.0, _THIN, 0.0), (40.0, 120.0, 0.5), (2000.0, 2000.0, 900.0))
_BOXES = ((80.0, 50.0, _THIN, 0.0), (9.0, 9.0, 9.0, 4.5), (200.0, 200.0, 10.0, 0.0))
SHAPES: tuple[Shape, ...] = (
    *(Sphere(size) for size in (_THIN, 1e-9, 8.0, 2000.0)),
    *(Cylinder(*sizes) for sizes in _BARS),
    *(Box(*sizes) for sizes in _BOXES),
)


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of distances and normals, and of rotations."""
    rng, more = np.random.default_rng(12), 10 if full else 1
    yield from _surfaces(rng, 20 * more)
    yield from _turns(rng, 20 * more)


def points(shape: Shape, rng: np.random.Generator, n: int) -> Floats:
    """Return points (m, 3): the middle, faces, edges and corners, also with tiny offsets, and n around."""
    half = np.array(shape.extent_mm()) / 2
    corners = np.array(list(product((-1.0, 0.0, 1.0), repeat=3))) * half
    core = corners * (1.0 - getattr(shape, "edge_mm", 0.0) / np.maximum(half, 1e-300))
    hairs = np.array([hair * axis for hair in _TINY for axis in (*np.eye(3), -np.eye(3)[2], np.ones(3))])
    off = rng.choice(_TINY, (len(corners), 3)) * rng.choice([-1.0, 1.0], (len(corners), 3))
    around = rng.normal(size=(n, 3)) * (half + 10.0)
    return np.concatenate([corners, core, np.nextafter(corners, np.inf), core + off, hairs, around])


@precisely()
def _surfaces(rng: np.random.Generator, n: int) -> list[Finding]:
    """Compare distances and normals with exact values.

    The size of a side is halved exactly, subtracting its edge rounds once, and the distance beyond it once more: 2
    roundings of the size; so does the last difference. For a corner, squares, at most two sums and the root round by 3,
    the radius of a bar by 2.5 before: 9 roundings of the sum of the point's position and the object's size; and less
    than 1e-150 mm.

    A normal is a quotient by such a root, of relative error 2.5 and 1 for itself; that of a bar is the product of two:
    8 roundings of its length. In addition its direction is off by 4 roundings of that size, of two sides,
    over the distance of the point from the core inside the rounded edge.
    """
    distances = Worst("distance from a surface", REFERENCE, 9.0, "x 2^-53 of the size")
    normals = Worst("length of normals", REFERENCE, 8.0, "x 2^-53")
    ways = Worst("direction of normals", REFERENCE, 1.0, "of the bound")
    for shape in SHAPES:
        places = points(shape, rng, n)
        found, out = shape.distance(places[..., None])
        size = mpmath.fsum(shape.extent_mm())
        for place, distance, normal in zip(places.tolist(), found[:, 0].tolist(), exactly(out[..., 0]), strict=True):
            scale = size + mpmath.fsum(abs(mpf(x)) for x in place)
            truth, way = surface(shape, place)
            doubt = max(abs(mpf(distance) - truth) - _LOST_MM, mpf(0))
            distances.see(float(doubt / (ROUNDING * scale)), f"{shape} at {place}")
            normals.see(float(abs(length(normal) - 1) / ROUNDING), f"{shape} at {place}")
            gap = truth + (mpf(shape.diameter_mm) / 2 if isinstance(shape, Sphere) else mpf(shape.edge_mm))
            if gap > 2 * _LOST_MM:
                inexact = 0 if isinstance(shape, Sphere) else 4 * size / gap
                ways.see(float(length(normal - way) / (ROUNDING * (8 + inexact))), f"{shape} at {place}")
    return [worst.finding() for worst in (distances, normals, ways)]


def vectors(rng: np.random.Generator, n: int) -> Floats:
    """Return rotation vectors (m, 3) up to half a turn: zero, tiny, half turns and close to them, and n random ones."""
    axes = np.concatenate([np.eye(3), -np.eye(3), rng.normal(size=(max(n // 4, 3), 3))])
    axes /= np.sqrt(np.add.reduce(axes * axes, axis=1))[:, None]
    angles = (0.0, 5e-324, 1e-160, 1e-150, 9.9e-9, 1.01e-8, 1e-4, np.pi / 2, np.pi - 1e-8, np.nextafter(np.pi, 0.0))
    drawn = rng.normal(size=(n, 3))
    return np.concatenate([*(axes * angle for angle in angles), drawn])


@precisely()
def _turns(rng: np.random.Generator, n: int) -> list[Finding]:
    """Compare rotation matrices, and those of their rotation vectors, with exact values.

    The angle a <= pi is off by 2.5 roundings of itself, 8; sine and cosine add 2 ulp, so each is off by 10. The sine's
    part of an element counts 10 and 4 for its quotient and product. 1 - cos a rounds once: 11; over a^2 and times two
    components of the vector that is at most 2, with 6 roundings: 11 + 12. The last sum adds 1 rounding of at most 2: 40
    altogether.

    A rotation vector follows from sums of such elements. Of the four formulas for its quaternion the chosen one has a
    largest component of at least 1/2, so with an error of 40 and 4 roundings in each element none of its components is
    off by over 4 * 44 / (4 * 1/2) = 88; its angle, and so each rotated element, by twice that, plus the 40.
    """
    matrices = Worst("rotation matrices", REFERENCE, 40.0, "x 2^-53")
    back = Worst("matrices of rotation vectors", REFERENCE, 216.0, "x 2^-53")
    made = vectors(rng, n)
    found = rotation(made.T)
    again = rotation_vector(found).T
    for k, (there, once_more) in enumerate(zip(made, again, strict=True)):
        truth, at = _turned(there), f"{there.tolist()}"
        matrices.see(float(abs(exactly(found[..., k]) - truth).max() / ROUNDING), at)
        back.see(float(abs(_turned(once_more) - truth).max() / ROUNDING), at)
    return [matrices.finding(), back.finding()]


def _turned(vector: Floats) -> Matrix:
    angle = length(exactly(vector))
    return np.array(turn(vector.tolist(), angle) if angle else turn((1, 0, 0), 0))
