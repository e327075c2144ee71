"""Planning of postures that hold an object with a grasp type, by least squares.

A candidate is 26 numbers: 20 joint angles in radians, a shift of the object in mm and a rotation in radians, both
relative to the pose in the type's table.

The least squares start from the type's nominal posture (scipy, needed only for planning: postures are stored as data).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats

from ..body.condition import Pad, PlannedGrasp, Thing
from ..body.hand import LIMITS_DEG, Hand, Skeleton
from ..body.shapes import Cylinder, Pose, Shape, Sphere, rotation_vector
from ..errors import SceneError
from .postures import FRICTION
from .prehension import Prehension, pad_side, pad_sphere

Indices = NDArray[np.intp]

# The values at which residuals are 1. All ours.
TOUCH_MM = 0.4
SINK_MM = 0.7
SQUARE = 0.45  # of a pad to the surface, as the length of a difference of unit vectors
NOMINAL_DEG = np.array([15.0, 20.0, 20.0, 20.0] + [7.0, 20.0, 20.0, 20.0] * 4)
COUPLING_DEG = 15.0  # of a finger's last joint to two thirds of the one before
TURN_RAD = 0.25
BALANCE = 0.25
EVENNESS = 0.6  # of the pads' shares, against their balance

_SINK_IN_MM = 0.3  # depth of a touching pad
_CLEAR_MM = 1.0  # distance of everything else
_OVERLAP = 0.85  # smallest distance of two fingers over their radii


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
        """Return the object's pose after shifts (6, n)."""
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
        """Return the directions of the pads (p, 3, n)."""
        frames = skeleton.frames[self.hand.sphere_capsules[self.pads]]
        looking: Floats = (frames * self._sides[:, None, :, None]).sum(axis=2)
        return looking

    def _room(self, centres: Floats) -> Floats:
        """Return the distances of pairs of spheres (q, n) from collision."""
        first, second = self._pairs
        between, radii = centres[first] - centres[second], self.hand.sphere_radii
        room: Floats = np.sqrt((between * between).sum(axis=1)) - _OVERLAP * (radii[first] + radii[second])[:, None]
        return room

    def _imbalance(self, normal: Floats, centres: Floats, pose: Pose) -> Floats:
        """Return the residual (6, n) of the best balance of pushing pads, over the grip force; moments over 30 mm."""
        rows = [self.balance(normal[:, :, k], centres[:, :, k], pose.position[:, k])[1] for k in range(normal.shape[2])]
        return np.stack(rows, axis=1)


def wrenches(normals: Floats, levers: Floats) -> Floats:
    """Return the wrenches (6, p) of unit pushes against normals (p, 3) at levers (p, 3) mm; moments over 30 mm."""
    pushes = -normals
    (x, y, z), (u, v, w) = levers.T, pushes.T
    moments = np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1) / 30.0
    return np.concatenate([pushes, moments], axis=1).T


def shares(wrench: Floats) -> tuple[Floats, Floats]:
    """Return the shares of p pads in a grip force of 1 with the best balance, none pulling, and the residual (6,)."""
    from scipy.optimize import nnls

    even, wanted = _evenly(wrench.shape[1])
    found, _ = nnls(np.concatenate([wrench, even]), wanted)
    found = found / found.sum()
    return found, wrench @ found


@cache
def _evenly(count: int) -> tuple[Floats, Floats]:
    """Return the rows (p + 1, p) below a wrench, for even shares with the sum 1, and the right side (p + 7,)."""
    rows = np.concatenate([EVENNESS * np.eye(count), 10.0 * np.ones((1, count))])
    return rows, np.concatenate([np.zeros(6), np.full(count, EVENNESS / count), [10.0]])


