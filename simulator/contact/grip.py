"""What drives a grasp: every joint is a spring about its commanded angle, and muscles press the pads on the object."""

import numpy as np
from numpy.typing import NDArray

from ..body.condition import Condition
from ..body.hand import Skeleton
from ..body.pose import Pose

Floats = NDArray[np.float64]

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
        moment = _cross(centre - skeleton.centres[digit, joint], force)
        axis = skeleton.axes[digit, joint]
        total[4 * digit + joint] += axis[0] * moment[0] + axis[1] * moment[1] + axis[2] * moment[2]


def _cross(a: Floats, b: Floats) -> Floats:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
