"""Decision latency: the time from a hand's arrival in a grasp until `thenar run` decides on it.

The runtime's `Decision`, `SequentialTest` and `LiveSegments` decide on a stream. In most of many equal frames in
succession a decider does nothing, so it is shown only those frames in which something can happen.
"""

import math
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Protocol

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.live.decision import Decision, SequentialTest, Standing
from thenar.runtime.policy import Policy
from thenar.runtime.scores import LANE_OFFSET
from thenar.runtime.segmenting.live import LiveSegments
from thenar.runtime.segmenting.model import SegmentModel
from thenar.runtime.tables import IntegerTables

from ..evaluation.folds import Rows
from ..samples import Columns, Samples
from ..tables.quantise import integer_scores
from ..trainers.base import Training
from .cache import stored
from .moving import Moving
from .points import DecisionKind, FrontierError, Latency
from .price import Tabled, tables_of
from .stream import Stream

NOTHING = -1
# Only with at least this many frames left is it worth computing how many of them decide nothing.
_WORTHWHILE = 4

# The deciding method: by candidates under a policy, or by segments, of a model (None: the default model).
Deciding = Policy | SegmentModel | None
# The decision from a frame's time on; None: nothing is decided.
Decided = tuple[int, int | None]


class Decider(Protocol):
    """Processes stretches of equal frames, one after the other."""

    def stay(self, times: range, standing: Standing) -> Iterator[Decided]:
        """Yield the decision at the first frame of a stretch, and again whenever it may have changed since."""


@dataclass(frozen=True, slots=True)
class Stretches:
    """Frames step_us apart in stretches without changes: stretch i is frames first[i] to first[i + 1] - 1, and its
    scores are scores[i] (K,); first has one more entry, the number of frames.
    """

    scores: NDArray[np.int32]
    first: NDArray[np.int64]
    step_us: int

    @property
    def times(self) -> Iterator[range]:
        """The times of the frames of each stretch, in microseconds; the first frame is at 0."""
        bounds = (self.first * self.step_us).tolist()
        return (range(a, b, self.step_us) for a, b in pairwise(bounds))


@dataclass(frozen=True, slots=True, eq=False)
class Decisions:
    """From frame frames[i] (c,) on class types[i] (c,) is decided on; NOTHING means no class."""

    frames: NDArray[np.int64]
    types: NDArray[np.intp]

    def at(self, frames: NDArray[np.int64]) -> NDArray[np.intp]:
        """Return the decisions at some frames, none before the first."""
        return self.types[np.searchsorted(self.frames, frames, side="right") - 1]


