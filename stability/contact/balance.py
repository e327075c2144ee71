"""What is left on hand and object at 60 digits, where they came to rest: recomputed from what is returned of it."""

from typing import NamedTuple

import mpmath
import numpy as np
from mpmath import mpf

from thenar.simulator.body.hand import LIMITS_DEG
from thenar.simulator.body.pose import rotation
from thenar.simulator.contact.grip import GRAVITY, STIFFNESS
from thenar.simulator.contact.quasistatic import Case, Rest, Skin
from thenar.simulator.contact.quasistatic.balance import HOLD_N_PER_MM, HOLD_NMM_PER_RAD, LIMIT_NMM_PER_RAD

from ..checks.roundings import ROUNDING
from ..reference.numbers import precisely
from .posed import Digit, centres, digits
from .skin import Touch, place_error_mm, point, press, touches_of
from .vectors import Matrix, Vector, column, cross, dot, length, matrix, plus

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
