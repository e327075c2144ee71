"""All forces on hand and object at one guess, and how far they are from balance."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import add_up

from ...body.hand import LIMITS_DEG
from ...body.pose import Pose
from ..grip import STIFFNESS
from .case import Command, Skin
from .pace import Pace
from .vectors import cross, dot, length, turn, turned

Floats = NDArray[np.float64]
Bits = NDArray[np.bool_]

DIGIT_SPHERES = 35
LIMIT_NMM_PER_RAD = 20000.0  # of a joint beyond its range
HOLD_N_PER_MM, HOLD_NMM_PER_RAD = 0.05, 100.0  # the soft spring on the object
_LEVER_MM = 30.0  # what a moment is held against a force by
_LOW, _HIGH = (LIMITS_DEG.T[side, :, None] * (np.pi / 180.0) for side in (0, 1))
# Which joints (4) move each of a digit's spheres of skin (7): three on its first segment, two on each of the others.
_REACH = np.array([[1, 1, 0, 0]] * 3 + [[1, 1, 1, 0]] * 2 + [[1, 1, 1, 1]] * 2, dtype=np.float64)


class Balance:
    """Forces at joint angles (20, n) and object poses.

    normal (50, 3, n)     of the surface at each sphere of skin
    sunk, presses, press_stiffness (50, n)   mm, N, N per mm
    dragged (50, 3, n)    how far each is dragged sideways, mm
    kept (50, n)          how much of that friction bears, 1 where it sticks
    drag (50, n)          N per mm of `dragged`: less where it slips, so that no force exceeds `sticks` times Coulomb's
    drags, forces (50, 3, n)   of friction, and in all, on each sphere of skin, N
    bent (50, n)          how much less it resists sideways for the surface bends under it, N per mm
    levers (50, 3, n)     where each touches, from the object's middle
    jacobian (5, 7, 4, 3, n)   how the skin of the digits moves with their joints, mm per radian
    on_object (6, n), on_joints (20, n)      what is not in balance, N and N mm
    residual_n, residual_nmm (n,)            what skin and weight leave unbalanced on the object
    """

    def __init__(self, command: Command, skin: Skin, angles: Floats, pose: Pose, sticks: float = 1.0) -> None:
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
        """Where the points of skin are (50, 3, n) that touch first."""
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
        """Return what of the object sticks to the skin (50, 3, n) after slipping: a drag beyond friction is let go, and
        all of it where skin is off the object.
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
    def unrest(self) -> Floats:
        """How far (n,) the forces are from balance: moments count over 30 mm."""
        force, moment = length(self.on_object[:3]), length(self.on_object[3:])
        joints: Floats = np.abs(self.on_joints).max(axis=0)
        return np.maximum(np.maximum(force, moment / _LEVER_MM), joints / _LEVER_MM)

    def at_rest(self, pace: Pace) -> Bits:
        """Return which repetitions (n,) have come to rest; none that holds a NaN."""
        force, moment = length(self.on_object[:3]), length(self.on_object[3:])
        joints: Floats = np.abs(self.on_joints).max(axis=0)
        return (force < pace.rest_n) & (moment < pace.rest_nmm) & (joints < pace.rest_nmm)
