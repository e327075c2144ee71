"""Hand and object at one candidate of rest: commands, contacts and all forces.

The unknowns are 20 joint angles and the object's 6 degrees of freedom. Every joint is a spring about its commanded
angle, with the torque that presses the pads (model.py). Skin is a set of spheres, each a spring where it penetrates the
object, with sticking friction: a second, sideways spring from the point of skin to the point of the object that first
touched; it is released beyond the Coulomb limit (settle.py defines when, and the excess that skin may have at rest).
The object bears its weight and the forces of the skin; a soft spring to its initial pose holds any free motion, and the
force of that spring is reported as the residual.

Digits interact only through the object, so the Newton system is eliminated digit by digit (4 x 4), then the object
(6 x 6). All sums have one fixed order: a repetition's result does not depend on the others, or on the machine.

Arrays: 5 digits, 7 spheres of skin a digit, 15 of the palm, 50 in all, n repetitions last.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats, add_up

from ..body.hand import LIMITS_DEG, Hand
from ..body.shapes import Cylinder, Pose, Shape
from .model import GRAVITY, STIFFNESS, Load, torques


def dot(a: Floats, b: Floats) -> Floats:
    """Return (m, n) of (m, 3, n) and (m, 3, n)."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def cross(a: Floats, b: Floats) -> Floats:
    """Return (m, 3, n) of (m, 3, n) and (m, 3, n)."""
    crossed = np.empty(np.broadcast_shapes(a.shape, b.shape))
    np.subtract(a[:, 1] * b[:, 2], a[:, 2] * b[:, 1], out=crossed[:, 0])
    np.subtract(a[:, 2] * b[:, 0], a[:, 0] * b[:, 2], out=crossed[:, 1])
    np.subtract(a[:, 0] * b[:, 1], a[:, 1] * b[:, 0], out=crossed[:, 2])
    return crossed


def length(vectors: Floats) -> Floats:
    """Return (n,) of (3, n)."""
    return np.sqrt(add_up(vectors * vectors))


def turn(now: Floats, then: Floats) -> Floats:
    """Return the small rotation (3, n) from `then` to `now` (3, 3, n), in hand axes."""
    columns = cross(then.swapaxes(0, 1), now.swapaxes(0, 1))
    return add_up(columns) * 0.5


def turned(frames: Floats, vectors: Floats) -> Floats:
    """Return vectors (m, 3, n), given in the axes of frames (m, 3, 3, n), in hand axes."""
    x, y, z = vectors[:, 0, None], vectors[:, 1, None], vectors[:, 2, None]
    return frames[:, :, 0] * x + frames[:, :, 1] * y + frames[:, :, 2] * z


def wrench(levers: Floats, forces: Floats) -> Floats:
    """Return force and moment (m, k, 6, n) of forces (m, k, 3, n) at levers (m, 3, n)."""
    found = np.empty((*forces.shape[:2], 6, forces.shape[3]))
    found[:, :, :3] = forces
    x, y, z = levers[:, None, 0], levers[:, None, 1], levers[:, None, 2]
    np.subtract(y * forces[:, :, 2], z * forces[:, :, 1], out=found[:, :, 3])
    np.subtract(z * forces[:, :, 0], x * forces[:, :, 2], out=found[:, :, 4])
    np.subtract(x * forces[:, :, 1], y * forces[:, :, 0], out=found[:, :, 5])
    return found


