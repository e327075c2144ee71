"""Hand, object, skin and the balance of forces at 60 digits.

Based on the model's parameters (sizes, the axes of joints at rest) and its formulas; millimetres and radians. Vectors
and matrices are numpy arrays of mpf: each of numpy's additions and multiplications rounds to 60 digits.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import ArrayLike, NDArray

from thenar.simulator.body.hand import ABDUCTORS, BETWEEN, LIMITS_DEG, REST, Hand
from thenar.simulator.body.shapes import Box, Cylinder, Shape, Sphere, rotation
from thenar.simulator.contact.balance import HOLD_N_PER_MM, HOLD_NMM_PER_RAD, LIMIT_NMM_PER_RAD, Skin, SolverCase
from thenar.simulator.contact.model import GRAVITY, STIFFNESS
from thenar.simulator.contact.settle import Rest

from ..checks.roundings import ROUNDING
from ..reference.numbers import precisely, turn

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


_Y, _Z = (0, 1, 0), (0, 0, 1)


class Digit(NamedTuple):
    """The axes of a digit's four joints, each with a point; the starts and directions of its three segments."""

    axes: list[Vector]
    centres: list[Vector]
    origins: list[Vector]
    along: list[Vector]


@precisely()
def digits(hand: Hand, angles: Sequence[float]) -> list[Digit]:
    """Return the five digits at joint angles (20,)."""
    return [_digit(hand, number, [mpf(x) for x in angles[4 * number : 4 * number + 4]]) for number in range(5)]


def _digit(hand: Hand, number: int, angles: list[mpf]) -> Digit:
    abduction, *flexions = (np.array(turn(axis, x)) for axis, x in zip((_Z, _Y, _Y, _Y), angles, strict=True))
    lifted = exactly(ABDUCTORS[number]) @ abduction
    bent = lifted if number else lifted @ exactly(BETWEEN)
    first = bent @ flexions[0]
    first = first if number else first @ exactly(REST)
    second = first @ flexions[1]
    third = second @ flexions[2]
    along = [frame[:, 0] for frame in (first, second, third)]
    lengths = exactly(hand.size.segments_mm()[number])
    base = exactly(hand.size.bases_mm()[number])
    knee = base + along[0] * lengths[0]
    origins = [base, knee, knee + along[1] * lengths[1]]
    return Digit([lifted[:, 2], bent[:, 1], second[:, 1], third[:, 1]], [base, *origins], origins, along)


@precisely()
def centres(hand: Hand, posed: Sequence[Digit]) -> list[Vector]:
    """Return the centres of the spheres of skin (50, 3); the palm does not move."""
    palm = hand.skeleton(np.zeros((20, 1)))
    found = []
    for capsule, offset in zip(hand.sphere_capsules.tolist(), hand.sphere_offsets.tolist(), strict=True):
        digit, segment = divmod(capsule, 3)
        if digit < 5:
            origin, along = posed[digit].origins[segment], posed[digit].along[segment]
        else:
            origin, along = exactly(palm.origins[capsule, :, 0]), exactly(palm.frames[capsule, :, 0, 0])
        found.append(origin + along * mpf(offset))
    return found


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
    """A sphere of skin: its penetration depth, its centre, and the outward normal of the object, all in hand axes."""

    sphere: int
    sunk: mpf
    centre: Vector
    normal: Vector


def touches_of(case: SolverCase, found: list[Vector], frame: Matrix, position: Vector) -> list[Touch]:
    """Return all spheres of skin (50,), from their centres, for an object at `frame` and `position`."""
    touches = []
    for sphere, (centre, radius) in enumerate(zip(found, case.condition.hand.sphere_radii.tolist(), strict=True)):
        distance, out = surface(case.condition.thing.shape, frame.T @ (centre - position))
        touches.append(Touch(sphere, mpf(radius) - distance, centre, frame @ out))
    return touches


def point(radii: Sequence[float], touch: Touch) -> Vector:
    """Return the contact point of skin and surface, or the nearest point."""
    radius = mpf(radii[touch.sphere])
    found: Vector = touch.centre - touch.normal * min(radius - touch.sunk, radius)
    return found


def press(skin: Skin, sunk: mpf) -> mpf:
    """Return the integral of a stiffness that grows over the first soft_mm and is constant beyond."""
    deep, soft = max(sunk, mpf(0)), min(max(sunk, mpf(0)), mpf(skin.soft_mm))
    return mpf(skin.press_n_per_mm) * soft / mpf(skin.soft_mm) * (deep - soft / 2)


@precisely()
def place_error_mm(case: SolverCase) -> mpf:
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


@precisely()
def press_error_n(case: SolverCase, skin: Skin, press: float) -> float:
    """Bound the error of a pressing force of at most `press` newtons: that of its depth, and 6 roundings."""
    return float(mpf(skin.press_n_per_mm) * place_error_mm(case) + 6 * ROUNDING * mpf(press))


_OF_DIGITS, _A_DIGIT = 35, 7


