"""The interface of contact models, the torques of a grasp, and the sharing of forces by switches.

Every contact solver returns one net force per capsule; the switches of that capsule share it by their depth in the
object, since all represent the same area of skin. No force is lost: the part that reaches no switch fell between them,
and is returned separately.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats, add_up

from ..body.condition import Condition
from ..body.hand import CAPSULES, Skeleton
from ..body.layout import SwitchPlaces
from ..body.shapes import Pose


@dataclass(frozen=True, slots=True)
class Contact:
    """The rest of n repetitions of a condition, with s switches.

    posture_deg (n, 20), pose (n, 6)   as settled
    forces_n    (n, s)                 on the switches
    capsules_n  (n, 20)                net normal force on every capsule
    between_n   (n,)                   force between the switches
    settled     (n,)                   False if the model gave up or warned
    residual_n, residual_nmm (n,)      unbalanced force and moment on the object
    steps                              of the solver, for all repetitions together
    """

    posture_deg: Floats
    pose: Floats
    forces_n: Floats
    capsules_n: Floats
    between_n: Floats
    settled: NDArray[np.bool_]
    residual_n: Floats
    residual_nmm: Floats
    steps: int


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """The commands of n hands of a condition: posture_deg (n, 20) around an object at pose (n, 6), mm and radians, and
    a total pressing force of grip_n (n,).
    """

    condition: Condition
    posture_deg: Floats
    pose: Floats
    grip_n: Floats

    @property
    def angles(self) -> Floats:
        """The joint angles (20, n) in radians."""
        return self.posture_deg.T * (np.pi / 180.0)


# Closes hands on objects: returns their rest, one Contact per load. Repetitions are independent of each other.
ContactModel = Callable[[Sequence[Load]], list[Contact]]


# Stiffness of the joints in N mm per radian, order of DOF: ours, of the order measured on human fingers (0.3 to 1.5 N m
# per radian in grasps); abduction is stiffer than it is strong, and the thumb's base is the stiffest.
STIFFNESS = np.array([1500.0, 1500.0, 900.0, 600.0] + [900.0, 900.0, 600.0, 400.0] * 4)

# Standard gravity in N per kg. A weight pulls along `Held.down`.
GRAVITY = 9.80665


def torques(condition: Condition, skeleton: Skeleton, pose: Pose) -> Floats:
    """Return the joint torques (20, n) in N mm per newton of grip: each pad pushes its share into the object's surface,
    J^T f over the pads.
    """
    hand = condition.hand
    spheres = np.array([pad.sphere for pad in condition.held.pads], dtype=np.intp)
    shares = np.array([pad.share for pad in condition.held.pads])
    centres = hand.spheres(skeleton)[spheres]
    push = -shares[:, None, None] * pose.distance(condition.thing.shape, centres)[1]
    total = np.zeros((20, centres.shape[2]))
    for centre, force, capsule in zip(centres, push, hand.sphere_capsules[spheres], strict=True):
        if capsule < 15:
            _add_moments(total, skeleton, int(capsule), centre, force)
    return total


def _add_moments(total: Floats, skeleton: Skeleton, capsule: int, centre: Floats, force: Floats) -> None:
    digit, segment = divmod(capsule, 3)
    for joint in range(segment + 2):
        x, y, z = centre - skeleton.centres[digit, joint]
        moment = np.stack([y * force[2] - z * force[1], z * force[0] - x * force[2], x * force[1] - y * force[0]])
        total[4 * digit + joint] += add_up(skeleton.axes[digit, joint] * moment)


def split(switches: SwitchPlaces, depths: Floats, forces: Floats) -> tuple[Floats, Floats]:
    """Return the force on every switch (s, n), and the force between them (n,), in newtons.

    depths (s, n): depth of each contact's top in the object, mm, negative outside; forces (20, n): net normal force on
    each capsule. Their sums agree up to rounding.
    """
    sunk = np.maximum(depths, 0.0)
    shared, between = np.zeros_like(sunk), np.zeros(forces.shape[1])
    for capsule in range(len(CAPSULES)):
        own = np.flatnonzero(switches.capsules == capsule)
        total = add_up(sunk[own])
        touched = total > 0.0
        # Depth over depth first: force over a tiny depth would overflow.
        shared[own] = sunk[own] / np.where(touched, total, 1.0) * forces[capsule]
        between += np.where(touched, 0.0, forces[capsule])
    return shared, between
