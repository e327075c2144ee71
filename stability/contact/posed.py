"""Object, skin and the balance of forces at 60 digits, for a hand where its skeleton of doubles places it.

Based on the model's parameters and its formulas; millimetres and radians. Vectors and matrices are numpy arrays of mpf:
each of numpy's additions and multiplications rounds to 60 digits.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import ArrayLike, NDArray

from thenar.simulator.body.hand import LIMITS_DEG, Skeleton
from thenar.simulator.body.shapes import Box, Cylinder, Shape, Sphere, rotation
from thenar.simulator.contact.balance import HOLD_N_PER_MM, HOLD_NMM_PER_RAD, LIMIT_NMM_PER_RAD, Skin, SolverCase
from thenar.simulator.contact.model import GRAVITY, STIFFNESS
from thenar.simulator.contact.settle import Rest

from ..checks.roundings import ROUNDING
from ..reference.numbers import precisely

Vector = NDArray[Any]  # (3,) of mpf
Matrix = NDArray[Any]  # (3, 3) of mpf


def exactly(numbers: ArrayLike) -> NDArray[Any]:
    """Return doubles, any shape, as mpf."""
    flat = [mpf(x) for x in np.ravel(numbers).tolist()]
    return np.array(flat, object).reshape(np.shape(numbers))


@precisely()
def length(vector: Vector) -> mpf:
    """Return the length of a vector (k,)."""
    return mpmath.sqrt(vector @ vector)


@precisely()
def surface(shape: Shape, point: Sequence[mpf] | Vector) -> tuple[mpf, Vector]:
    """Return the signed distance of a point in the object's axes, and the outward normal, the first of several."""
    place = np.array([mpf(part) for part in point])
    ways = np.where(place < 0, -1, 1)
    match shape:
        case Sphere():
            distance, out = _rounded(abs(place))
            return distance - mpf(shape.diameter_mm) / 2, out * ways
        case Cylinder():
            radius, edge = length(place[1:]), mpf(shape.edge_mm)
            sides = [radius - (mpf(shape.diameter_mm) / 2 - edge), abs(place[0]) - (mpf(shape.length_mm) / 2 - edge)]
            distance, (across, along) = _rounded(np.array(sides))
            away = place[1:] / radius if radius else exactly([1, 0])
            return distance - edge, np.array([along * ways[0], *(across * away)])
        case Box():
            edge = mpf(shape.edge_mm)
            distance, out = _rounded(abs(place) - (exactly(shape.extent_mm()) / 2 - edge))
            return distance - edge, out * ways


def _rounded(sides: Vector) -> tuple[mpf, Vector]:
    """Return the distance of a corner at offsets `sides`, and its gradient with respect to them."""
    outside = np.maximum(sides, mpf(0))
    if gap := length(outside):
        return gap, outside / gap
    nearest = int(sides.argmax())
    return sides[nearest], exactly(np.arange(len(sides)) == nearest)


class Touch(NamedTuple):
    """A sphere of skin, in hand axes.

    The distance of its centre from the object, its own depth in it, the object's outward normal, the point of contact.
    """

    distance: mpf
    sunk: mpf
    normal: Vector
    point: Vector


def touches_of(case: SolverCase, centres: Matrix, frame: Matrix, position: Vector) -> list[Touch]:
    """Return all spheres of skin, from their centres (50, 3), for an object at `frame` and `position`.

    A sphere off the surface has the nearest point of its skin instead of a point of contact.
    """
    touches = []
    for centre, radius in zip(centres, map(mpf, case.condition.hand.sphere_radii.tolist()), strict=True):
        distance, out = surface(case.condition.thing.shape, frame.T @ (centre - position))
        normal = frame @ out
        touches.append(Touch(distance, radius - distance, normal, centre - normal * min(distance, radius)))
    return touches


def press(skin: Skin, sunk: mpf) -> mpf:
    """Return the integral of a stiffness that grows over the first soft_mm and is constant beyond."""
    deep, soft = max(sunk, mpf(0)), min(max(sunk, mpf(0)), mpf(skin.soft_mm))
    return mpf(skin.press_n_per_mm) * soft / mpf(skin.soft_mm) * (deep - soft / 2)


@precisely()
def _place_error_mm(case: SolverCase) -> mpf:
    """Bound the error of a sphere's distance from the object.

    Each of a finger's four turns takes sine and cosine of 2 roundings, and rounds two products and their sum: 7.4
    roundings of a frame by the sum of squares of its elements, which later turns keep. The thumb has two more products
    of 9: 48 roundings of a direction, 2 more with its length, on all of the digit's length. The transformation to
    the object's axes and to its surface adds 10 of the sum of position and size.
    """
    hand, shape = case.condition.hand, case.condition.thing.shape
    digit = float(hand.size.segments_mm().sum(axis=1).max())
    far = hand.size.length_mm + float(np.abs(case.numbers[:3]).sum()) + sum(shape.extent_mm())
    return ROUNDING * (50 * mpf(digit) + 10 * mpf(far))