class Left(NamedTuple):
    """The residuals of a repetition at rest.

    force_n, moment_nmm   on the object, including its soft hold
    joints_nmm            the largest on any joint
    residual_n            on the object without its hold, compared with the returned one
    press_n               the largest error of the returned force on a sphere
    outside               number of spheres on which friction leaves its cone, twice the slip limit, or the surface
    """

    force_n: float
    moment_nmm: float
    joints_nmm: float
    residual_n: float
    press_n: float
    outside: int


@precisely()
def left_of(case: SolverCase, rest: Rest, skin: Skin, k: int) -> Left:
    """Return the residuals of repetition k, with friction as returned, and all else from angles and pose."""
    hand, thing = case.condition.hand, case.condition.thing
    posed = digits(hand, rest.angles[:, k].tolist())
    frame, position = exactly(rest.pose.rotation[..., k]), exactly(rest.pose.position[:, k])
    touches = touches_of(case, centres(hand, posed), frame, position)
    drags, returned = exactly(rest.drags[..., k]), exactly(rest.presses[:, k])
    presses = np.array([press(skin, touch.sunk) for touch in touches])
    forces = drags + np.array([touch.normal for touch in touches]) * presses[:, None]
    points = np.array([point(hand.sphere_radii.tolist(), touch) for touch in touches])
    loaded = mpf(thing.mass_kg) * mpf(GRAVITY) * exactly(case.condition.held.down) - forces.sum(axis=0)
    held = loaded - mpf(HOLD_N_PER_MM) * (position - exactly(case.numbers[:3, k]))
    twisted = -np.cross(points - position, forces).sum(axis=0) - mpf(HOLD_NMM_PER_RAD) * _turned(case, k, frame)
    return Left(
        force_n=float(length(held)),
        moment_nmm=float(length(twisted)),
        joints_nmm=float(abs(_joints(case, rest, k, posed, points, forces)).max()),
        residual_n=float(length(loaded)),
        press_n=float(abs(presses - returned).max()),
        outside=sum(_is_outside(case, skin, *each) for each in zip(touches, returned, drags, strict=True)),
    )


def _told_frame(case: SolverCase, k: int) -> Matrix:
    return exactly(rotation(case.numbers[3:, [k]])[..., 0])


def _turned(case: SolverCase, k: int, frame: Matrix) -> Vector:
    """Return sin(rotation) times its axis, from the object's initial pose: half the sum of its axes' cross products."""
    half: Vector = np.cross(_told_frame(case, k).T, frame.T).sum(axis=0) / 2
    return half


def _is_outside(case: SolverCase, skin: Skin, touch: Touch, pressed: mpf, drag: Vector) -> bool:
    """Return whether friction is outside its limits by more than rounding.

    Limit, length, root, quotient and products round 8 times in all; a normal rotates by its position's error over its
    distance from the object, which is checked from 1 mm on.
    """
    size = length(drag)
    slips = size > 2 * mpf(skin.friction) * pressed * (1 + 8 * ROUNDING)
    off = mpf(float(case.condition.hand.sphere_radii[touch.sphere])) - touch.sunk
    return bool(slips or (off > 1 and abs(drag @ touch.normal) > size * (place_error_mm(case) / off + 8 * ROUNDING)))


def _joints(case: SolverCase, rest: Rest, k: int, posed: list[Digit], points: Matrix, forces: Matrix) -> Vector:
    """Return the residual torque on each joint: its pads', its spring's, its end stop's, and that of skin."""
    initial, now = exactly(case.angles[:, k]), exactly(rest.angles[:, k])
    low, high = map(exactly, LIMITS_DEG.T * (np.pi / 180.0))
    over = np.maximum(now - high, mpf(0)) + np.minimum(now - low, mpf(0))
    found: Vector = _grip(case, k) - exactly(STIFFNESS) * (now - initial) - mpf(LIMIT_NMM_PER_RAD) * over
    for sphere in range(_OF_DIGITS):
        _add_moments(found, posed, sphere, points[sphere], forces[sphere])
    return found


def _grip(case: SolverCase, k: int) -> Vector:
    """Return the torques of the grip: every pad pushes its share into the surface at the target posture."""
    hand, grip = case.condition.hand, mpf(float(case.grip_n[k]))
    posed = digits(hand, case.angles[:, k].tolist())
    found = centres(hand, posed)
    touches = touches_of(case, found, _told_frame(case, k), exactly(case.numbers[:3, k]))
    torques = exactly(np.zeros(20))
    for pad in case.condition.held.pads:
        if pad.sphere < _OF_DIGITS:
            push = touches[pad.sphere].normal * (-mpf(pad.share) * grip)
            _add_moments(torques, posed, pad.sphere, found[pad.sphere], push)
    return torques


def _add_moments(moments: Vector, posed: list[Digit], sphere: int, at: Vector, force: Vector) -> None:
    """Add the moments of a force on a digit's sphere to the joints (20,) that move it.

    Three spheres are on its first segment, which two joints move, two on each of the others.
    """
    digit, place = divmod(sphere, _A_DIGIT)
    for joint in range(2 + (place >= 3) + (place >= 5)):
        lever = at - posed[digit].centres[joint]
        moments[4 * digit + joint] += posed[digit].axes[joint] @ np.cross(lever, force)
