"""Preshapes of a robot hand, and when to change from one to the next: only after a grasp type has been certain for a
moment.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import msgspec

from thenar.drivers.errors import SettingError

from ..published import NONE, UNKNOWN, LiveGrasp


class Preshape(msgspec.Struct, frozen=True):
    """One point of a trajectory, as in trajectory_msgs/JointTrajectory.

    name               its name in the table; several grasp types may share a preshape
    joint_names        the robot's joints, in the table's order
    positions          one per joint: rad for a joint that turns, m for one that slides, as usual in ROS
    time_from_start_s  when the hand must arrive, counted from the moment of sending
    """

    name: str
    joint_names: tuple[str, ...]
    positions: tuple[float, ...]
    time_from_start_s: float


@dataclass(frozen=True, slots=True)
class PreshapeTable:
    """The preshapes of one robot hand: `chosen` holds one for every grasp type in the table.

    The table may also name "none": the preshape that opens the hand while nothing is held.
    """

    name: str
    chosen: Mapping[str, Preshape]

    def check(self, grasps: Iterable[str]) -> str:
        """Return a sentence about grasp types of the build (`grasps`) that have no preshape, or "" if all have one.

        Raises SettingError if the table names none of them, since it is for another taxonomy.
        """
        wanted = tuple(grasp for grasp in grasps if grasp != NONE)
        missing = tuple(grasp for grasp in wanted if grasp not in self.chosen)
        if not missing:
            return ""
        spare = [grasp for grasp in self.chosen if grasp not in wanted]
        from difflib import get_close_matches  # for messages only

        likely = {grasp: get_close_matches(grasp, spare, n=1, cutoff=0.8) for grasp in missing}
        if len(missing) == len(wanted) and not any(likely.values()):
            raise SettingError(
                f"preshapes {self.name}: none of the build's grasp types ({', '.join(wanted)}) is among the table's "
                f"({', '.join(self.chosen)}): use a table for the taxonomy of the build"
            )
        names = [grasp + "".join(f" (the table has {near!r})" for near in likely[grasp]) for grasp in missing]
        return f"preshapes {self.name}: none for {', '.join(names)}: nothing is sent to the hand for those"


MIN_PROBABILITY = 0.8
SETTLE_MS = 100


class PreshapeSelector:
    """Holds the last confident preshape.

    It changes to another only if every frame of the last `settle_ms` called for that one, each with at least
    `min_probability`. Until then it returns the preshape that it holds. On "unknown", and on a grasp type missing from
    the table, it returns None, and the hand stays where it is. While nothing is held, the last preshape stays, unless
    the table names one for "none".

    With `segments`, the type of the segment calls for a preshape, while it forms and while it is held, if the build
    knows "none". Once the preshape of a held segment is taken, it changes only after nothing was held, unless
    `change_while_held`. Without `segments`, `LiveGrasp.grasp` calls for it.
    """

    __slots__ = (
        "_called",
        "_change",
        "_held",
        "_locked",
        "_min_probability",
        "_segments",
        "_settle_us",
        "_since_us",
        "_table",
    )

    def __init__(
        self,
        table: PreshapeTable,
        *,
        min_probability: float = MIN_PROBABILITY,
        settle_ms: float = SETTLE_MS,
        segments: bool = False,
        change_while_held: bool = False,
    ) -> None:
        """Raise SettingError unless 0 <= min_probability <= 1 and settle_ms >= 0."""
        if not 0 <= min_probability <= 1:
            raise SettingError(f"the minimum probability of a preshape must be between 0 and 1, not {min_probability}")
        if not settle_ms >= 0:
            raise SettingError(f"the settle time of a preshape must be 0 ms or more, not {settle_ms}")
        self._table = table
        self._min_probability = min_probability
        self._settle_us = settle_ms * 1000
        self._segments, self._change = segments, change_while_held
        self._held: Preshape | None = None
        self._called: Preshape | None = None
        self._since_us = 0
        self._locked = False

    def update(self, grasp: LiveGrasp) -> Preshape | None:
        """Return the preshape that the hand should have now, or None to send it nothing."""
        type_, probability = grasp.grasp, grasp.probability
        if self._segments:
            type_, probability = grasp.segment_type, 1.0 if grasp.state == "none" else grasp.segment_probability
            self._locked &= grasp.state != "none"
        if type_ == UNKNOWN or grasp.health == "unknown":
            self._called = None
            return None
        wanted = self._table.chosen.get(type_)
        called = wanted if probability >= self._min_probability else None
        if called is not self._called:
            self._called, self._since_us = called, grasp.time_us
        if called is not None and grasp.time_us - self._since_us >= self._settle_us:
            if not self._locked:
                self._held = called
            self._locked |= grasp.state == "held" and called is self._held and self._segments and not self._change
        return None if wanted is None and type_ != NONE else self._held
