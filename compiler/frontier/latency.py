"""How long after a hand has arrived in a grasp `thenar run` has decided on it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.policy import Policy
from thenar.runtime.tables import IntegerTables

from ..evaluation.folds import Rows
from ..samples import Columns, Samples
from ..tables.quantise import integer_scores
from ..trainers.base import Training
from .cache import stored
from .deciders import NOTHING, Decisions, decisions, stretches
from .points import DecisionKind, FrontierError, Latency
from .price import Tabled, tables_of
from .stream import Stream

Times = NDArray[np.int64]

# What `thenar run` does under each. Scans that end early decide alike.
POLICIES: Mapping[DecisionKind, Policy] = MappingProxyType(
    {"single": Policy(lead=0.0, dwell_us=0), "dwell": Policy(), "sequential": Policy(dwell_us=0, error_rate=0.01)}
)


class Pace(Struct, frozen=True):
    """Tables that answer every `frame_us`, and the ways to decide on what they answer."""

    tabled: Tabled
    frame_us: float
    decisions: tuple[DecisionKind, ...]


@stored(1)
def latencies(
    samples: Samples, rows: Rows, columns: Columns, stream: Stream, paces: tuple[Pace, ...], training: Training
) -> tuple[tuple[Latency, ...], ...]:
    """Train on some rows, on the switches `columns` and the joints; return how long a stream keeps one waiting at every
    pace, for each of its decisions. The stream holds none of the rows.
    """
    wanted = tuple(dict.fromkeys(pace.tabled for pace in paces))
    tables = {tabled: made for tabled, made, _ in tables_of(samples, rows, columns, wanted, training)}
    return tuple(
        tuple(latency(tables[pace.tabled], columns, stream, pace.frame_us, POLICIES[kind]) for kind in pace.decisions)
        for pace in paces
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Held:
    """Grasps (g,): when each was complete, and when no longer, in microseconds of the stream; and its class."""

    arrived_us: Times
    ended_us: Times
    types: NDArray[np.intp]


def latency(tables: IntegerTables, columns: Sequence[int], stream: Stream, frame_us: float, policy: Policy) -> Latency:
    """Return the latency of tables on a stream whose frames follow one another every frame_us, in whole microseconds.

    columns  the stream's switches that the tables take, in their order; of its joints they take all, or none

    A frame shows the glove as it was when the frame began; its answer is there when it ends, frame_us later. A grasp's
    latency is the time from its arrival until the first answer that is its type, 0 where that was the answer already,
    decided on while the hand was still closing. Grasps without one before they end are missed, and in neither number;
    if all are, both numbers are how long the longest lasted. The 99th percentile is one of the latencies (nearest
    rank).

    Raises FrontierError where the tables are not for these inputs, the stream has no grasps, or no frame takes a time.
    """
    _check(tables, columns, stream, frame_us)
    step_us = max(round(frame_us), 1)
    decided = decided_on(tables, columns, stream, step_us, policy)
    begun_us = stream.at_us - stream.at_us[0]
    held = _Held(begun_us[stream.arrivals], begun_us[stream.ends], stream.types[stream.arrivals])
    return _measured(held, *_waits_and_errors(decided, step_us, held))


def decided_on(
    tables: IntegerTables, columns: Sequence[int], stream: Stream, step_us: int, policy: Policy
) -> Decisions:
    """Return what is decided under `policy` on a stream whose frames begin every step_us, the first with the stream."""
    codes = stream.codes[:, : None if tables.n_joints else 0]
    scores = integer_scores(tables, stream.bits[:, list(columns)], codes)
    return decisions(tables, stretches(scores, stream.at_us, step_us), policy)


def _waits_and_errors(decided: Decisions, step_us: int, held: _Held) -> tuple[Times, Times]:
    """Return how long (g,) after arrival each grasp was first answered rightly, -1 where it was not before its end; and
    how long of what was left of it then (g,) another type was the answer. The answer of frame n is there at
    (n + 1) * step_us.
    """
    answered_us = (decided.frames + 1) * step_us
    standing = np.maximum(np.searchsorted(answered_us, held.arrived_us, side="right") - 1, 0).tolist()
    beyond = np.searchsorted(answered_us, held.ended_us, side="right").tolist()
    waits_us, wrong_us = np.full(len(held.types), -1, np.int64), np.zeros(len(held.types), np.int64)
    for grasp, (first, last, right) in enumerate(zip(standing, beyond, held.types.tolist(), strict=True)):
        answers = decided.types[first:last]
        found = np.flatnonzero(answers == right)
        if len(found):
            since_us = np.maximum(answered_us[first + found[0] : last], held.arrived_us[grasp])
            waits_us[grasp] = since_us[0] - held.arrived_us[grasp]
            lasted_us = np.diff(since_us, append=held.ended_us[grasp])
            wrong_us[grasp] = lasted_us[~np.isin(answers[found[0] :], (right, NOTHING))].sum()
    return waits_us, wrong_us


def _measured(held: _Held, waits_us: Times, wrong_us: Times) -> Latency:
    lasted_us, answered = held.ended_us - held.arrived_us, waits_us >= 0
    found = np.sort(waits_us[answered])
    if not len(found):
        return Latency(float(lasted_us.max()), float(lasted_us.max()), 1.0)
    left_us = int((lasted_us - waits_us)[answered].sum())
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
            f"a stream of {switches} switches and types up to {stream.types.max(initial=-1)} is not for these switches "
            f"and {tables.n_classes} types"
        )
    if not (math.isfinite(frame_us) and frame_us > 0):
        raise FrontierError(f"a frame of {frame_us} us: it takes some time")
    if not len(stream.arrivals):
        raise FrontierError("the stream has no grasp that follows one of another type: there is no latency to measure")
