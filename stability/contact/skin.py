"""Skin at 60 digits: how deep each sphere of it is sunk, what that presses with, and how far rounding takes either."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from mpmath import mpf

from thenar.simulator.contact.quasistatic import Case, Skin

from ..checks.roundings import ROUNDING
from ..reference.numbers import precisely
from .posed import surface
from .vectors import Matrix, Vector, plus, times


class Touch(NamedTuple):
    """A sphere of skin: how deep it is sunk, its centre, and the way out of the object, all in hand axes."""

    sphere: int
    sunk: mpf
    centre: Vector
    normal: Vector


def touches_of(case: Case, found: list[Vector], frame: Matrix, position: Vector) -> list[Touch]:
    """Return every sphere of skin (50,), their centres given, of an object at `frame` and `position`."""
    inward = [list(axis) for axis in zip(*frame, strict=True)]
    touches = []
    for sphere, (centre, radius) in enumerate(zip(found, case.condition.hand.sphere_radii.tolist(), strict=True)):
        distance, out = surface(case.condition.thing.shape, times(inward, plus(centre, position, -1)))
        touches.append(Touch(sphere, mpf(radius) - distance, centre, times(frame, out)))
    return touches


def point(radii: Sequence[float], touch: Touch) -> Vector:
    """Return where skin meets the surface, or where it is nearest to it."""
    radius = mpf(radii[touch.sphere])
    return plus(touch.centre, touch.normal, -min(radius - touch.sunk, radius))


def press(skin: Skin, sunk: mpf) -> mpf:
    """Return the integral of a stiffness that grows over the first soft_mm; of what is deeper, it is the last one."""
    deep, soft = max(sunk, mpf(0)), min(max(sunk, mpf(0)), mpf(skin.soft_mm))
    return mpf(skin.press_n_per_mm) * soft / mpf(skin.soft_mm) * (deep - soft / 2)


@precisely()
def place_error_mm(case: Case) -> mpf:
    """Bound the error of a sphere's distance from the object.

    Each of a finger's four turns takes sine and cosine of 2 roundings, and rounds two products and their sum: 7.4
    roundings of a frame by the sum of squares of its elements, which later turns keep. The thumb has two more products
    of 9: 48 roundings of a direction, 2 more with its length, on all of the digit's length. The way into the object's
    axes and to its surface adds 10 of what place and size add up to.
    """
    hand, shape = case.condition.hand, case.condition.thing.shape
    digit = float(hand.size.segments_mm().sum(axis=1).max())
    far = hand.size.length_mm + float(np.abs(case.numbers[:3]).sum()) + sum(shape.extent_mm())
    return ROUNDING * (50 * mpf(digit) + 10 * mpf(far))


@precisely()
def press_error_n(case: Case, skin: Skin, press: float) -> float:
    """Bound the error of a pressing force of at most `press` newtons: its depth's, and 6 roundings of its own."""
    return float(mpf(skin.press_n_per_mm) * place_error_mm(case) + 6 * ROUNDING * mpf(press))
