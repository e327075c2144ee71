"""How far a candidate posture is from what a grasp type wants: pads that touch, squarely and balanced, nothing sunk in.

A candidate is 26 numbers: 20 joint angles in radians, a shift of the object in mm and a turn of it in radians, both
from where the type's table puts it.
"""

import numpy as np
from numpy.typing import NDArray

from ..body.hand import Hand, Skeleton
from ..body.pose import Pose, rotation_vector
from ..body.shapes import Cylinder, Shape, Sphere
from .prehension import Prehension, pad_side, pad_sphere

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

# What a residual of 1 stands for. All ours.
TOUCH_MM = 0.4
SINK_MM = 0.7
SQUARE = 0.45  # of a pad to the surface, as the length of a difference of unit vectors
NOMINAL_DEG = np.array([15.0, 20.0, 20.0, 20.0] + [7.0, 20.0, 20.0, 20.0] * 4)
COUPLING_DEG = 15.0  # of a finger's last joint to two thirds of the one before
TURN_RAD = 0.25
BALANCE = 0.25
EVENNESS = 0.6  # of the pads' shares, against their balance

_SINK_IN_MM = 0.3  # how deep a pad that touches lies
_CLEAR_MM = 1.0  # how far everything else keeps away
_OVERLAP = 0.85  # of two fingers' radii: how near they come


class Misfit:
    """The residuals of one hand, grasp type and object, for many candidates (26, n) at a time."""

    def __init__(self, hand: Hand, prehension: Prehension, shape: Shape) -> None:
        self.hand, self.prehension, self.shape = hand, prehension, shape
        self.pads: Indices = np.array([pad_sphere(hand, pad) for pad in prehension.pads], dtype=np.intp)
        self.start = object_start(hand, prehension, shape)
        self.nominal = np.radians(prehension.nominal_deg())
        self._sides = np.array([pad_side(pad) for pad in prehension.pads])
        self._others = np.setdiff1d(np.arange(len(hand.sphere_capsules)), self.pads)
        self._pairs = _digit_pairs(hand)

    def pose(self, shift: Floats) -> Pose:
        """Return where the object is after shifts (6, n)."""
        return Pose.of(np.repeat(self.start[:, None], shift.shape[1], axis=1)).moved(shift)

    def residuals(self, unknowns: Floats) -> Floats:
        """Return (r, n)."""
        angles, shift = unknowns[:20], unknowns[20:]
        skeleton = self.hand.skeleton(angles)
        centres = self.hand.spheres(skeleton)
        pose = self.pose(shift)
        distance, normal = pose.distance(self.shape, centres)
        gap = distance - self.hand.sphere_radii[:, None]
        square = self._looking(skeleton) + normal[self.pads]
        fingers = angles.reshape(5, 4, -1)[1:]
        return np.concatenate(
            [
                (gap[self.pads] + _SINK_IN_MM) / TOUCH_MM,
                np.minimum(gap[self._others] - _CLEAR_MM, 0.0) / SINK_MM,
                square.reshape(-1, square.shape[2]) / SQUARE / np.sqrt(3.0),
                (angles - self.nominal[:, None]) / np.radians(NOMINAL_DEG)[:, None],
                (fingers[:, 3] - fingers[:, 2] * 2 / 3) / np.radians(COUPLING_DEG),
                shift[:3] / self.prehension.loose,
                shift[3:] / TURN_RAD,
                np.minimum(self._room(centres), 0.0) / SINK_MM,
                self._imbalance(normal, centres, pose) / BALANCE,
            ]
        )

    def balance(self, normal: Floats, centres: Floats, position: Floats) -> tuple[Floats, Floats]:
        """Return `shares` of the pads for all spheres' normals (m, 3) and centres (m, 3), and an object's position."""
        return shares(wrenches(normal[self.pads], centres[self.pads] - position))

    def _looking(self, skeleton: Skeleton) -> Floats:
        """Return which way the pads look (p, 3, n)."""
        frames = skeleton.frames[self.hand.sphere_capsules[self.pads]]
        looking: Floats = (frames * self._sides[:, None, :, None]).sum(axis=2)
        return looking

    def _room(self, centres: Floats) -> Floats:
        """Return how far pairs of spheres (q, n) are from running into one another."""
        first, second = self._pairs
        between, radii = centres[first] - centres[second], self.hand.sphere_radii
        room: Floats = np.sqrt((between * between).sum(axis=1)) - _OVERLAP * (radii[first] + radii[second])[:, None]
        return room

    def _imbalance(self, normal: Floats, centres: Floats, pose: Pose) -> Floats:
        """Return the best balance (6, n) of pushing pads: what is left, over the grip force; moments over 30 mm."""
        rows = [self.balance(normal[:, :, k], centres[:, :, k], pose.position[:, k])[1] for k in range(normal.shape[2])]
        return np.stack(rows, axis=1)


def wrenches(normals: Floats, levers: Floats) -> Floats:
    """Return the wrenches (6, p) of unit pushes against normals (p, 3) at levers (p, 3) mm; moments over 30 mm."""
    return np.concatenate([-normals, np.cross(levers, -normals) / 30.0], axis=1).T


def shares(wrench: Floats) -> tuple[Floats, Floats]:
    """Return how p pads share a grip force of 1 so that they balance best, none pulling, and what is left (6,)."""
    from scipy.optimize import nnls

    count = wrench.shape[1]
    even = EVENNESS * np.eye(count)
    stacked = np.concatenate([wrench, even, 10.0 * np.ones((1, count))])
    wanted = np.concatenate([np.zeros(6), np.full(count, EVENNESS / count), [10.0]])
    found, _ = nnls(stacked, wanted)
    found = found / found.sum()
    return found, wrench @ found


def object_start(hand: Hand, prehension: Prehension, shape: Shape) -> Floats:
    """Return the pose (6,) where the type's table puts the object."""
    x = _unit(np.array(prehension.axis))
    up = np.array(prehension.up)
    z = _unit(up - x * (up @ x))
    axes = np.stack([x, np.cross(z, x), z], axis=1)
    away = _unit(np.array(prehension.away))
    length, breadth = hand.size.length_mm, hand.size.breadth_mm
    touch = np.array(prehension.at) * [length, breadth, breadth]
    position = touch + away * _half(shape, axes.T @ away)
    return np.concatenate([position, rotation_vector(axes[:, :, None])[:, 0]])


def _half(shape: Shape, direction: Floats) -> float:
    """Return how far the object reaches from its middle in a direction (3,) of its own axes."""
    extent = np.array(shape.extent_mm()) / 2
    if isinstance(shape, Sphere):
        return float(extent[0])
    if isinstance(shape, Cylinder):
        return float(abs(direction[0]) * extent[0] + np.hypot(direction[1], direction[2]) * extent[1])
    return float(np.abs(direction) @ extent)


def _unit(vector: Floats) -> Floats:
    return vector / np.linalg.norm(vector)


def _digit_pairs(hand: Hand) -> tuple[Indices, Indices]:
    """Return pairs of spheres of skin that must not run into one another: neighbouring fingers, thumb and fingers."""
    digit = np.where(hand.sphere_capsules < 15, hand.sphere_capsules // 3, -9)
    first, second = np.triu_indices(len(digit), 1)
    near = (np.abs(digit[first] - digit[second]) == 1) & (digit[first] > 0)
    thumb = (digit[first] == 0) & (hand.sphere_capsules[first] > 0) & (digit[second] > 0)
    return first[near | thumb], second[near | thumb]
