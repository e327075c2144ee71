"""Streams: the rows of a set of grasps in time, tick by tick, as a live glove would have sent them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError

from ..recordings.graspset import GraspSet
from ..recordings.trials import groups

TICK_US = 10_000  # also from one row to the next, where times are not known
# A longer pause ends a stream: what was held before it says nothing of what is held after it.
PAUSE_US = 1_000_000


class SegmentingError(ThenarError, ValueError):
    """Recordings in which no segments can be found, or from which none can be learnt."""


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """A subject's rows in one session, without a pause.

    rows      (T,) the newest row of the set at each tick
    start_us  the time of the first tick, on the clock of the set
    """

    subject: str
    session: str
    rows: NDArray[np.intp]
    start_us: int


def moving(grasp_set: GraspSet) -> NDArray[np.bool_]:
    """Return (n,) which rows are of a whole movement, and no trial of their own."""
    movements = grasp_set.movement_ids
    return np.asarray((np.bincount(movements, minlength=1)[movements] > 1) & (not grasp_set.independent))


def streams_of(grasp_set: GraspSet, tick_us: int = TICK_US) -> tuple[Stream, ...]:
    """Return the streams of a set, in the order of their first rows.

    A stream ends where the time does not rise, and before a pause. A row that is a trial of its own, as those of static
    grasps are, is of no stream. Raises SegmentingError where all rows are.
    """
    within = moving(grasp_set)
    if not within.any():
        raise SegmentingError(
            "each row of the set is a trial of its own: segments need whole movements, as `thenar record` and "
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
