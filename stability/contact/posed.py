"""A hand and its object at 60 digits: where joints and spheres of skin are, and how far the object's surface.

From the model's own figures (sizes, the axes of joints at rest) and its formulas; millimetres and radians.
"""

from collections.abc import Sequence
from typing import NamedTuple

import mpmath
import numpy as np
from mpmath import mpf

from thenar.simulator.body.axes import ABDUCTORS, BETWEEN, REST
from thenar.simulator.body.hand import Hand
from thenar.simulator.body.shapes import Box, Cylinder, Shape, Sphere

from ..reference.linear import turn
from ..reference.numbers import precisely
from .vectors import Vector, column, length, matrix, plus, product

_Y, _Z = (0, 1, 0), (0, 0, 1)


class Digit(NamedTuple):
    """What each of a digit's four joints turns on, and a point of it; where its three segments begin and lead to."""

    axes: list[Vector]
    centres: list[Vector]
    origins: list[Vector]
    along: list[Vector]


@precisely()
def digits(hand: Hand, angles: Sequence[float]) -> list[Digit]:
    """Return the five digits at joint angles (20,)."""
    return [_digit(hand, number, [mpf(x) for x in angles[4 * number : 4 * number + 4]]) for number in range(5)]


def _digit(hand: Hand, number: int, angles: Vector) -> Digit:
    thumb = number == 0
    lifted = product(matrix(ABDUCTORS[number].tolist()), turn(_Z, angles[0]))
    bent = product(lifted, matrix(BETWEEN.tolist())) if thumb else lifted
    first = product(bent, turn(_Y, angles[1]))
    first = product(first, matrix(REST.tolist())) if thumb else first
    second = product(first, turn(_Y, angles[2]))
    third = product(second, turn(_Y, angles[3]))
    along = [column(frame, 0) for frame in (first, second, third)]
    lengths = hand.size.segments_mm()[number].tolist()
    origins = [[mpf(x) for x in hand.size.bases_mm()[number].tolist()]]
    for way, segment in zip(along[:2], lengths[:2], strict=True):
        origins.append(plus(origins[-1], way, mpf(segment)))
    axes = [column(lifted, 2), column(bent, 1), column(second, 1), column(third, 1)]
    return Digit(axes, [origins[0], *origins], origins, along)


@precisely()
def centres(hand: Hand, posed: Sequence[Digit]) -> list[Vector]:
    """Return the centres of the spheres of skin (50, 3); the palm does not move, and lies where the hand has it."""
    palm = hand.skeleton(np.zeros((20, 1)))
    found = []
    for capsule, offset in zip(hand.sphere_capsules.tolist(), hand.sphere_offsets.tolist(), strict=True):
        digit, segment = divmod(capsule, 3)
        if digit < 5:
            found.append(plus(posed[digit].origins[segment], posed[digit].along[segment], mpf(offset)))
        else:
            origin = [mpf(x) for x in palm.origins[capsule, :, 0].tolist()]
            found.append(plus(origin, [mpf(x) for x in palm.frames[capsule, :, 0, 0].tolist()], mpf(offset)))
    return found


@precisely()
def surface(shape: Shape, point: Sequence[mpf]) -> tuple[mpf, Vector]:
    """Return how far outside a point in the object's own axes lies, and which way is out; the first of several."""
    x, y, z = (mpf(part) for part in point)
    match shape:
        case Sphere():
            distance, out = _rounded([abs(x), abs(y), abs(z)])
            return distance - mpf(shape.diameter_mm) / 2, _signed(out, (x, y, z))
        case Cylinder():
            radius, edge = mpmath.sqrt(y * y + z * z), mpf(shape.edge_mm)
            sides = [radius - (mpf(shape.diameter_mm) / 2 - edge), abs(x) - (mpf(shape.length_mm) / 2 - edge)]
            distance, (across, along) = _rounded(sides)
            away = [y / radius, z / radius] if radius else [mpf(1), mpf(0)]
            return distance - edge, [along * (-1 if x < 0 else 1), across * away[0], across * away[1]]
        case Box():
            edge = mpf(shape.edge_mm)
            sides = [abs(a) - (mpf(size) / 2 - edge) for a, size in zip((x, y, z), shape.extent_mm(), strict=True)]
            distance, out = _rounded(sides)
            return distance - edge, _signed(out, (x, y, z))


def _rounded(sides: Vector) -> tuple[mpf, Vector]:
    """Return distance and its gradient by the sides, of a corner that lies `sides` away."""
    outside = [max(side, mpf(0)) for side in sides]
    gap = length(outside)
    if gap:
        return gap, [part / gap for part in outside]
    nearest = max(range(len(sides)), key=lambda k: sides[k])
    return sides[nearest], [mpf(k == nearest) for k in range(len(sides))]


def _signed(out: Vector, point: Sequence[mpf]) -> Vector:
    return [part * (-1 if at < 0 else 1) for part, at in zip(out, point, strict=True)]