def contract(a: Floats, b: Floats) -> Floats:
    """Return a b^T over xyz: (m, i, 3, n) and (m, j, 3, n) give (m, i, j, n)."""
    product = a[:, :, None, 0] * b[:, None, :, 0]
    product += a[:, :, None, 1] * b[:, None, :, 1]
    product += a[:, :, None, 2] * b[:, None, :, 2]
    return product


Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Surfaces:
    """Shapes, and the index of each repetition's shape: `whose` (n,), ascending."""

    shapes: tuple[Shape, ...]
    whose: Indices

    def rows(self, index: Indices) -> "Surfaces":
        """Return the surfaces of some repetitions, in order."""
        return Surfaces(self.shapes, self.whose[index])

    def at(self, pose: Pose, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Return signed distances (m, n), outward normals (m, 3, n) and curvatures (m, n) at points (m, 3, n)."""
        own = pose.inward(points)
        distance, normal, curvature = np.empty((len(own), own.shape[2])), np.empty_like(own), np.empty_like(own[:, 0])
        edges = np.searchsorted(self.whose, np.arange(len(self.shapes) + 1))
        for shape, first, last in zip(self.shapes, edges[:-1], edges[1:], strict=True):
            if first < last:
                part = own[..., first:last]
                distance[:, first:last], normal[..., first:last] = shape.distance(part)
                curvature[:, first:last] = shape.curvature(part)
        return distance, pose.outward(normal), curvature

    def bars(self) -> Floats:
        """Return 1 for repetitions (n,) whose object is straight along its x, 0 for others."""
        straight = np.array([isinstance(shape, Cylinder) for shape in self.shapes], dtype=np.float64)
        return straight[self.whose]


def surfaces(shapes: Sequence[Shape], counts: Sequence[int]) -> Surfaces:
    """Return the surfaces of `counts` repetitions of each shape; neighbours of one shape are evaluated together."""
    different: list[Shape] = []
    whose: list[int] = []
    for shape, count in zip(shapes, counts, strict=True):
        if not different or different[-1] != shape:
            different.append(shape)
        whose += [len(different) - 1] * count
    return Surfaces(tuple(different), np.array(whose, dtype=np.intp))


@dataclass(frozen=True, slots=True)
class SolverSettings:
    """Numerical parameters on which results should hardly depend; halving them measures how much they do.

    rest_n, rest_nmm  residual force and moment allowed at rest, on the object and on each joint
    parts             number of parts of every Newton step, each recomputed; all counts of steps grow as much
    """

    rest_n: float = 0.05
    rest_nmm: float = 3.0
    parts: int = 1


USUAL = SolverSettings()


@dataclass(frozen=True, slots=True)
class Skin:
    """The compliance of skin: newtons per mm of penetration, per mm of sideways drag, and friction.

    The first `soft_mm` are softer, like pulp, so that forces begin without a kink.
    """

    press_n_per_mm: float
    soft_mm: float
    drag_n_per_mm: float
    friction: float

    def press(self, sunk: Floats) -> tuple[Floats, Floats]:
        """Return force and stiffness of spheres at a depth of `sunk` mm, any shape."""
        deep = np.maximum(sunk, 0.0)
        soft = np.minimum(deep, self.soft_mm)
        stiffness = self.press_n_per_mm * soft / self.soft_mm
        return stiffness * (deep - soft / 2.0), stiffness

    def drag(self, sunk: Floats) -> Floats:
        """Return the sideways stiffness of spheres at a depth of `sunk` mm: it grows over the first `soft_mm` too."""
        return self.drag_n_per_mm * np.minimum(np.maximum(sunk, 0.0), self.soft_mm) / self.soft_mm


@dataclass(frozen=True, slots=True, eq=False)
class HandCommand:
    """The commands of n hands of one size.

    torque  (20, n)  that presses the pads, N mm
    weight  (3, n)   of the objects, N
    skin_points, object_points (50, 3, n)  points that stuck together, in the axes of capsule and object
    """

    hand: Hand
    surfaces: Surfaces
    angles: Floats
    pose: Pose
    torque: Floats
    weight: Floats
    skin_points: Floats
    object_points: Floats

    def rows(self, index: Indices) -> "HandCommand":
        """Return the command of some repetitions, in order."""
        return HandCommand(
            self.hand,
            self.surfaces.rows(index),
            self.angles[:, index],
            self.pose.rows(index),
            self.torque[:, index],
            self.weight[:, index],
            self.skin_points[..., index],
            self.object_points[..., index],
        )


def command(loads: Sequence[Load]) -> HandCommand:
    """Return the commands of all `loads`, of one hand, one after the other."""
    hand = loads[0].condition.hand
    counts = [len(load.grip_n) for load in loads]
    shapes = surfaces([load.condition.thing.shape for load in loads], counts)
    angles = np.concatenate([load.angles for load in loads], axis=1)
    pose = Pose.of(np.concatenate([load.pose.T for load in loads], axis=1))
    skeleton = hand.skeleton(angles)
    centres = hand.spheres(skeleton)
    touch = centres - hand.sphere_radii[:, None, None] * shapes.at(pose, centres)[1]
    frames = skeleton.frames[hand.sphere_capsules]
    relative = touch - skeleton.origins[hand.sphere_capsules]
    own = np.stack([dot(frames[:, :, k], relative) for k in range(3)], axis=1)
    turning = [
        torques(load.condition, hand.skeleton(load.angles), Pose.of(load.pose.T)) * load.grip_n for load in loads
    ]
    pulling = [load.condition.thing.mass_kg * GRAVITY * load.condition.held.down for load in loads]
    weight = np.stack(pulling, axis=1).repeat(counts, axis=1)
    return HandCommand(hand, shapes, angles, pose, np.concatenate(turning, axis=1), weight, own, pose.inward(touch))


Bits = NDArray[np.bool_]

DIGIT_SPHERES = 35
LIMIT_NMM_PER_RAD = 20000.0  # of a joint beyond its range
HOLD_N_PER_MM, HOLD_NMM_PER_RAD = 0.05, 100.0  # the soft spring on the object
_LEVER_MM = 30.0  # the lever that converts moments to forces
_LOW, _HIGH = (LIMITS_DEG.T[side, :, None] * (np.pi / 180.0) for side in (0, 1))
# The joints (4) that move each of a digit's spheres of skin (7): three on its first segment, two on each of the others.
_REACH = np.array([[1, 1, 0, 0]] * 3 + [[1, 1, 1, 0]] * 2 + [[1, 1, 1, 1]] * 2, dtype=np.float64)


class Balance:
    """Forces at joint angles (20, n) and object poses.

    normal (50, 3, n)     of the surface at each sphere of skin
    sunk, presses, press_stiffness (50, n)   mm, N, N per mm
    dragged (50, 3, n)    sideways drag of each, mm
    kept (50, n)          share of it that friction bears, 1 if it sticks
    drag (50, n)          N per mm of `dragged`: less if it slips, so that no force exceeds `sticks` times Coulomb's
    drags, forces (50, 3, n)   of friction, and in all, on each sphere of skin, N
    bent (50, n)          reduction of its sideways stiffness by the curvature of the surface, N per mm
    levers (50, 3, n)     its contact point, from the object's centre
    jacobian (5, 7, 4, 3, n)   motion of the skin of the digits with their joints, mm per radian
    on_object (6, n), on_joints (20, n)      the imbalance, N and N mm
    residual_n, residual_nmm (n,)            unbalanced force and moment of skin and weight on the object
    """

    def __init__(self, command: HandCommand, skin: Skin, angles: Floats, pose: Pose, sticks: float = 1.0) -> None:
        self.command, self.skin, self.angles, self.pose = command, skin, angles, pose
        hand = command.hand
        self.skeleton = hand.skeleton(angles)
        centres = hand.spheres(self.skeleton)
        distance, self.normal, curvature = command.surfaces.at(pose, centres)
        self.sunk = hand.sphere_radii[:, None] - distance
        self.presses, self.press_stiffness = skin.press(self.sunk)
        self.levers = centres - np.minimum(distance, hand.sphere_radii[:, None])[:, None] * self.normal - pose.position
        self.dragged = self._dragged()
        drag = skin.drag(self.sunk)
        self.kept = self._kept(drag)
        self.drag = drag * np.minimum(sticks * self.kept, 1.0)
        self.bent = np.minimum(self.presses * curvature, 0.9 * self.drag)
        self.drags = -self.drag[:, None] * self.dragged
        self.forces = self.presses[:, None] * self.normal + self.drags
        self._on_object()
        self._on_joints()

    @cached_property
    def of_skin(self) -> Floats:
        """Positions of the points of skin (50, 3, n) that touch first."""
        capsules = self.command.hand.sphere_capsules
        return self.skeleton.origins[capsules] + turned(self.skeleton.frames[capsules], self.command.skin_points)

    def _dragged(self) -> Floats:
        moved = self.of_skin - (self.pose.outward(self.command.object_points) + self.pose.position)
        return moved - dot(moved, self.normal)[:, None] * self.normal

    def _kept(self, drag: Floats) -> Floats:
        far = np.sqrt(dot(self.dragged, self.dragged)) + 1e-9
        most = self.skin.friction * self.presses / np.maximum(drag, 1e-9)
        return np.where(self.presses > 0.0, np.minimum(most / far, 1.0), 0.0)

    def slipped(self) -> Floats:
        """Return the points of the object that stick to the skin (50, 3, n) after slipping.

        A drag beyond friction is released, and all of it if skin is off the object.
        """
        return self.pose.inward(self.of_skin - self.kept[:, None] * self.dragged)

    def _on_object(self) -> None:
        loaded = self.command.weight - add_up(self.forces)
        twisted = -add_up(cross(self.levers, self.forces))
        self.residual_n, self.residual_nmm = length(loaded), length(twisted)
        shift = self.pose.position - self.command.pose.position
        angle = turn(self.pose.rotation, self.command.pose.rotation)
        self.on_object = np.concatenate([loaded - HOLD_N_PER_MM * shift, twisted - HOLD_NMM_PER_RAD * angle])

    def _on_joints(self) -> None:
        n = self.angles.shape[1]
        points = (self.levers[:DIGIT_SPHERES] + self.pose.position).reshape(5, 7, 1, 3, n)
        levers = points - self.skeleton.centres[:, None]
        axes = np.broadcast_to(self.skeleton.axes[:, None], levers.shape)
        moved = cross(axes.reshape(-1, 3, n), levers.reshape(-1, 3, n)).reshape(5, 7, 4, 3, n)
        self.jacobian = moved * _REACH[None, :, :, None, None]
        work = self.jacobian * self.forces[:DIGIT_SPHERES].reshape(5, 7, 1, 3, n)
        pushed = add_up((work[:, :, :, 0] + work[:, :, :, 1] + work[:, :, :, 2]).swapaxes(0, 1)).reshape(20, n)
        over = np.maximum(self.angles - _HIGH, 0.0) + np.minimum(self.angles - _LOW, 0.0)
        self.beyond = over != 0.0
        spring = STIFFNESS[:, None] * (self.angles - self.command.angles) + LIMIT_NMM_PER_RAD * over
        self.on_joints = self.command.torque - spring + pushed

    @cached_property
    def _left(self) -> tuple[Floats, Floats, Floats]:
        joints: Floats = np.abs(self.on_joints).max(axis=0)
        return length(self.on_object[:3]), length(self.on_object[3:]), joints

    @cached_property
    def unrest(self) -> Floats:
        """The imbalance (n,) of the forces, with moments over 30 mm."""
        force, moment, joints = self._left
        return np.maximum(np.maximum(force, moment / _LEVER_MM), joints / _LEVER_MM)

    def at_rest(self, pace: SolverSettings) -> Bits:
        """Return the mask (n,) of repetitions at rest, without any that hold a NaN."""
        force, moment, joints = self._left
        return (force < pace.rest_n) & (moment < pace.rest_nmm) & (joints < pace.rest_nmm)
