"""Decision latency: the time from a hand's arrival in a grasp until `thenar run` decides on it.

The runtime's `Decision` and `LiveSegments` decide on a stream, played at 1 kHz at most. Segments are
trained on whole movements: tables with a class for nothing held, and the costs of segments with them.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.live.decision import Decision, Ranking
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.policy import Policy
from thenar.runtime.recipe import Recipe
from thenar.runtime.scores import LANE_OFFSET
from thenar.runtime.segmenting.decoder import LiveSegments
from thenar.runtime.segmenting.model import SegmentModel

from ..evaluation.folds import Rows, leave_groups_out, trial_folds
from ..movements.segments import learnt
from ..movements.streams import TICK_US, Stream, Times, streams_of
from ..placement.placement import InputSelection
from ..recordings import RecordingError
from ..recordings.graspset import GraspSet
from ..samples import Samples
from ..trainers.base import Training
from .cache import stored
from .points import DecisionKind, FrontierError, Latency
from .price import tables_of
from .replay import Replay

NOTHING = -1
# The shortest time between two frames that are played.
LEAST_STEP_US = 1_000

# The deciding method: by candidates under a policy, or by segments, of a model (None: the default model).
Deciding = Policy | SegmentModel | None
# Takes a frame's time and standing; returns what is decided on, None for nothing.
Decide = Callable[[int, Ranking], int | None]
# Rows of movements, with those in which nothing is held, and their streams.
Movements = tuple[Samples, tuple[Stream, ...]]

# The policies of `thenar run`.
POLICIES: Mapping[DecisionKind, Policy | None] = MappingProxyType(
    {
        "single": Policy(lead=0.0, dwell_us=0),
        "dwell": Policy(),
        "segments": None,
    }
)


@stored(10)
def latencies(
    samples: Samples,
    rows: Rows,
    selection: InputSelection,
    replay: Replay,
    frames: tuple[tuple[Recipe, float], ...],
    training: Training,
    movements: Movements | None = None,
    seed: int = 1,
) -> tuple[tuple[Latency, ...], ...]:
    """Train on some rows, on the selected inputs; return the latencies on a replay for the tables of each recipe, with
    its frame time in microseconds, and each of POLICIES. The replay holds none of the rows.

    movements  the same rows with those in which nothing is held: segments use tables trained with these rows, and costs
               learnt from them. None: segments have the default costs; seed: of the folds for that
    """
    replay = replay.reading(selection.kept, selection.joints)
    recipes = tuple(dict.fromkeys(recipe for recipe, _ in frames))
    tables = dict(tables_of(samples, rows, selection, recipes, training))
    segments = segment_tables(movements, seed, selection, recipes, training) if movements else {}

    def of(recipe: Recipe, frame_us: float, kind: DecisionKind) -> Latency:
        if kind == "segments" and recipe in segments:
            made, model = segments[recipe]
            return latency(made, replay, frame_us, model)
        return latency(tables[recipe], replay, frame_us, POLICIES[kind])

    return tuple(tuple(of(recipe, frame_us, kind) for kind in POLICIES) for recipe, frame_us in frames)


def movements_of(grasp_set: GraspSet, rows: Rows) -> Movements | None:
    """Return the movements of some of the rows with a grasp; None if the set has no streams, or all rows have one.

    A stream goes from one of these movements to the next only if no other lies between them.
    """
    none = grasp_set.is_none
    try:
        recorded = streams_of(grasp_set) if none.any() else ()
    except RecordingError:
        return None
    movements = grasp_set.movement_ids
    inside = np.isin(movements, movements[np.flatnonzero(~none)[rows]])
    if not (none & inside).any():
        return None
    place, streams = np.cumsum(inside) - 1, list[Stream]()
    for stream in recorded:
        cuts = (np.flatnonzero(np.diff(inside[stream.rows])) + 1).tolist()
        parts = [stream.part(*ends) for ends in pairwise([0, *cuts, len(stream)])]
        streams += [replace(part, rows=place[part.rows]) for part in parts if inside[part.rows[0]]]
    return Samples.of(grasp_set).rows(inside), tuple(streams)


def segment_tables(
    movements: Movements, seed: int, selection: InputSelection, recipes: Sequence[Recipe], training: Training
) -> dict[Recipe, tuple[IntegerTables, SegmentModel]]:
    """Return tables of these rows with a class for nothing held, and the costs of segments, for each recipe.

    The costs are selected on the scores of two folds of these rows, which split no movement, and no subject if there
    are several.
    """
    samples, streams = movements
    if np.ptp(samples.subjects):
        folds = leave_groups_out(samples.subjects, "subject", 2)
    else:
        folds = trial_folds(samples.labels, samples.movements, 2, seed)
    scores = {recipe: np.zeros((len(samples.labels), samples.n_classes)) for recipe in recipes}
    for fold in folds:
        test = selection.read(samples.rows(fold.test))
        for recipe, made in tables_of(samples, fold.train, selection, recipes, training):
            scores[recipe][fold.test] = made.scores(test.switches, test.codes) / made.scale
    return {
        recipe: (made, learnt(streams, samples.labels, scores[recipe], samples.n_types, made.scale, TICK_US))
        for recipe, made in tables_of(samples, np.arange(len(samples.labels)), selection, recipes, training)
    }


def latency(tables: IntegerTables, replay: Replay, frame_us: float, policy: Deciding) -> Latency:
    """Return the latency of tables on a replay with one frame every frame_us, in integer microseconds; one every
    LEAST_STEP_US if frames are shorter. The tables take all switches of the replay, and all of its joints or none.

    Only grasps whose type differs from the one before count: the same type may still be decided on from before.

    A frame shows the glove as it was when the frame began; its prediction is available at its end, frame_us later. A
    grasp's latency is the time from its arrival until the first prediction of its type, and at least a frame, which is
    also the latency of a grasp that was decided on while the hand was still closing. Grasps not predicted before they
    end are missed, and in neither number; if all are, both numbers are the duration of the longest. The 99th percentile
    is one of the latencies (nearest rank).

    Raises FrontierError if the tables are not for these inputs, the replay has no grasps, or a frame takes no time.
    """
    _check(tables, replay, frame_us)
    takes_us = max(round(frame_us), 1)
    step_us = max(takes_us, LEAST_STEP_US)
    frames, types = decided_on(tables, replay, step_us, policy)
    # From predicted_us[i] on types[i] is predicted.
    predicted_us = frames * step_us + takes_us
    counted = list(_grasps(replay))
    standing = np.searchsorted(predicted_us, [arrived_us for arrived_us, _, _ in counted], side="right") - 1
    beyond = np.searchsorted(predicted_us, [ended_us for _, ended_us, _ in counted], side="right")
    waits_us, wrong_us, left_us = list[int](), 0, 0
    for (arrived_us, ended_us, right), first, last in zip(
        counted, np.maximum(standing, 0).tolist(), beyond.tolist(), strict=True
    ):
        hits = np.flatnonzero(types[first:last] == right)
        if len(hits):
            since_us = np.maximum(predicted_us[first + hits[0] : last], arrived_us)
            lasted_us = np.diff(since_us, append=ended_us)
            waits_us.append(int(since_us[0]) - arrived_us)
            wrong_us += int(lasted_us[~np.isin(types[first + hits[0] : last], (right, NOTHING))].sum())
            left_us += ended_us - int(since_us[0])
    if not waits_us:
        longest_us = float(max(ended_us - arrived_us for arrived_us, ended_us, _ in counted))
        return Latency(longest_us, longest_us, 1.0)
    waits = sorted(max(wait_us, takes_us) for wait_us in waits_us)
    return Latency(
        mean_us=sum(waits) / len(waits),
        p99_us=float(waits[math.ceil(0.99 * len(waits)) - 1]),
        missed=(len(counted) - len(waits)) / len(counted),
        wrong=wrong_us / left_us if left_us else 0.0,
    )


def _grasps(replay: Replay) -> Iterator[tuple[int, int, int]]:
    """Yield when each grasp of another type than the one before was complete and when it ended, in microseconds of the
    stream, and its class.
    """
    at_us, before = (_bounds_us(replay) - replay.stream.start_us).tolist(), NOTHING
    for arrival, end, right in replay.grasps:
        if right != before:
            yield at_us[arrival], at_us[end], right
        before = right


def _bounds_us(replay: Replay) -> Times:
    """Return when each state begins, and the last ends (T + 1,)."""
    return np.append(replay.stream.at_us, np.int64(replay.stream.end_us))


def decided_on(tables: IntegerTables, replay: Replay, step_us: int, policy: Deciding) -> tuple[Times, NDArray[np.intp]]:
    """Return the decisions under `policy` on a replay with a frame every step_us, the first at its start; of segments,
    the held types. Both devices show each frame whole, at the same time.
    """
    rows, codes = replay.stream.rows, replay.codes[:, : None if tables.n_joints else 0]
    scores = tables.scores(replay.bits[rows], codes[rows])
    return decisions(scores, _bounds_us(replay), step_us, decider_of(tables, policy))


def decisions(scores: NDArray[np.int32], at_us: Times, step_us: int, decide: Decide) -> tuple[Times, NDArray[np.intp]]:
    """Return the frames (c,) from which on other types (c,) are decided on, NOTHING for none.

    Of states with scores (T, K) that begin at at_us[:-1], and end at at_us[-1], a frame is seen every step_us.
    """
    due = -((at_us[0] - at_us) // step_us)
    changes, types = list[int](), list[int]()
    for biased_scores, (first, beyond) in zip((scores + LANE_OFFSET).tolist(), pairwise(due.tolist()), strict=True):
        standing = Ranking(tuple(biased_scores))
        for frame in range(first, beyond):
            decided = decide(frame * step_us, standing)
            decided = NOTHING if decided is None else decided
            if not types or decided != types[-1]:
                changes.append(frame)
                types.append(decided)
    return np.array(changes, np.int64), np.array(types, np.intp)


def decider_of(tables: IntegerTables, policy: Deciding) -> Decide:
    """Return the live recogniser's decider under `policy`."""
    if policy is None or isinstance(policy, SegmentModel):
        return _by_segments(tables, policy)
    return Decision(policy.lead_steps(tables.scale), policy.dwell_us, policy.hold_us).update


