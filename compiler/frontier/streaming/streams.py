"""Streams: what a glove delivers while a hand goes from grasp to grasp, recorded or composed of single trials."""

import numpy as np
from numpy.typing import NDArray

from ...recordings.graspset import GraspSet
from ..points import FrontierError
from .composing import HOLD_US, TRANSITION_US, Trials, composed
from .movements import Movements, holds_movements, movements_of
from .stream import Stream, stream_from

Rows = NDArray[np.intp]

GRASPS = 300
PERIOD_US = 10_000
# The golden section: its multiples, less their whole parts, are spread evenly, however many there are.
_GOLDEN = 0.618034


def stream_of(
    grasp_set: GraspSet,
    labels: Rows,
    rows: Rows | None = None,
    *,
    seed: int,
    grasps: int = GRASPS,
    period_us: int = PERIOD_US,
) -> Stream:
    """Return a stream of rows of a set: its own movements where it holds whole ones, else one composed of its trials.

    labels  (n,) the classes of all rows, as the tables number them
    rows    those that may be used, the tables' test rows; None: all. Of a set of whole movements only movements all of
            whose rows are among them are

    `what` of the stream says in a sentence which it is, and why. Raises FrontierError where nothing comes of the rows.
    """
    if holds_movements(grasp_set):
        return recorded_stream(grasp_set, labels, rows, grasps=grasps, period_us=period_us)
    chosen = np.arange(len(grasp_set)) if rows is None else rows
    return composed_stream(
        grasp_set.switches[chosen],
        grasp_set.codes[chosen],
        labels[chosen],
        seed=seed,
        grasps=grasps,
        opens_up=np.array([joint.step < 0 for joint in grasp_set.joints], np.bool_),
    )


def recorded_stream(
    grasp_set: GraspSet,
    labels: Rows,
    rows: Rows | None = None,
    *,
    grasps: int = GRASPS,
    period_us: int = PERIOD_US,
) -> Stream:
    """Return the movements of a set whose rows are the frames of whole movements, one after the other.

    A set does not tell when its rows were recorded: they are taken to be `period_us` apart (the scene `continuous`:
    100 Hz). Between two movements a part of a period goes by as well, so that no frame time stays in step with the
    rows. Where there are more than `grasps` movements, as many of them, evenly spread.

    Raises FrontierError if no movement lies in `rows` as a whole.
    """
    found = movements_of(grasp_set)
    if rows is not None:
        found = found.pick(_whole(found, rows, len(grasp_set)))
    if not len(found):
        raise FrontierError(
            "no whole movement is among the rows that a latency is measured on: cut the folds between movements"
        )
    found = found.pick(np.unique(np.linspace(0, len(found) - 1, min(grasps, len(found))).astype(np.intp)))
    what = (
        f"Latencies are over {len(found)} recorded movements, frames taken to be {period_us / 1000:g} ms apart: "
        "neighbouring rows of a trial resemble each other, as the frames of a whole movement do."
    )
    return _laid_out(grasp_set, labels, found, period_us, what)


def composed_stream(
    switches: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    labels: Rows,
    *,
    seed: int,
    grasps: int = GRASPS,
    opens_up: NDArray[np.bool_] | None = None,
) -> Stream:
    """Return a stream composed of single trials (n, s), (n, j) of classes `labels` (n,): what composing.py says.

    opens_up  (j,) the joints whose codes rise as the hand opens; None: the codes of all fall

    Raises FrontierError for fewer than two grasp types: there is nothing to go from and to.
    """
    falling = np.zeros(codes.shape[1], np.bool_) if opens_up is None else opens_up
    what = (
        f"Latencies are over a stream composed of {grasps} single trials, each held for {HOLD_US[0] / 1e6:g} to "
        f"{HOLD_US[1] / 1e6:g} s, up to {TRANSITION_US / 1e6:g} s from one to the next: the recordings hold no whole "
        "movements."
    )
    return composed(Trials(switches, codes, labels), falling, grasps, seed, what)


def _whole(movements: Movements, rows: Rows, count: int) -> NDArray[np.bool_]:
    """Return which movements (m,) have all their rows among `rows`."""
    there = np.zeros(count + 1, np.int64)
    there[1:] = np.cumsum(np.bincount(rows, minlength=count) > 0)
    whole: NDArray[np.bool_] = there[movements.beyond] - there[movements.first] == movements.beyond - movements.first
    return whole


def _laid_out(grasp_set: GraspSet, labels: Rows, movements: Movements, period_us: int, what: str) -> Stream:
    sizes = movements.beyond - movements.first
    begins = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    number = np.repeat(np.arange(len(sizes)), sizes)
    rows = np.arange(sizes.sum()) - begins[number] + movements.first[number]
    at_us = np.arange(len(rows), dtype=np.int64) * period_us + number * round(_GOLDEN * period_us)
    return stream_from(
        bits=grasp_set.switches[rows],
        codes=grasp_set.codes[rows],
        at_us=at_us,
        end_us=int(at_us[-1]) + period_us,
        arrivals=begins + movements.complete - movements.first,
        ends=begins + movements.released - movements.first,
        grasps=labels[movements.first],
        what=what,
    )
