"""Hand, object, skin and the balance of forces at 60 digits.

From the model's own figures (sizes, the axes of joints at rest) and its formulas; millimetres and radians.
"""

from collections.abc import Sequence
from typing import NamedTuple

import mpmath
import numpy as np
from mpmath import mpf

from thenar.simulator.body.hand import ABDUCTORS, BETWEEN, LIMITS_DEG, REST, Hand
from thenar.simulator.body.shapes import Box, Cylinder, Shape, Sphere, rotation
from thenar.simulator.contact.balance import HOLD_N_PER_MM, HOLD_NMM_PER_RAD, LIMIT_NMM_PER_RAD, Case, Skin
from thenar.simulator.contact.model import GRAVITY, STIFFNESS
from thenar.simulator.contact.settle import Rest

from ..checks.roundings import ROUNDING
from ..reference.numbers import precisely, turn

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


_OF_DIGITS, _A_DIGIT = 35, 7


class Left(NamedTuple):
    """What is left of a repetition at rest.

    force_n, moment_nmm   on the object, its soft hold included
    joints_nmm            the most on any joint
    residual_n            on the object without its hold: what is returned as such
    press_n               the most by which what is returned of a sphere differs
    outside               on how many spheres friction leaves its cone, twice what skin slips at, or the surface
    """

    force_n: float
    moment_nmm: float
    joints_nmm: float
    residual_n: float
    press_n: float
    outside: int


@precisely()
def left_of(case: Case, rest: Rest, skin: Skin, k: int) -> Left:
    """Return what is left of repetition k. Friction is taken as returned; all else follows from angles and pose."""
    hand = case.condition.hand
    posed = digits(hand, rest.angles[:, k].tolist())
    frame, position = matrix(rest.pose.rotation[..., k].tolist()), [mpf(x) for x in rest.pose.position[:, k].tolist()]
    touches = touches_of(case, centres(hand, posed), frame, position)
    drags = [[mpf(x) for x in drag] for drag in rest.drags[..., k].tolist()]
    presses = [press(skin, touch.sunk) for touch in touches]
    forces = [plus(drag, touch.normal, pressed) for drag, touch, pressed in zip(drags, touches, presses, strict=True)]
    points = [point(hand.sphere_radii.tolist(), touch) for touch in touches]
    loaded = _weight(case)
    twisted = [mpf(0)] * 3
    for place, force in zip(points, forces, strict=True):
        loaded = plus(loaded, force, -1)
        twisted = plus(twisted, cross(plus(place, position, -1), force), -1)
    return Left(
        force_n=float(length(_held(case, k, loaded, position))),
        moment_nmm=float(length(plus(twisted, _turned(case, k, frame), -mpf(HOLD_NMM_PER_RAD)))),
        joints_nmm=float(max(abs(left) for left in _joints(case, rest, k, posed, points, forces))),
        residual_n=float(length(loaded)),
        press_n=float(max(abs(a - mpf(b)) for a, b in zip(presses, rest.presses[:, k].tolist(), strict=True))),
        outside=sum(
            _is_outside(case, skin, *each) for each in zip(touches, rest.presses[:, k].tolist(), drags, strict=True)
        ),
    )


def _weight(case: Case) -> Vector:
    mass, down = mpf(case.condition.thing.mass_kg), case.condition.held.down.tolist()
    return [mass * mpf(GRAVITY) * mpf(x) for x in down]


def _held(case: Case, k: int, loaded: Vector, position: Vector) -> Vector:
    told = [mpf(x) for x in case.numbers[:3, k].tolist()]
    return plus(loaded, plus(position, told, -1), -mpf(HOLD_N_PER_MM))


def _turned(case: Case, k: int, frame: Matrix) -> Vector:
    """Return sin(turn) about its axis, from where the object was put: half the sum of its axes' cross products."""
    told = matrix(rotation(case.numbers[3:, [k]])[..., 0].tolist())
    parts = [cross(column(told, axis), column(frame, axis)) for axis in range(3)]
    return [mpmath.fsum(part[i] for part in parts) / 2 for i in range(3)]


def _is_outside(case: Case, skin: Skin, touch: Touch, pressed: float, drag: Vector) -> bool:
    """Limit, length, root, quotient and products round 8 times in all; a normal turns by its place's error over how far
    it is from the object, which is looked at from 1 mm on.
    """
    size = length(drag)
    slips = size > 2 * mpf(skin.friction) * mpf(pressed) * (1 + 8 * ROUNDING)
    off = mpf(float(case.condition.hand.sphere_radii[touch.sphere])) - touch.sunk
    return bool(
        slips or (off > 1 and abs(dot(drag, touch.normal)) > size * (place_error_mm(case) / off + 8 * ROUNDING))
    )


def _joints(
    case: Case, rest: Rest, k: int, posed: list[Digit], points: list[Vector], forces: list[Vector]
) -> list[mpf]:
    """Return what is left on each joint: its pads' torque, its spring, its end stop, and what skin bears."""
    told, now = case.angles[:, k].tolist(), rest.angles[:, k].tolist()
    torques = _told(case, k)
    low, high = (LIMITS_DEG.T * (np.pi / 180.0)).tolist()
    found = []
    for number in range(20):
        digit, joint = divmod(number, 4)
        angle = mpf(now[number])
        over = max(angle - mpf(high[number]), mpf(0)) + min(angle - mpf(low[number]), mpf(0))
        spring = mpf(float(STIFFNESS[number])) * (angle - mpf(told[number])) + mpf(LIMIT_NMM_PER_RAD) * over
        own = [s for s in range(_A_DIGIT * digit, _A_DIGIT * (digit + 1)) if _moves(joint, s - _A_DIGIT * digit)]
        moments = (_moment(posed[digit], joint, points[s], forces[s]) for s in own)
        found.append(torques[number] - spring + mpmath.fsum(moments))
    return found


def _told(case: Case, k: int) -> list[mpf]:
    """Return the torques of the grip: every pad pushes its share into the surface, where the hand was told to be."""
    hand, grip = case.condition.hand, mpf(float(case.grip_n[k]))
    posed = digits(hand, case.angles[:, k].tolist())
    found = centres(hand, posed)
    frame = matrix(rotation(case.numbers[3:, [k]])[..., 0].tolist())
    touches = touches_of(case, found, frame, [mpf(x) for x in case.numbers[:3, k].tolist()])
    torques = [mpf(0)] * 20
    for pad in case.condition.held.pads:
        if pad.sphere >= _OF_DIGITS:
            continue
        digit, place = divmod(pad.sphere, _A_DIGIT)
        push = [-mpf(pad.share) * grip * x for x in touches[pad.sphere].normal]
        for joint in range(4):
            if _moves(joint, place):
                torques[4 * digit + joint] += _moment(posed[digit], joint, found[pad.sphere], push)
    return torques


def _moves(joint: int, place: int) -> bool:
    """Return whether a joint moves a digit's sphere: three lie on its first segment, two on each of the others."""
    return joint < 2 or (joint == 2 and place >= 3) or place >= 5


def _moment(digit: Digit, joint: int, point: Vector, force: Vector) -> mpf:
    return dot(digit.axes[joint], cross(plus(point, digit.centres[joint], -1), force))
