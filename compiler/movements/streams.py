"""Movements and streams: which rows of a set belong together, and when each is shown.

A movement is a trial, and the rows without a grasp around it (`GraspSet.movement_ids`), as far as they follow one
another in the recording. It takes two rows: a row alone is a separate trial, as in sets of static grasps.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..arrays import groups
from ..recordings import RecordingError
from ..recordings.graspset import GraspSet

Rows = NDArray[np.intp]
Bits = NDArray[np.bool_]
Times = NDArray[np.int64]

TICK_US = 10_000  # also between consecutive rows if times are unknown
# A longer pause ends a stream: the grasp before it carries no information about the one after it.
PAUSE_US = 1_000_000
# A clock that falls by no more than this jitters; no movement is as short.
JITTER_US = 100_000


def in_movements(grasp_set: GraspSet) -> Bits:
    """Return whether each row (n,) is part of a movement; none is if the rows are independent."""
    order = np.argsort(groups(grasp_set.subjects, grasp_set.sessions), kind="stable")
    numbers, inside = grasp_set.movement_ids[order], np.zeros(len(order), np.bool_)
    inside[order] = (np.diff(numbers, prepend=-1) == 0) | (np.diff(numbers, append=-1) == 0)
    return inside


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """Rows in time, in the order in which a live glove sends them: one for each of T ticks.

    rows       (T,) the newest row at each tick, by its number among the rows that come with the stream
    start_us   the time of the first tick
    subject, session  of the recording
    continued  whether it begins in the middle of a grasp whose first rows are the last of the stream before
    """

    rows: Rows
    start_us: int
    subject: str
    session: str
    continued: bool


def streams_of(grasp_set: GraspSet, tick_us: int = TICK_US) -> tuple[Stream, ...]:
    """Return the streams of a set, each of one subject in one session, in the order of their first rows.

    A stream ends before a pause, and where the clock starts again. Rows outside of movements, such as static grasps,
    belong to no stream. Raises RecordingError if all rows do.
    """
    inside = in_movements(grasp_set)
    if not inside.any():
        raise RecordingError(
            "each row of the set is a separate trial: segments need whole movements, as `thenar record` or "
            'scenes with rows = "all" make them'
        )
    owner, streams = groups(grasp_set.subjects, grasp_set.sessions), []
    trials, movements, none = grasp_set.trial_ids, grasp_set.movement_ids, grasp_set.is_none
    for number in range(int(owner.max()) + 1):
        recording = np.flatnonzero((owner == number) & inside)
        if not len(recording):
            continue
        times_us = grasp_set.times_us[recording] if grasp_set.times_us.size else TICK_US * np.arange(len(recording))
        subject, session = str(grasp_set.subjects[recording[0]]), str(grasp_set.sessions[recording[0]])
        before = -1
        for start_us, ticks in newest(times_us, tick_us, movements[recording]):
            rows = recording[ticks]
            continued = bool(before >= 0 and trials[before] == trials[rows[0]] and not none[before])
            streams.append(Stream(rows, start_us, subject, session, continued))
            before = rows[-1]
    return tuple(sorted(streams, key=lambda stream: int(stream.rows[0])))


def newest(times_us: Times, tick_us: int, movements: Rows | None = None) -> list[tuple[int, Rows]]:
    """Return the stretches of n readings, as the time of the first tick and the newest reading (T,) at each tick.

    The times (n,) are in the order of arrival. A stretch ends where they jump by more than PAUSE_US, ahead or back, and
    where one of the `movements` (n,) begins on a clock that started again: by more than JITTER_US back, to before the
    middle of the movement before it. A clock that repeats a time, or jitters, ends none.
    """
    # As doubles, because the difference of two int64 can overflow.
    steps = np.diff(times_us.astype(np.float64))
    jumps = np.abs(steps) > PAUSE_US
    changes = jumps if movements is None else jumps | (np.diff(movements) != 0)
    begins, stretches = np.append(0, np.flatnonzero(changes) + 1), []
    later, step = begins[1:], steps[begins[1:] - 1]
    restarts = (step < -JITTER_US) & (times_us[later] < times_us[(begins[:-1] + later) // 2])
    cuts = later[restarts | (np.abs(step) > PAUSE_US)].tolist()
    for first, beyond in pairwise([0, *cuts, len(times_us)]):
        rising = _rising(times_us[first:beyond])
        ticks = np.arange(int(rising[0]), int(rising[-1]) + 1, tick_us)
        stretches.append((int(rising[0]), first + np.searchsorted(rising, ticks, side="right") - 1))
    return stretches


def _rising(times_us: Times) -> Times:
    """Return the nearest times (n,) that never fall: readings keep the order in which they arrived."""
    if not (np.diff(times_us) < 0).any():
        return times_us
    from scipy.optimize import isotonic_regression

    after = (times_us - times_us[0]).astype(np.float64)
    nearest: Times = times_us[0] + np.rint(isotonic_regression(after).x).astype(np.int64)
    return nearest
