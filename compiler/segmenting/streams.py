"""Streams: the rows of a set of grasps in time, tick by tick, in the order in which a live glove sends them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError

from ..recordings.graspset import GraspSet
from ..recordings.trials import groups

TICK_US = 10_000  # also between consecutive rows if times are unknown
# A longer pause ends a stream: the grasp before it carries no information about the one after it.
PAUSE_US = 1_000_000


class SegmentingError(ThenarError, ValueError):
    """Recordings in which no segments can be found, or from which none can be learned."""


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """A subject's rows in one session, without a pause.

    rows      (T,) index of the newest row of the set at each tick
    start_us  the time of the first tick, on the clock of the set
    """

    subject: str
    session: str
    rows: NDArray[np.intp]
    start_us: int


def moving(grasp_set: GraspSet) -> NDArray[np.bool_]:
    """Return (n,) which rows are part of a whole movement, rather than separate trials."""
    movements = grasp_set.movement_ids
    return np.asarray((np.bincount(movements, minlength=1)[movements] > 1) & (not grasp_set.independent))


def streams_of(grasp_set: GraspSet, tick_us: int = TICK_US) -> tuple[Stream, ...]:
    """Return the streams of a set, in the order of their first rows.

    A stream ends where the time does not increase, and before a pause. Rows that are separate trials, such as static
    grasps, belong to no stream. Raises SegmentingError if all rows do.
    """
    within = moving(grasp_set)
    if not within.any():
        raise SegmentingError(
            "each row of the set is a separate trial: segments need whole movements, as `thenar record` or "
            'scenes with rows = "all" make them'
        )
    owner, found = groups(grasp_set.subjects, grasp_set.sessions), []
    for number in range(int(owner.max()) + 1):
        own = np.flatnonzero((owner == number) & within)
        if not len(own):
            continue
        times = grasp_set.times_us[own] if grasp_set.times_us.size else TICK_US * np.arange(len(own))
        steps = np.diff(times)
        cuts = np.flatnonzero((steps <= 0) | (steps > PAUSE_US)) + 1
        subject, session = str(grasp_set.subjects[own[0]]), str(grasp_set.sessions[own[0]])
        for rows, at in zip(np.split(own, cuts), np.split(times, cuts), strict=True):
            ticks = np.arange(int(at[0]), int(at[-1]) + 1, tick_us)
            newest = rows[np.searchsorted(at, ticks, side="right") - 1]
            found.append(Stream(subject, session, newest, int(at[0])))
    return tuple(sorted(found, key=lambda stream: int(stream.rows[0])))
