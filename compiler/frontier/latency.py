"""Decision latency: the time from a hand's arrival in a grasp until `thenar run` decides on it.

The runtime's `Decision`, `SequentialTest` and `LiveSegments` decide on a stream, played at 1 kHz at most.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.live.decision import Decision, Ranking, SequentialTest
from thenar.runtime.policy import Policy
from thenar.runtime.scores import LANE_OFFSET
from thenar.runtime.segmenting.live import LiveSegments
from thenar.runtime.segmenting.model import SegmentModel
from thenar.runtime.tables import IntegerTables

from ..evaluation.folds import Rows
from ..placement.placement import InputSelection
from ..samples import Samples
from ..tables.quantise import integer_scores
from ..trainers.base import Training
from .cache import stored
from .points import DecisionKind, FrontierError, Latency
from .price import Tabled, tables_of
from .replay import Replay
from .segments import MovementSamples

NOTHING = -1
# The shortest time between two frames that are played.
LEAST_STEP_US = 1_000

# The deciding method: by candidates under a policy, or by segments, of a model (None: the default model).
Deciding = Policy | SegmentModel | None
# Takes a frame's time and standing; returns what is decided on, None for nothing.
Decide = Callable[[int, Ranking], int | None]


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
    """Return the frames, one every step_us from at_us[0] on, of states with scores (T, K)
    that begin at at_us[:-1]; at_us[-1] is the end.
    """
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
    decide = decider_of(tables, policy)
    changes: list[int] = []
    types: list[int | None] = []
    lanes = map(tuple, (frames.scores + LANE_OFFSET).tolist())
    for stretch, row in zip(frames.times, lanes, strict=True):
        standing = Ranking(row)
        for time_us in stretch:
            decided = decide(time_us, standing)
            if not types or decided != types[-1]:
                changes.append(time_us)
                types.append(decided)
    return Decisions(
        np.array(changes, np.int64) // frames.step_us,
        np.array([NOTHING if one is None else one for one in types], np.intp),
    )


def decider_of(tables: IntegerTables, policy: Deciding) -> Decide:
    """Return the live recogniser's decider under `policy`."""
    if policy is None or isinstance(policy, SegmentModel):
        return _by_segments(tables, policy)
    if policy.error_rate is None:
        return Decision(policy.lead_steps(tables.scale), policy.dwell_us, policy.hold_us).update
    test = SequentialTest(tables.n_classes, tables.scale, policy.error_rate, policy.hold_us, policy.spacing_us)
    return test.update


def _by_segments(tables: IntegerTables, model: SegmentModel | None) -> Decide:
    """Return the decider by segments of a model, None: the default, with the default lag: the held type."""
    model = model or SegmentModel.usual(tables.n_classes, has_none=False, scale=tables.scale)
    live = LiveSegments(model, [str(number) for number in range(tables.n_classes)], Policy().lag_us or 0)

    def decide(time_us: int, standing: Ranking) -> int | None:
        segment = live.update(time_us, standing.lanes)
        return None if segment.state == "forming" else segment.label

    return decide


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


@stored(8)
def latencies(
    samples: Samples,
    rows: Rows,
    selection: InputSelection,
    replay: Replay,
    paces: tuple[Pace, ...],
    training: Training,
    movements: MovementSamples | None = None,
) -> tuple[tuple[Latency, ...], ...]:
    """Train on some rows, on the selected inputs; return the latencies on a replay for every pace
    and each of POLICIES. The replay holds none of the rows.

    movements  the same rows with those in which nothing is held: segments use tables trained with these rows, and costs
               learnt from them. None: segments have the default costs
    """
    replay, columns = replay.reading(selection.kept, selection.joints), range(len(selection.kept))
    shapes = tuple(dict.fromkeys(pace.tabled for pace in paces))
    tables = {tabled: made for tabled, made, _ in tables_of(samples, rows, selection, shapes, training)}
    learnt = movements.segment_tables(selection, shapes, training) if movements else {}

    def of(pace: Pace, kind: DecisionKind) -> Latency:
        if kind == "segments" and pace.tabled in learnt:
            return latency(learnt[pace.tabled][0], columns, replay, pace.frame_us, learnt[pace.tabled][1])
        return latency(tables[pace.tabled], columns, replay, pace.frame_us, POLICIES[kind])

    return tuple(tuple(of(pace, kind) for kind in POLICIES) for pace in paces)


@dataclass(frozen=True, slots=True, eq=False)
class _Grasps:
    """Grasps (g,): when each was complete, and when it ended, in microseconds of the stream; and its class."""

    arrived_us: Times
    ended_us: Times
    types: NDArray[np.intp]


