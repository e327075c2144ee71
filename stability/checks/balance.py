"""Object, skin and the balance of forces at 60 digits, for a hand where its skeleton of doubles places it.

Based on the model's parameters and its formulas; millimetres and radians. Vectors and matrices are numpy arrays of mpf:
each of numpy's additions and multiplications rounds to 60 digits.
"""

from collections.abc import Sequence
from typing import Any

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import ArrayLike, NDArray

from thenar.simulator.body.hand import LIMITS_DEG, Skeleton
from thenar.simulator.body.shapes import Box, Cylinder, Shape, Sphere, rotation
from thenar.simulator.contact.balance import HOLD_N_PER_MM, HOLD_NMM_PER_RAD, LIMIT_NMM_PER_RAD, Skin
from thenar.simulator.contact.model import GRAVITY, STIFFNESS, Load
from thenar.simulator.contact.settle import Rest

from ..reference.numbers import precisely

_DIGITS, _SPHERES = 5, 7
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


def touches_of(load: Load, centres: Matrix, frame: Matrix, position: Vector) -> tuple[Vector, Matrix, Matrix]:
    """Return the depths (50,) of all spheres of skin in an object at `frame` and `position`, its normals, and points.

    Normals (50, 3) point outwards; points (50, 3) are those of contact, or for a sphere off the surface the nearest
    of its skin. The spheres' centres are (50, 3).
    """
    depths, normals, points = [], [], []
    for centre, radius in zip(centres, map(mpf, load.condition.hand.sphere_radii.tolist()), strict=True):
        distance, out = surface(load.condition.thing.shape, frame.T @ (centre - position))
        normal = frame @ out
        depths.append(radius - distance)
        normals.append(normal)
        points.append(centre - normal * min(distance, radius))
    return np.array(depths), np.array(normals), np.array(points)


def press(skin: Skin, sunk: mpf) -> mpf:
    """Return the integral of a stiffness that grows over the first soft_mm and is constant beyond."""
    deep, soft = max(sunk, mpf(0)), min(max(sunk, mpf(0)), mpf(skin.soft_mm))
    return mpf(skin.press_n_per_mm) * soft / mpf(skin.soft_mm) * (deep - soft / 2)


@precisely()
def residuals(load: Load, rest: Rest, skin: Skin) -> tuple[float, float, float]:
    """Return force and moment on the object, including its soft hold, and the largest moment on any joint.

    They are those of the only repetition, with friction as returned, and all else from angles and pose.
    """
    hand, condition = load.condition.hand, load.condition
    skeleton = hand.skeleton(rest.angles)
    frame, position = exactly(rest.pose.rotation[..., 0]), exactly(rest.pose.position[:, 0])
    depths, normals, points = touches_of(load, exactly(hand.spheres(skeleton)[..., 0]), frame, position)
    pressed = np.array([press(skin, depth) for depth in depths])
    forces = exactly(rest.drags[..., 0]) + normals * pressed[:, None]
    loaded = mpf(condition.thing.mass_kg) * mpf(GRAVITY) * exactly(condition.held.down) - forces.sum(axis=0)
    force = loaded - mpf(HOLD_N_PER_MM) * (position - exactly(load.pose[0, :3]))
    initial = exactly(rotation(load.pose.T[3:])[..., 0])
    # sin(rotation) times its axis, from the object's initial pose: half the sum of its axes' cross products.
    turned = np.cross(initial.T, frame.T).sum(axis=0) / 2
    moment = -np.cross(points - position, forces).sum(axis=0) - mpf(HOLD_NMM_PER_RAD) * turned
    # The torque on a joint is that of its pads, its spring, its end stop and its skin.
    start, now = exactly(load.angles[:, 0]), exactly(rest.angles[:, 0])
    low, high = map(exactly, LIMITS_DEG.T * (np.pi / 180.0))
    over = np.maximum(now - high, mpf(0)) + np.minimum(now - low, mpf(0))
    torques = _grip(load, initial) + _moments(skeleton, points, forces)
    torques -= exactly(STIFFNESS) * (now - start) + mpf(LIMIT_NMM_PER_RAD) * over
    return float(length(force)), float(length(moment)), float(abs(torques).max())


def _grip(load: Load, frame: Matrix) -> Vector:
    """Return the torques of the grip: every pad pushes its share into the surface at the target posture."""
    hand, grip = load.condition.hand, mpf(float(load.grip_n[0]))
    skeleton = hand.skeleton(load.angles)
    centres = exactly(hand.spheres(skeleton)[..., 0])
    _, normals, _ = touches_of(load, centres, frame, exactly(load.pose[0, :3]))
    pushes = exactly(np.zeros(centres.shape))
    for pad in load.condition.held.pads:
        pushes[pad.sphere] -= normals[pad.sphere] * mpf(pad.share) * grip
    return _moments(skeleton, centres, pushes)


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
