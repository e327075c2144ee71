"""What hands are told to do with their objects, and where their skin first touches."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...body.condition import Condition
from ...body.hand import Hand
from ...body.pose import Pose
from ..grip import GRAVITY, torques
from .surface import Surfaces, surfaces
from .vectors import dot

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Skin:
    """How skin gives: newtons per mm that a sphere sinks in, per mm that it is dragged sideways, and friction.

    The first `soft_mm` give twice as easily, as pulp does, so that forces begin without a kink.
    """

    press_n_per_mm: float
    soft_mm: float
    drag_n_per_mm: float
    friction: float

    def press(self, sunk: Floats) -> tuple[Floats, Floats]:
        """Return force and stiffness of spheres that sink in by `sunk` mm, any shape."""
        deep = np.maximum(sunk, 0.0)
        soft = np.minimum(deep, self.soft_mm)
        stiffness = self.press_n_per_mm * soft / self.soft_mm
        return stiffness * (deep - soft / 2.0), stiffness

    def drag(self, sunk: Floats) -> Floats:
        """Return the stiffness sideways of spheres that sink in by `sunk` mm: it grows over the first `soft_mm` too."""
        return self.drag_n_per_mm * np.minimum(np.maximum(sunk, 0.0), self.soft_mm) / self.soft_mm


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """Repetitions of one condition: joint angles (20, n) in radians, object poses (6, n), grip forces (n,)."""

    condition: Condition
    angles: Floats
    numbers: Floats
    grip_n: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """What n hands of one size were told.

    torque  (20, n)  what presses the pads, N mm
    weight  (3, n)   of the objects, N
    skin_points, object_points (50, 3, n)  what stuck together, in the axes of capsule and object
    """

    hand: Hand
    surfaces: Surfaces
    angles: Floats
    pose: Pose
    torque: Floats
    weight: Floats
    skin_points: Floats
    object_points: Floats

    def rows(self, index: Indices) -> "Command":
        """Return the command of some repetitions, in order."""
        return Command(
            self.hand,
            self.surfaces.rows(index),
            self.angles[:, index],
            Pose(self.pose.position[:, index], self.pose.rotation[..., index]),
            self.torque[:, index],
            self.weight[:, index],
            self.skin_points[..., index],
            self.object_points[..., index],
        )


def command(cases: Sequence[Case]) -> Command:
    """Return what all `cases`, of one hand, are told, one after the other."""
    hand = cases[0].condition.hand
    counts = [len(case.grip_n) for case in cases]
    shapes = surfaces([case.condition.thing.shape for case in cases], counts)
    angles = np.concatenate([case.angles for case in cases], axis=1)
    pose = Pose.of(np.concatenate([case.numbers for case in cases], axis=1))
    skeleton = hand.skeleton(angles)
    centres = hand.spheres(skeleton)
    touch = centres - hand.sphere_radii[:, None, None] * shapes.at(pose, centres)[1]
    frames = skeleton.frames[hand.sphere_capsules]
    relative = touch - skeleton.origins[hand.sphere_capsules]
    own = np.stack([dot(frames[:, :, k], relative) for k in range(3)], axis=1)
    torque = np.concatenate([_torque(case) for case in cases], axis=1)
    weight = np.stack([_weight(case.condition) for case in cases], axis=1).repeat(counts, axis=1)
    return Command(hand, shapes, angles, pose, torque, weight, own, pose.inward(touch))


def _torque(case: Case) -> Floats:
    skeleton = case.condition.hand.skeleton(case.angles)
    return torques(case.condition, skeleton, Pose.of(case.numbers)) * case.grip_n


def _weight(condition: Condition) -> Floats:
    return condition.thing.mass_kg * GRAVITY * condition.held.down