def object_start(hand: Hand, prehension: Prehension, shape: Shape) -> Floats:
    """Return the object's pose (6,) from the type's table."""
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
    """Return the extent of the object from its middle in a direction (3,) of its axes."""
    extent = np.array(shape.extent_mm()) / 2
    if isinstance(shape, Sphere):
        return float(extent[0])
    if isinstance(shape, Cylinder):
        return float(abs(direction[0]) * extent[0] + np.hypot(direction[1], direction[2]) * extent[1])
    return float(np.abs(direction) @ extent)


def _unit(vector: Floats) -> Floats:
    return vector / np.linalg.norm(vector)


def _digit_pairs(hand: Hand) -> tuple[Indices, Indices]:
    """Return pairs of spheres of skin that must not collide: neighbouring fingers, thumb and fingers."""
    digit = np.where(hand.sphere_capsules < 15, hand.sphere_capsules // 3, -9)
    first, second = np.triu_indices(len(digit), 1)
    near = (np.abs(digit[first] - digit[second]) == 1) & (digit[first] > 0)
    thumb = (digit[first] == 0) & (hand.sphere_capsules[first] > 0) & (digit[second] > 0)
    return first[near | thumb], second[near | thumb]


TOLERANCE_MM = 4.0  # gaps and depths up to this are resolved by the contact model
# The share of the push borne by friction if pads do not push straight against each other: the sine of its angle.
BORNE = FRICTION / float(np.sqrt(1.0 + FRICTION * FRICTION))


@dataclass(frozen=True, slots=True)
class Plan:
    """A planned posture and its quality.

    cost       the minimised cost
    gap_mm     the widest gap under a pad
    sunk_mm    the greatest depth of any skin
    imbalance  residual of the pads' pushes, over the grip force (borne by friction)
    """

    held: PlannedGrasp
    cost: float
    gap_mm: float
    sunk_mm: float
    imbalance: float

    def holds(self) -> bool:
        """Return whether every pad is near enough, no skin too deep in the object, and friction bears the imbalance."""
        return self.excess() <= 1.0

    def excess(self) -> float:
        """Return the worst fault over its tolerance."""
        return max(self.gap_mm / TOLERANCE_MM, self.sunk_mm / TOLERANCE_MM, self.imbalance / BORNE)


def plan(hand: Hand, grasp: str, prehension: Prehension, thing: Thing, near: PlannedGrasp | None = None) -> Plan:
    """Return a posture of `hand` that holds `thing`; `near` is a starting posture of a hand of similar size.

    Raises SceneError if the best one leaves a pad too far off or skin too deep, or pushes the object away.
    """
    from threadpoolctl import threadpool_limits

    misfit = Misfit(hand, prehension, thing.shape)
    # Small matrices: more threads would take longer, and change the last digits.
    with threadpool_limits(1):
        plans = [] if near is None else [_descend(misfit, _start_near(misfit, near))]
        if not any(one.holds() for one in plans):
            plans += [_descend(misfit, start) for start in _starts(misfit)]
    # The plan of the least cost among those that hold; if none does, the one closest to holding.
    best = min(plans, key=lambda one: (not one.holds(), one.cost if one.holds() else one.excess()))
    if not best.holds():
        raise SceneError(_refusal(hand, grasp, thing, best))
    return best


def measure(hand: Hand, held: PlannedGrasp, shape: Shape) -> tuple[float, float]:
    """Return the widest gap under a pad, and the greatest depth of any skin, in mm."""
    centres = hand.spheres(hand.skeleton(np.radians(held.posture_deg)[:, None]))
    gap = Pose.of(held.pose[:, None]).distance(shape, centres)[0][:, 0] - hand.sphere_radii
    return float(gap[[pad.sphere for pad in held.pads]].max()), float(-gap.min())


def _refusal(hand: Hand, grasp: str, thing: Thing, best: Plan) -> str:
    wrong = (
        (best.gap_mm / TOLERANCE_MM, f"leaves {best.gap_mm:.1f} mm under a pad (at most {TOLERANCE_MM:g})"),
        (best.sunk_mm / TOLERANCE_MM, f"lets skin sink in {best.sunk_mm:.1f} mm (at most {TOLERANCE_MM:g})"),
        (best.imbalance / BORNE, f"leaves {best.imbalance:.0%} of the push unbalanced (friction bears {BORNE:.0%})"),
    )
    return (
        f"a hand of {hand.size.length_mm:g} mm cannot hold {thing.name!r} with grasp type {grasp!r}: the best posture "
        f"{' and '.join(words for excess, words in wrong if excess > 1.0)}; take an object of another size, or another "
        "grasp type for it"
    )


def _start_near(misfit: Misfit, near: PlannedGrasp) -> Floats:
    """Return the candidate (26,) with a known posture's joint angles and object's pose."""
    known, start = Pose.of(near.pose[:, None]), Pose.of(misfit.start[:, None])
    turn = rotation_vector(np.einsum("ijn,kjn->ikn", known.rotation, start.rotation))
    return np.concatenate([np.radians(near.posture_deg), (known.position - start.position)[:, 0], turn[:, 0]])


def _starts(misfit: Misfit) -> Iterator[Floats]:
    """Yield candidates (26,): the nominal posture, and more open ones with the object further away."""
    away = np.array(misfit.prehension.away)
    away = away / np.linalg.norm(away)
    for further, opened in ((0.0, 1.0), (12.0, 0.8), (25.0, 0.55)):
        angles = misfit.nominal.reshape(5, 4).copy()
        angles[1:, 1:] *= opened
        yield np.concatenate([angles.ravel(), further * away, np.zeros(3)])


def _descend(misfit: Misfit, start: Floats) -> Plan:
    from scipy.optimize import least_squares

    def residuals(x: Floats) -> Floats:
        return misfit.residuals(x[:, None])[:, 0]

    def jacobian(x: Floats) -> Floats:
        return _jacobian(misfit, x)

    low, high = np.radians(LIMITS_DEG.T)
    bounds = (np.concatenate([low, np.full(6, -np.inf)]), np.concatenate([high, np.full(6, np.inf)]))
    found = least_squares(
        residuals,
        np.clip(start, bounds[0] + 1e-6, bounds[1] - 1e-6),
        jac=jacobian,
        bounds=bounds,
        x_scale=np.concatenate([np.full(20, 0.2), np.full(3, 5.0), np.full(3, 0.2)]),
        max_nfev=150,
        xtol=1e-6,
        ftol=1e-6,
    )
    return _finished(misfit, found.x, float(found.cost))


def _jacobian(misfit: Misfit, x: Floats) -> Floats:
    steps = np.concatenate([np.full(20, 1e-5), np.full(3, 1e-4), np.full(3, 1e-5)])
    moved = np.concatenate([x[:, None] + np.diag(steps), x[:, None] - np.diag(steps)], axis=1)
    values = misfit.residuals(moved)
    slopes: Floats = (values[:, :26] - values[:, 26:]) / (2 * steps)
    return slopes


def _finished(misfit: Misfit, x: Floats, cost: float) -> Plan:
    hand, prehension = misfit.hand, misfit.prehension
    centres = hand.spheres(hand.skeleton(x[:20, None]))
    pose = misfit.pose(x[20:, None])
    normal = pose.distance(misfit.shape, centres)[1]
    share, left = misfit.balance(normal[:, :, 0], centres[:, :, 0], pose.position[:, 0])
    pads = tuple(Pad(int(sphere), float(part)) for sphere, part in zip(misfit.pads, share, strict=True))
    numbers = np.concatenate([pose.position[:, 0], rotation_vector(pose.rotation)[:, 0]])
    down = np.array(prehension.down)
    held = PlannedGrasp(np.degrees(x[:20]), numbers, pads, prehension.grip_n, down / np.linalg.norm(down))
    return Plan(held, cost, *measure(hand, held, misfit.shape), float(np.linalg.norm(left)))
