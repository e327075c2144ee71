"""What is lost: by what names, and whether too much of the build's weight went with it."""

from dataclasses import dataclass

import numpy as np

from ..build import Build
from ..tables import IntegerTables
from .frames import Mask


@dataclass(frozen=True, slots=True)
class Missing:
    """Names of lost switches and joints; share of the tables' weight that is lost; whether that is too much."""

    names: tuple[str, ...] = ()
    share: float = 0.0
    too_much: bool = False


class MissingInputs:
    """Says what is missing, and keeps the last answer: what is lost seldom changes.

    The weight of an input is how far its rows (of a switch: closed and open) lie apart, summed over the grasp types, in
    steps: an input that never moves a score weighs nothing. Too much is lost when the lost inputs' share of the weight
    of all exceeds `max_lost`, and when nothing that the build uses can be read.
    """

    def __init__(self, build: Build, max_lost: float) -> None:
        self._switch_names = tuple(switch.name for switch in build.manifest.switches)
        self._joint_names = tuple(joint.name for joint in build.manifest.joints)
        self._switches, self._joints = weights(build.tables)
        self._total = sum(self._switches) + self._joints
        self._all: Mask = (1 << len(self._switches)) - 1
        self._max_lost = max_lost
        self._state: tuple[Mask, bool] = 0, False
        self._last = Missing()

    def of(self, lost: Mask, joints_lost: bool) -> Missing:
        """Return what is missing when the switches `lost` are, and the joints or not."""
        if (lost, joints_lost) != self._state:
            self._state = lost, joints_lost
            self._last = self._work_out(lost, joints_lost)
        return self._last

    def _work_out(self, lost: Mask, joints_lost: bool) -> Missing:
        numbers = [number for number in range(len(self._switches)) if lost >> number & 1]
        weight = sum(self._switches[number] for number in numbers) + self._joints * joints_lost
        nothing_left = lost == self._all and (joints_lost or not self._joint_names)
        share = 1.0 if nothing_left else weight / max(self._total, 1)
        names = tuple(self._switch_names[number] for number in numbers) + self._joint_names * joints_lost
        return Missing(names, share, nothing_left or share > self._max_lost)


def weights(tables: IntegerTables) -> tuple[list[int], int]:
    """Return the weight of each switch, and of all joints together, in steps."""
    switches: list[int] = np.abs(tables.switch_rows.astype(np.int64)).sum(axis=1).tolist()
    joints = sum(int(np.ptp(rows.astype(np.int64), axis=0).sum()) for rows in tables.joint_rows)
    return switches, joints