class Left(NamedTuple):
    """The residuals of a case at rest.

    force_n, moment_nmm   on the object, including its soft hold
    joints_nmm            the largest on any joint
    outside               number of spheres on which friction leaves its cone, twice the slip limit, or the surface
    """

    force_n: float
    moment_nmm: float
    joints_nmm: float
    outside: int


@precisely()
def left_of(case: SolverCase, rest: Rest, skin: Skin) -> Left:
    """Return the residuals of the only repetition, with friction as returned, and all else from angles and pose."""
    hand, condition = case.condition.hand, case.condition
    skeleton = hand.skeleton(rest.angles)
    frame, position = exactly(rest.pose.rotation[..., 0]), exactly(rest.pose.position[:, 0])
    touches = touches_of(case, exactly(hand.spheres(skeleton)[..., 0]), frame, position)
    drags = exactly(rest.drags[..., 0])
    normals, points = (np.array([getattr(touch, part) for touch in touches]) for part in ("normal", "point"))
    forces = drags + normals * np.array([press(skin, touch.sunk) for touch in touches])[:, None]
    loaded = mpf(condition.thing.mass_kg) * mpf(GRAVITY) * exactly(condition.held.down) - forces.sum(axis=0)
    force = loaded - mpf(HOLD_N_PER_MM) * (position - exactly(case.numbers[:3, 0]))
    initial = exactly(rotation(case.numbers[3:])[..., 0])
    # sin(rotation) times its axis, from the object's initial pose: half the sum of its axes' cross products.
    turned = np.cross(initial.T, frame.T).sum(axis=0) / 2
    moment = -np.cross(points - position, forces).sum(axis=0) - mpf(HOLD_NMM_PER_RAD) * turned
    # The torque on a joint is that of its pads, its spring, its end stop and its skin.
    start, now = exactly(case.angles[:, 0]), exactly(rest.angles[:, 0])
    low, high = map(exactly, LIMITS_DEG.T * (np.pi / 180.0))
    over = np.maximum(now - high, mpf(0)) + np.minimum(now - low, mpf(0))
    torques = _grip(case, initial) + _moments(skeleton, points, forces)
    torques -= exactly(STIFFNESS) * (now - start) + mpf(LIMIT_NMM_PER_RAD) * over
    returned = exactly(rest.presses[:, 0])
    return Left(
        force_n=float(length(force)),
        moment_nmm=float(length(moment)),
        joints_nmm=float(abs(torques).max()),
        outside=sum(_is_outside(case, skin, *each) for each in zip(touches, returned, drags, strict=True)),
    )


def _is_outside(case: SolverCase, skin: Skin, touch: Touch, pressed: mpf, drag: Vector) -> bool:
    """Return whether friction is outside its limits by more than rounding.

    Limit, length, root, quotient and products round 8 times in all; a normal rotates by its position's error over its
    distance from the object, which is checked from 1 mm on.
    """
    size = length(drag)
    slips = size > 2 * mpf(skin.friction) * pressed * (1 + 8 * ROUNDING)
    off = touch.distance
    return bool(slips or (off > 1 and abs(drag @ touch.normal) > size * (_place_error_mm(case) / off + 8 * ROUNDING)))


def _grip(case: SolverCase, frame: Matrix) -> Vector:
    """Return the torques of the grip: every pad pushes its share into the surface at the target posture."""
    hand, grip = case.condition.hand, mpf(float(case.grip_n[0]))
    skeleton = hand.skeleton(case.angles)
    centres = exactly(hand.spheres(skeleton)[..., 0])
    touches = touches_of(case, centres, frame, exactly(case.numbers[:3, 0]))
    pushes = exactly(np.zeros(centres.shape))
    for pad in case.condition.held.pads:
        pushes[pad.sphere] -= touches[pad.sphere].normal * mpf(pad.share) * grip
    return _moments(skeleton, centres, pushes)


_DIGITS, _SPHERES = 5, 7


def _moments(skeleton: Skeleton, points: Matrix, forces: Matrix) -> Vector:
    """Return the moments of forces on the digits' spheres, which are the first, on the joints (20,) that move them.

    Three spheres are on a digit's first segment, which two joints move, two on each of the others.
    """
    axes, centres = exactly(skeleton.axes[..., 0]), exactly(skeleton.centres[..., 0])
    moments = exactly(np.zeros((_DIGITS, 4)))
    for sphere in range(_DIGITS * _SPHERES):
        digit, place = divmod(sphere, _SPHERES)
        for joint in range(2 + (place >= 3) + (place >= 5)):
            lever = points[sphere] - centres[digit, joint]
            moments[digit, joint] += axes[digit, joint] @ np.cross(lever, forces[sphere])
    found: Vector = moments.ravel()
    return found
