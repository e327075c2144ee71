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
# A clock that falls by no more than this jitters; no movement is as short.
JITTER_US = 100_000


class SegmentingError(ThenarError, ValueError):
    """Recordings in which no segments can be found, or from which none can be learned."""


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """A subject's rows in one session, without a pause.

    rows       (T,) index of the newest row of the set at each tick
    start_us   the time of the first tick, on the clock of the set
    continued  whether it begins in the middle of a grasp whose first rows are the last of the stream before
    """

    subject: str
    session: str
    rows: NDArray[np.intp]
    start_us: int
    continued: bool = False


def newest(
    times_us: NDArray[np.int64], tick_us: int, movements: NDArray[np.intp] | None = None
) -> list[tuple[int, NDArray[np.intp]]]:
    """Return the stretches of n readings, as the time of the first tick and the newest reading (T,) at each tick.

    The times (n,) are in the order of arrival. A stretch ends where they jump by more than PAUSE_US, ahead or back, and
    where one of the `movements` (n,) begins on a clock that started again: by more than JITTER_US back, to before the
    middle of the movement before it. A clock that repeats a time, or jitters, ends none.
    """
    # As doubles, because the difference of two int64 can overflow.
    steps = np.diff(times_us.astype(np.float64))
    jumps = np.abs(steps) > PAUSE_US
    changes = jumps if movements is None else jumps | (np.diff(movements) != 0)
    begins, found = np.append(0, np.flatnonzero(changes) + 1), []
    later, step = begins[1:], steps[begins[1:] - 1]
    restarts = (step < -JITTER_US) & (times_us[later] < times_us[(begins[:-1] + later) // 2])
    cuts = later[restarts | (np.abs(step) > PAUSE_US)]
    for first, own in zip([0, *cuts.tolist()], np.split(times_us, cuts), strict=True):
        rising = _rising(own)
        ticks = np.arange(int(rising[0]), int(rising[-1]) + 1, tick_us)
        found.append((int(rising[0]), first + np.searchsorted(rising, ticks, side="right") - 1))
    return found


def _rising(times_us: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the nearest times (n,) that never fall: readings keep the order in which they arrived."""
    if not (np.diff(times_us) < 0).any():
        return times_us
    from scipy.optimize import isotonic_regression

    after = (times_us - times_us[0]).astype(np.float64)
    nearest: NDArray[np.int64] = times_us[0] + np.rint(isotonic_regression(after).x).astype(np.int64)
    return nearest


def moving(grasp_set: GraspSet) -> NDArray[np.bool_]:
    """Return (n,) which rows are part of a whole movement, rather than separate trials."""
    movements = grasp_set.movement_ids
    return np.asarray((np.bincount(movements, minlength=1)[movements] > 1) & (not grasp_set.independent))


def streams_of(grasp_set: GraspSet, tick_us: int = TICK_US) -> tuple[Stream, ...]:
    """Return the streams of a set, in the order of their first rows.

    A stream ends before a pause, and where the clock starts again. Rows that are separate trials, such as static
    grasps, belong to no stream. Raises SegmentingError if all rows do.
    """
    within = moving(grasp_set)
    if not within.any():
        raise SegmentingError(
            "each row of the set is a separate trial: segments need whole movements, as `thenar record` or "
            'scenes with rows = "all" make them'
        )
    owner, found = groups(grasp_set.subjects, grasp_set.sessions), []
    trials, movements, none = grasp_set.trial_ids, grasp_set.movement_ids, grasp_set.is_none
    for number in range(int(owner.max()) + 1):
        own = np.flatnonzero((owner == number) & within)
        if not len(own):
            continue
        times = grasp_set.times_us[own] if grasp_set.times_us.size else TICK_US * np.arange(len(own))
        subject, session = str(grasp_set.subjects[own[0]]), str(grasp_set.sessions[own[0]])
        before = -1
        for start_us, ticks in newest(times, tick_us, movements[own]):
            rows = own[ticks]
            continued = before >= 0 and trials[before] == trials[rows[0]] and not none[before]
            found.append(Stream(subject, session, rows, start_us, bool(continued)))
            before = rows[-1]
    return tuple(sorted(found, key=lambda stream: int(stream.rows[0])))
