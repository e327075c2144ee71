"""Movements and streams: which rows of a set belong together, and when each is shown.

A movement is a trial, and the rows without a grasp around it (`GraspSet.movement_ids`), as far as they follow one
another in the recording. It takes two rows: a row alone is a separate trial, as in sets of static grasps.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..arrays import groups
from ..placement.elements import above, elements_of
from ..recordings import RecordingError
from ..recordings.graspset import GraspSet
from ..samples import Samples

Rows = NDArray[np.intp]
Bits = NDArray[np.bool_]
Codes = NDArray[np.uint16]
Times = NDArray[np.int64]

TICK_US = 10_000  # also between consecutive rows if times are unknown
# A longer pause ends a stream: the grasp before it carries no information about the one after it.
PAUSE_US = 1_000_000
# A clock that falls by no more than this jitters; no movement is as short.
JITTER_US = 100_000
# Fewer frames than these do not show when a grasp is complete: a tenth of a second at the rate of a CyberGlove.
LEAST_FRAMES = 10
# Neighbouring frames differ by less than this share of the difference between frames half a movement apart.
_ALIKE = 0.5
# A hold continues if a contact's bounce interrupts it for at most these frames.
_BRIDGED = 2


@dataclass(frozen=True, slots=True, eq=False)
class Movements:
    """m movements: movement i is the rows `rows[first[i] : beyond[i]]` of a set, in the order of time.

    rows           (n,)  all rows of the set, subject by subject and session by session
    first, beyond  (m,)  places in `rows`
    """

    rows: Rows
    first: Rows
    beyond: Rows

    def __len__(self) -> int:
        return len(self.first)

    @property
    def sizes(self) -> Rows:
        """The number of rows of each movement (m,)."""
        return self.beyond - self.first

    @property
    def inside(self) -> Bits:
        """Whether each row of the set (n,) is part of a movement."""
        mask = np.zeros(len(self.rows), np.bool_)
        for run in self.runs:
            mask[run] = True
        return mask

    @property
    def runs(self) -> list[Rows]:
        """The rows of each movement (m,), in the order of time."""
        return [self.rows[a:b] for a, b in zip(self.first.tolist(), self.beyond.tolist(), strict=True)]

    def counts(self, mask: Bits) -> Rows:
        """Return how many rows of each movement (m,) are set in `mask` (n,)."""
        before = np.concatenate([[0], np.cumsum(mask[self.rows], dtype=np.intp)])
        return np.asarray(before[self.beyond] - before[self.first])

    def pick(self, chosen: Rows | Bits) -> "Movements":
        """Return some of the movements, by number or by mask (m,)."""
        return Movements(self.rows, self.first[chosen], self.beyond[chosen])


def movements_of(grasp_set: GraspSet) -> Movements:
    """Return the movements of a set, in the order of their first rows; none if its rows are independent."""
    order = np.argsort(groups(grasp_set.subjects, grasp_set.sessions), kind="stable")
    edges = np.flatnonzero(np.diff(grasp_set.movement_ids[order], prepend=-1, append=-1))
    several = np.flatnonzero(np.diff(edges) > 1)
    first, beyond = edges[several], edges[several + 1]
    in_order = np.argsort(order[first], kind="stable")
    return Movements(order, first[in_order], beyond[in_order])


def frames_are_dense(grasp_set: GraspSet) -> bool:
    """Return whether the rows of a set are the frames of movements, recorded fast enough to measure latencies on them.

    Two conditions hold then. Most rows lie in movements of at least LEAST_FRAMES rows. And within these, neighbouring
    rows are less than half as different as rows half a movement apart, in switches, joints and taxels. Single trials
    recorded without trial numbers are not dense: each differs from the next as much as from any other.
    """
    movements = movements_of(grasp_set)
    movements = movements.pick(movements.sizes >= LEAST_FRAMES)
    if 2 * movements.sizes.sum() <= len(grasp_set):
        return False
    differences = []
    for array in (grasp_set.switches, grasp_set.codes, grasp_set.taxels):
        near = far = 0.0
        for run in movements.runs if array.shape[1] else ():
            values, half = array[run].astype(np.int32), len(run) // 2
            near += float(np.abs(values[1:] - values[:-1]).mean())
            far += float(np.abs(values[half:] - values[:-half]).mean())
        differences.append((near, far))
    return any(far for _, far in differences) and all(near <= _ALIKE * far for near, far in differences)


def holds_of(grasp_set: GraspSet, movements: Movements) -> tuple[Rows, Rows]:
    """Return the first frame in which the grasp of each movement (m,) is complete, and the first after it (m,).

    They are counted from the movement's first. A grasp is complete while the labels say so; in a set without labels
    for nothing held, `hold_of` decides. A taxel is closed if it is pressed beyond the threshold with most information
    about the grasp type.
    """
    none = grasp_set.is_none
    if none.any():
        holds = [_longest(~none[run]) for run in movements.runs]
    else:
        switches = _closed(grasp_set)
        holds = [hold_of(switches[run], grasp_set.codes[run]) for run in movements.runs]
    complete, released = np.array(holds, np.intp).reshape(-1, 2).T
    return complete, released


def hold_of(switches: Bits, codes: Codes) -> tuple[int, int]:
    """Return the first frame in which the grasp of one movement (F, s), (F, j) is complete, and the first after it.

    It is complete while at least as many switches are closed as are for a tenth of the movement, and while the joints
    are near their median pose in such frames, within twice the median distance (noise); of several such stretches the
    longest. If no switch closes, the pose is the median of all frames: the hand must have held for at least half of
    them.
    """
    closed = switches.sum(axis=1)
    complete: Bits = closed >= np.sort(closed)[-max(len(closed) // 10, 1)]
    if codes.shape[1]:
        away = np.abs(codes - np.median(codes[complete], axis=0)).mean(axis=1)
        complete &= away <= 2.0 * np.median(away[complete]) + 0.5  # half a code, for hands without noise
    return _longest(complete)


def _closed(grasp_set: GraspSet) -> Bits:
    """Return which switches and taxels (n, s + t) are closed."""
    if not grasp_set.taxel_columns:
        return grasp_set.switches
    bits = above(grasp_set.switches, grasp_set.taxels, elements_of(Samples.of(grasp_set), 1))
    bits[:, len(grasp_set.switch_names) :] ^= [taxel.step < 0 for taxel in grasp_set.taxel_columns]
    return bits


def _longest(complete: Bits) -> tuple[int, int]:
    """Return the longest stretch of True (F,), short gaps bridged; of several the first."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], complete, [False]]).astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    apart = np.flatnonzero(starts[1:] - stops[:-1] > _BRIDGED)
    starts, stops = starts[np.concatenate([[0], apart + 1])], stops[np.concatenate([apart, [len(stops) - 1]])]
    best = int(np.argmax(stops - starts))
    return int(starts[best]), int(stops[best])


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """Rows in time, in the order in which a live glove sends them: T states, each shown until the next.

    rows       (T,)        the row shown in each state, by its number among the rows that come with the stream
    at_us      (T,) int64  when each state begins, never falling
    end_us     when the last one ends
    subject, session       of the recording
    continued  whether it begins in the middle of a grasp whose first rows are the last of the stream before
    """

    rows: Rows
    at_us: Times
    end_us: int
    subject: str = ""
    session: str = ""
    continued: bool = False

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def start_us(self) -> int:
        """The time of the first state."""
        return int(self.at_us[0])

    def part(self, first: int, beyond: int) -> "Stream":
        """Return the states `first` to `beyond` - 1."""
        end_us = self.end_us if beyond == len(self) else int(self.at_us[beyond])
        return Stream(self.rows[first:beyond], self.at_us[first:beyond], end_us, self.subject, self.session)


def streams_of(grasp_set: GraspSet, tick_us: int = TICK_US) -> tuple[Stream, ...]:
    """Return the streams of a set, each of one subject in one session, in the order of their first rows.

    A state lasts a tick and shows the newest row. A stream ends before a pause, and where the clock starts again. Rows
    outside of movements, such as static grasps, belong to no stream. Raises RecordingError if all rows do.
    """
    inside = movements_of(grasp_set).inside
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
            rows, at_us = recording[ticks], start_us + tick_us * np.arange(len(ticks) + 1)
            continued = bool(before >= 0 and trials[before] == trials[rows[0]] and not none[before])
            streams.append(Stream(rows, at_us[:-1], int(at_us[-1]), subject, session, continued))
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