def stretches(scores: NDArray[np.int32], at_us: NDArray[np.int64], step_us: int) -> Stretches:
    """Return the frames, one every step_us from at_us[0] on, of states (T,) with scores (T, K); the last is the end."""
    due = -((at_us[0] - at_us) // step_us)
    seen = np.flatnonzero(due[1:] > due[:-1])
    alike = np.zeros(len(seen), np.bool_)
    alike[1:] = (scores[seen[1:]] == scores[seen[:-1]]).all(axis=1)
    kept = seen[~alike]
    return Stretches(scores[kept], np.append(due[kept], due[-1]), step_us)


def decisions(tables: IntegerTables, frames: Stretches, policy: Deciding) -> Decisions:
    """Return the decisions of `thenar run` under `policy` on these frames, each whole and seen once, by both devices at
    the same time; by segments: the held types.
    """
    decider = decider_of(tables, policy)
    found: list[Decided] = []
    lanes = map(tuple, (frames.scores + LANE_OFFSET).tolist())
    for stretch, row in zip(frames.times, lanes, strict=True):
        for time_us, held in decider.stay(stretch, Standing(row)):
            if not found or held != found[-1][1]:
                found.append((time_us, held))
    return Decisions(
        np.array([time_us // frames.step_us for time_us, _ in found], np.int64),
        np.array([NOTHING if held is None else held for _, held in found], np.intp),
    )


def decider_of(tables: IntegerTables, policy: Deciding) -> Decider:
    """Return the live recogniser's decider under `policy`."""
    if policy is None or isinstance(policy, SegmentModel):
        return _Segments(tables, policy)
    if policy.error_rate is None:
        return _Hysteresis(Decision(policy.lead_steps(tables.scale), policy.dwell_us, policy.hold_us))
    test = _Test(tables.n_classes, tables.scale, policy.error_rate, policy.hold_us, policy.spacing_us)
    return _Tests(test)


class _Segments:
    """Segments of a model, None: the default, with the default lag. Frames between two ticks change nothing."""

    def __init__(self, tables: IntegerTables, model: SegmentModel | None) -> None:
        model = model or SegmentModel.usual(tables.n_classes, has_none=False, scale=tables.scale)
        self._live = LiveSegments(model, [str(number) for number in range(tables.n_classes)], Policy().lag_us or 0)

    def stay(self, times: range, standing: Standing) -> Iterator[Decided]:
        """Yield the held type at the first frame of a stretch, and at each frame that takes a tick."""
        place = 0
        while place < len(times):
            found = self._live.update(times[place], standing.lanes)
            yield times[place], None if found.state == "forming" else found.label
            place = bisect_left(times, True, place + 1, key=self._live.due)


class _Hysteresis:
    """Within a stretch a decision changes only once: its candidate takes over, and stays for the rest."""

    def __init__(self, decision: Decision) -> None:
        self._decision = decision

    def stay(self, times: range, standing: Standing) -> Iterator[Decided]:
        """Yield the decision at the first frame of a stretch, and at the one that changes it."""
        decision = self._decision
        held = decision.update(times[0], standing)
        yield times[0], held
        if held != standing.candidate and self._changes(times[-1], standing):
            # Candidate and support are constant: once the time for a change has come, it stays.
            first = bisect_left(times, True, key=lambda time_us: self._changes(time_us, standing))
            yield times[first], decision.update(times[first], standing)
        decision.update(times[-1], standing)

    def _changes(self, time_us: int, standing: Standing) -> bool:
        """Whether the decision would change with a frame of this time, were it the next."""
        return copy(self._decision).update(time_us, standing) != self._decision.held


class _Test(SequentialTest):
    """A sequential test that reports when it waits, how long it will, and when it begins again."""

    __slots__ = ()

    @property
    def next_us(self) -> int:
        """The earliest time at which a frame counts again."""
        return 0 if self._counted_us is None else self._counted_us + max(self.spacing_us, 1)

    @property
    def stands_until_us(self) -> int:
        """The latest time of a frame with which the decision remains valid."""
        return self._decided_us + self.longest_us

    @property
    def goes_on_until_us(self) -> int:
        """The latest time of a frame that still belongs to the running test."""
        return self._began_us + self.longest_us

    def ended_at(self, time_us: int) -> bool:
        """Whether a test ended with the frame of this time."""
        return not self._sums and self._counted_us == time_us

    def quiet(self, lanes: tuple[int, ...], most: int) -> int:
        """Return after how many frames of these scores, up to `most`, the running test is still undecided."""
        best = lanes.index(max(lanes))
        # Only the frames' best class gains on all others, but the best of the sums may lead it by enough to end.
        if not self._sums or max(self._sums) - self._sums[best] >= self.threshold:
            return 0
        wanted = [self.threshold + total - self._sums[best] for total in self._sums]
        gains = [lanes[best] - lane for lane in lanes]
        del wanted[best], gains[best]
        # It ends with the first frame after which the best leads every other class by the threshold.
        pairs = zip(wanted, gains, strict=True)
        return max(min(most, (left - 1) // gain if gain else most) for left, gain in pairs if left > 0)


class _Tests:
    """Frames that do not count are skipped. Frames that decide nothing are added up at once. After two tests in a
    stretch with the same decision, each further one would repeat the second; whole numbers of them are skipped by
    setting the clock back: a test only depends on elapsed time.
    """

    def __init__(self, test: _Test) -> None:
        self._test = test
        self._back_us = 0

    def stay(self, times: range, standing: Standing) -> Iterator[Decided]:
        """Yield the decision at the first frame of a stretch, and again whenever it may have changed since."""
        place, frames = 0, 1
        ended: tuple[int, int | None] | None = None  # the last test that ended here, and its decision while valid
        while place < len(times):
            held = self._test.update(times[place] - self._back_us, self._summed(standing, frames))
            yield times[place], held
            if held is None:
                ended = None
            elif self._test.ended_at(times[place] - self._back_us):
                if ended is not None and ended[1] == held:
                    place += self._leave_out(times[place:], place - ended[0])
                ended = place, held
            after, frames = self._next(times, place, standing)
            expired = self._expired(times[place + 1 : after])
            if expired is not None:
                yield expired, None
                ended = None
            place = after

    def _summed(self, standing: Standing, frames: int) -> Standing:
        """Return the sum of `frames` equal frames."""
        return standing if frames == 1 else Standing(tuple(frames * lane for lane in standing.lanes))

    def _leave_out(self, left: range, frames: int) -> int:
        """Skip all whole tests of `frames` frames within `left`; return their total number of frames."""
        whole = (len(left) - 1) // frames * frames
        self._back_us += whole * left.step
        return whole

    def _next(self, times: range, place: int, standing: Standing) -> tuple[int, int]:
        """Return the position of the next frame to process, past the last if it is in a later stretch, and how many
        frames it represents: itself, and the counting frames before it that decide nothing.
        """
        if self._test.spacing_us <= times.step and place + _WORTHWHILE >= len(times):
            return place + 1, 1
        counts = self._place(times, self._test.next_us, up=True)
        counts = min(max(counts, place + 1), len(times))
        apart = max(-(-self._test.spacing_us // times.step), 1)
        last = min(self._place(times, self._test.goes_on_until_us), len(times) - 1)
        most = (last - counts) // apart + 1
        frames = self._test.quiet(standing.lanes, most) if most >= _WORTHWHILE else 1
        return (counts + (frames - 1) * apart, frames) if frames > 1 else (counts, 1)

    def _expired(self, idle: range) -> int | None:
        """Return the first of some idle frames (not counting, or undecided) at which a decision has expired."""
        if not idle or self._test.held is None:
            return None
        gone = max(self._place(idle, self._test.stands_until_us) + 1, 0)
        return idle[gone] if gone < len(idle) else None

    def _place(self, times: range, test_us: int, *, up: bool = False) -> int:
        """Return the position of the last frame up to a time of the test's clock, or with `up` of the first from it on;
        positions continue beyond the given frames at both ends.
        """
        since_us = test_us + self._back_us - times[0]
        return -(-since_us // times.step) if up else since_us // times.step


Times = NDArray[np.int64]

# The policies of `thenar run`.
POLICIES: Mapping[DecisionKind, Policy | None] = MappingProxyType(
    {
        "single": Policy(lead=0.0, dwell_us=0),
        "dwell": Policy(),
        "sequential": Policy(dwell_us=0, error_rate=0.01),
        "segments": None,
    }
)


class Pace(Struct, frozen=True):
    """Tables that predict every `frame_us`."""

    tabled: Tabled
    frame_us: float


@stored(6)
def latencies(
    samples: Samples,
    rows: Rows,
    columns: Columns,
    stream: Stream,
    paces: tuple[Pace, ...],
    training: Training,
    moving: Moving | None = None,
) -> tuple[tuple[Latency, ...], ...]:
    """Train on some rows, on the switches `columns` and the joints; return the latencies on a stream for every pace
    and each of POLICIES. The stream holds none of the rows.

    moving  the same rows with those in which nothing is held: segments use tables trained with these rows, and costs
            learnt from them. None: segments have the default costs
    """
    wanted = tuple(dict.fromkeys(pace.tabled for pace in paces))
    tables = {tabled: made for tabled, made, _ in tables_of(samples, rows, columns, wanted, training)}
    learnt = moving.segmenting(columns, wanted, training) if moving else {}

    def of(pace: Pace, kind: DecisionKind) -> Latency:
        if kind == "segments" and pace.tabled in learnt:
            return latency(learnt[pace.tabled][0], columns, stream, pace.frame_us, learnt[pace.tabled][1])
        return latency(tables[pace.tabled], columns, stream, pace.frame_us, POLICIES[kind])

    return tuple(tuple(of(pace, kind) for kind in POLICIES) for pace in paces)


@dataclass(frozen=True, slots=True, eq=False)
class _Held:
    """Grasps (g,): when each was complete, and when it ended, in microseconds of the stream; and its class."""

    arrived_us: Times
    ended_us: Times
    types: NDArray[np.intp]


def latency(
    tables: IntegerTables, columns: Sequence[int], stream: Stream, frame_us: float, policy: Deciding
) -> Latency:
    """Return the latency of tables on a stream with one frame every frame_us, in integer microseconds.

    columns  the tables' switches as columns of the stream, in the tables' order; of its joints they take all, or none

    A frame shows the glove as it was when the frame began; its prediction is available at its end, frame_us later. A
    grasp's latency is the time from its arrival until the first prediction of its type, and at least a frame, which is
    also the latency of a grasp that was decided on while the hand was still closing. Grasps not predicted before they
    end are missed, and in neither number; if all are, both numbers are the duration of the longest. The 99th percentile
    is one of the latencies (nearest rank).

    Raises FrontierError if the tables are not for these inputs, the stream has no grasps, or a frame takes no time.
    """
    _check(tables, columns, stream, frame_us)
    step_us = max(round(frame_us), 1)
    decided = decided_on(tables, columns, stream, step_us, policy)
    begun_us = stream.at_us - stream.at_us[0]
    held = _Held(begun_us[stream.arrivals], begun_us[stream.ends], stream.types[stream.arrivals])
    predicted_us = (decided.frames + 1) * step_us
    return _measured(held, *_waits_and_errors(predicted_us, decided.types, held), step_us)


def decided_on(
    tables: IntegerTables, columns: Sequence[int], stream: Stream, step_us: int, policy: Deciding
) -> Decisions:
    """Return the decisions under `policy` on a stream with a frame every step_us, the first at the stream's start."""
    codes = stream.codes[:, : None if tables.n_joints else 0]
    scores = integer_scores(tables, stream.bits[:, list(columns)], codes)
    return decisions(tables, stretches(scores, stream.at_us, step_us), policy)


def _waits_and_errors(predicted_us: Times, types: NDArray[np.intp], held: _Held) -> tuple[Times, Times]:
    """Return how long (g,) after arrival each grasp was first predicted rightly, -1 if not before its end; and for how
    much of its remaining time (g,) another type was predicted. From predicted_us[i] on types[i] is predicted.
    """
    standing = np.maximum(np.searchsorted(predicted_us, held.arrived_us, side="right") - 1, 0).tolist()
    beyond = np.searchsorted(predicted_us, held.ended_us, side="right").tolist()
    waits_us, wrong_us = np.full(len(held.types), -1, np.int64), np.zeros(len(held.types), np.int64)
    for grasp, (first, last, right) in enumerate(zip(standing, beyond, held.types.tolist(), strict=True)):
        predictions = types[first:last]
        found = np.flatnonzero(predictions == right)
        if len(found):
            since_us = np.maximum(predicted_us[first + found[0] : last], held.arrived_us[grasp])
            waits_us[grasp] = since_us[0] - held.arrived_us[grasp]
            lasted_us = np.diff(since_us, append=held.ended_us[grasp])
            wrong_us[grasp] = lasted_us[~np.isin(predictions[found[0] :], (right, NOTHING))].sum()
    return waits_us, wrong_us


def _measured(held: _Held, waits_us: Times, wrong_us: Times, step_us: int) -> Latency:
    lasted_us, predicted = held.ended_us - held.arrived_us, waits_us >= 0
    found = np.sort(np.maximum(waits_us[predicted], step_us))
    if not len(found):
        return Latency(float(lasted_us.max()), float(lasted_us.max()), 1.0)
    left_us = int((lasted_us - waits_us)[predicted].sum())
    return Latency(
        mean_us=int(found.sum()) / len(found),
        p99_us=float(found[math.ceil(0.99 * len(found)) - 1]),
        missed=(len(waits_us) - len(found)) / len(waits_us),
        wrong=int(wrong_us.sum()) / left_us if left_us else 0.0,
    )


def _check(tables: IntegerTables, columns: Sequence[int], stream: Stream, frame_us: float) -> None:
    switches, joints = stream.bits.shape[1], stream.codes.shape[1]
    if tables.n_switches != len(columns) or tables.n_joints not in (0, joints):
        raise FrontierError(
            f"tables of {tables.n_switches} switches and {tables.n_joints} joints, for {len(columns)} and {joints}"
        )
    if any(not 0 <= column < switches for column in columns) or stream.types.max(initial=-1) >= tables.n_classes:
        raise FrontierError(
            f"a stream of {switches} switches and types up to {stream.types.max(initial=-1)} does not fit these "
            f"switches and {tables.n_classes} types"
        )
    if not (math.isfinite(frame_us) and frame_us > 0):
        raise FrontierError(f"a frame of {frame_us} us: it must take some time")
    if not len(stream.arrivals):
        raise FrontierError("the stream has no grasp that follows one of another type: there is no latency to measure")
