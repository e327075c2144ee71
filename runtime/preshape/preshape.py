"""A preshape: where the joints of a robot hand shall stand before it closes."""

import msgspec

from ..errors import ThenarError


class PreshapeError(ThenarError, ValueError):
    """A table of preshapes cannot be used as it stands, or not with this build."""


class Preshape(msgspec.Struct, frozen=True):
    """One point of a trajectory, as trajectory_msgs/JointTrajectory has it.

    name               what the table calls it; several grasp types may share a preshape
    joint_names        the robot's joints, in the table's order
    positions          one a joint: rad for a joint that turns, m for one that slides, as everywhere in ROS
    time_from_start_s  when the hand shall be there, counted from the moment it is told
    """

    name: str
    joint_names: tuple[str, ...]
    positions: tuple[float, ...]
    time_from_start_s: float