def _by_segments(tables: IntegerTables, model: SegmentModel | None) -> Decide:
    """Return the decider by segments of a model, None: the default, with the default lag: the held type."""
    model = model or SegmentModel.usual(tables.n_classes, has_none=False, scale=tables.scale)
    live = LiveSegments(model, [str(number) for number in range(tables.n_classes)], Policy().lag_us or 0)

    def decide(time_us: int, standing: Ranking) -> int | None:
        segment = live.update(time_us, standing.biased_scores)
        return None if segment.state == "forming" else segment.label

    return decide


def _check(tables: IntegerTables, replay: Replay, frame_us: float) -> None:
    switches, joints = replay.bits.shape[1], replay.codes.shape[1]
    if tables.n_switches != switches or tables.n_joints not in (0, joints):
        raise FrontierError(
            f"tables of {tables.n_switches} switches and {tables.n_joints} joints, for {switches} and {joints}"
        )
    most = max((grasp.state for grasp in replay.grasps), default=NOTHING)
    if most >= tables.n_classes:
        raise FrontierError(f"a stream of types up to {most} does not fit {tables.n_classes} types")
    if not (math.isfinite(frame_us) and frame_us > 0):
        raise FrontierError(f"a frame of {frame_us} us: it must take some time")
    if not replay.grasps:
        raise FrontierError("the stream has no grasp that follows one of another type: there is no latency to measure")