def latency(
    tables: IntegerTables, columns: Sequence[int], replay: Replay, frame_us: float, policy: Deciding
) -> Latency:
    """Return the latency of tables on a replay with one frame every frame_us, in integer microseconds; one every
    LEAST_STEP_US if frames are shorter.

    columns  the tables' switches as columns of the replay, in the tables' order; of its joints they take all, or none

    Only grasps whose type differs from the one before count: the same type may still be decided on from before.

    A frame shows the glove as it was when the frame began; its prediction is available at its end, frame_us later. A
    grasp's latency is the time from its arrival until the first prediction of its type, and at least a frame, which is
    also the latency of a grasp that was decided on while the hand was still closing. Grasps not predicted before they
    end are missed, and in neither number; if all are, both numbers are the duration of the longest. The 99th percentile
    is one of the latencies (nearest rank).

    Raises FrontierError if the tables are not for these inputs, the replay has no grasps, or a frame takes no time.
    """
    _check(tables, columns, replay, frame_us)
    takes_us = max(round(frame_us), 1)
    step_us = max(takes_us, LEAST_STEP_US)
    decided = decided_on(tables, columns, replay, step_us, policy)
    arrivals, ends, types = np.array(replay.grasps, np.intp).T
    another = np.concatenate([[True], types[1:] != types[:-1]])
    begun_us = _bounds_us(replay) - replay.stream.start_us
    grasps = _Grasps(begun_us[arrivals[another]], begun_us[ends[another]], types[another])
    predicted_us = decided.frames * step_us + takes_us
    return _measured(grasps, *_waits_and_errors(predicted_us, decided.types, grasps), takes_us)


def _bounds_us(replay: Replay) -> Times:
    """Return when each state begins, and the last ends (T + 1,)."""
    return np.append(replay.stream.at_us, np.int64(replay.stream.end_us))


def decided_on(
    tables: IntegerTables, columns: Sequence[int], replay: Replay, step_us: int, policy: Deciding
) -> Decisions:
    """Return the decisions under `policy` on a replay with a frame every step_us, the first at its start."""
    rows, codes = replay.stream.rows, replay.codes[:, : None if tables.n_joints else 0]
    scores = integer_scores(tables, replay.bits[rows][:, list(columns)], codes[rows])
    return decisions(tables, stretches(scores, _bounds_us(replay), step_us), policy)


def _waits_and_errors(predicted_us: Times, types: NDArray[np.intp], grasps: _Grasps) -> tuple[Times, Times]:
    """Return how long (g,) after arrival each grasp was first predicted rightly, -1 if not before its end; and for how
    much of its remaining time (g,) another type was predicted. From predicted_us[i] on types[i] is predicted.
    """
    standing = np.maximum(np.searchsorted(predicted_us, grasps.arrived_us, side="right") - 1, 0).tolist()
    beyond = np.searchsorted(predicted_us, grasps.ended_us, side="right").tolist()
    waits_us, wrong_us = np.full(len(grasps.types), -1, np.int64), np.zeros(len(grasps.types), np.int64)
    for grasp, (first, last, right) in enumerate(zip(standing, beyond, grasps.types.tolist(), strict=True)):
        predictions = types[first:last]
        hits = np.flatnonzero(predictions == right)
        if len(hits):
            since_us = np.maximum(predicted_us[first + hits[0] : last], grasps.arrived_us[grasp])
            waits_us[grasp] = since_us[0] - grasps.arrived_us[grasp]
            lasted_us = np.diff(since_us, append=grasps.ended_us[grasp])
            wrong_us[grasp] = lasted_us[~np.isin(predictions[hits[0] :], (right, NOTHING))].sum()
    return waits_us, wrong_us


def _measured(grasps: _Grasps, waits_us: Times, wrong_us: Times, step_us: int) -> Latency:
    lasted_us, predicted = grasps.ended_us - grasps.arrived_us, waits_us >= 0
    waits = np.sort(np.maximum(waits_us[predicted], step_us))
    if not len(waits):
        return Latency(float(lasted_us.max()), float(lasted_us.max()), 1.0)
    left_us = int((lasted_us - waits_us)[predicted].sum())
    return Latency(
        mean_us=int(waits.sum()) / len(waits),
        p99_us=float(waits[math.ceil(0.99 * len(waits)) - 1]),
        missed=(len(waits_us) - len(waits)) / len(waits_us),
        wrong=int(wrong_us.sum()) / left_us if left_us else 0.0,
    )


def _check(tables: IntegerTables, columns: Sequence[int], replay: Replay, frame_us: float) -> None:
    switches, joints = replay.bits.shape[1], replay.codes.shape[1]
    if tables.n_switches != len(columns) or tables.n_joints not in (0, joints):
        raise FrontierError(
            f"tables of {tables.n_switches} switches and {tables.n_joints} joints, for {len(columns)} and {joints}"
        )
    most = max((grasp.state for grasp in replay.grasps), default=NOTHING)
    if any(not 0 <= column < switches for column in columns) or most >= tables.n_classes:
        raise FrontierError(
            f"a stream of {switches} switches and types up to {most} does not fit these switches and "
            f"{tables.n_classes} types"
        )
    if not (math.isfinite(frame_us) and frame_us > 0):
        raise FrontierError(f"a frame of {frame_us} us: it must take some time")
    if not replay.grasps:
        raise FrontierError("the stream has no grasp that follows one of another type: there is no latency to measure")
