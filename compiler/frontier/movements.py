"""Whole movements in a set of grasps: which rows belong together, and in which of them the grasp is complete."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..placement.elements import above, elements_of
from ..recordings.graspset import GraspSet
from ..samples import Samples

Rows = NDArray[np.intp]
Bits = NDArray[np.bool_]

# Fewer frames than these show no movement: a tenth of a second at the rate of a CyberGlove.
LEAST_FRAMES = 10
# Neighbouring frames differ by less than this share of the difference between frames half a movement apart.
_ALIKE = 0.5
# A hold continues if a contact's bounce interrupts it for at most these frames.
_BRIDGED = 2


@dataclass(frozen=True, slots=True, eq=False)
class Movements:
    """m movements: neighbouring rows of one trial, in the order of time.

    first, beyond        (m,)  movement i is rows first[i] to beyond[i] - 1
    complete, released   (m,)  the row from which its grasp is complete, and the one from which it no longer is
    """

    first: Rows
    beyond: Rows
    complete: Rows
    released: Rows

    def __len__(self) -> int:
        return len(self.first)

    def pick(self, chosen: Rows | Bits) -> "Movements":
        """Return some of the movements, by number or by mask (m,)."""
        return Movements(self.first[chosen], self.beyond[chosen], self.complete[chosen], self.released[chosen])


def movement_numbers(grasp_set: GraspSet) -> Rows:
    """Return the number (n,) of the run of each row: neighbouring rows of one subject, grasp type, object and trial,
    with those in which nothing is held. Folds of a set of whole movements must not split a run.
    """
    keys: list[NDArray[Any]] = [grasp_set.subjects, grasp_set.grasps, grasp_set.objects, grasp_set.trials]
    if grasp_set.is_none.any():
        keys = [grasp_set.movement_ids]
    changes = np.logical_or.reduce([column[1:] != column[:-1] for column in keys])
    return np.concatenate([np.zeros(min(len(grasp_set), 1), np.intp), np.cumsum(changes, dtype=np.intp)])


def holds_movements(grasp_set: GraspSet) -> bool:
    """Return whether the rows of a set are the frames of whole movements.

    Two conditions hold then. Most rows lie in runs (movement_numbers) of at least LEAST_FRAMES rows. And within these,
    neighbouring rows are less than half as different as rows half a run apart, in switches, joints and taxels. Single
    trials recorded without trial numbers are no movements: each differs from the next as much as from any other.
    """
    first, beyond = _runs(grasp_set)
    long = beyond - first >= LEAST_FRAMES
    if 2 * (beyond - first)[long].sum() <= len(grasp_set):
        return False
    spans = list(zip(first[long].tolist(), beyond[long].tolist(), strict=True))
    arrays = (grasp_set.switches, grasp_set.codes, grasp_set.taxels)
    differences = [_differences(array, spans) for array in arrays if array.shape[1]]
    return any(far for _, far in differences) and all(near <= _ALIKE * far for near, far in differences)


def movements_of(grasp_set: GraspSet) -> Movements:
    """Return the movements of a set of whole movements, in its order; runs of fewer than LEAST_FRAMES rows are skipped.

    A taxel is closed if it is pressed beyond the threshold with most information about the grasp type. A grasp is
    complete while the labels say that it is held; in a set without labels for nothing held, held_frames decides.
    """
    first, beyond = _runs(grasp_set)
    none = grasp_set.is_none
    spans = [(a, b) for a, b in zip(first, beyond, strict=True) if b - a >= LEAST_FRAMES and not none[a:b].all()]
    first, beyond = np.array(spans, np.intp).reshape(-1, 2).T
    if none.any():
        held = [_longest(~none[a:b]) for a, b in spans]
    else:
        closed = _closed(grasp_set)
        held = [held_frames(closed[a:b], grasp_set.codes[a:b]) for a, b in spans]
    complete, released = np.array(held, np.intp).reshape(-1, 2).T
    return Movements(first, beyond, first + complete, first + released)


def held_frames(switches: Bits, codes: NDArray[np.uint16]) -> tuple[int, int]:
    """Return the first frame in which the grasp of one movement (F, s), (F, j) is complete, and the first after it.

    It is complete while at least as many switches are closed as are for a tenth of the movement, and while the joints
    are near their median pose in such frames, within twice the median distance (noise); of several such stretches the
    longest. If no switch closes, the pose is the median of all frames: the hand must have held for at least half of
    them.
    """
    closed = switches.sum(axis=1)
    held: Bits = closed >= np.sort(closed)[-max(len(closed) // 10, 1)]
    if codes.shape[1]:
        away = np.abs(codes - np.median(codes[held], axis=0)).mean(axis=1)
        held &= away <= 2.0 * np.median(away[held]) + 0.5  # half a code, for hands without noise
    return _longest(held)


def _closed(grasp_set: GraspSet) -> Bits:
    """Return which switches and taxels (n, s + t) are closed."""
    if not grasp_set.taxel_columns:
        return grasp_set.switches
    bits = above(grasp_set.switches, grasp_set.taxels, elements_of(Samples.of(grasp_set), 1))
    bits[:, len(grasp_set.switch_names) :] ^= [taxel.step < 0 for taxel in grasp_set.taxel_columns]
    return bits


def _runs(grasp_set: GraspSet) -> tuple[Rows, Rows]:
    numbers = movement_numbers(grasp_set)
    beyond = np.cumsum(np.bincount(numbers)) if len(numbers) else numbers
    return np.concatenate([numbers[:1], beyond[:-1]]), beyond


def _differences(array: Bits | NDArray[np.uint16], spans: list[tuple[int, int]]) -> tuple[float, float]:
    """Return the difference of neighbouring rows (n, c), and of rows half a run apart; means over the runs."""
    near = sum(_difference(array[a:b], 1) for a, b in spans)
    return near, sum(_difference(array[a:b], (b - a) // 2) for a, b in spans)


def _difference(run: Bits | NDArray[np.uint16], lag: int) -> float:
    values = run.astype(np.int32)
    return float(np.abs(values[lag:] - values[:-lag]).mean())


def _longest(held: Bits) -> tuple[int, int]:
    """Return the longest stretch of True (F,), short gaps bridged; of several the first."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    apart = np.flatnonzero(starts[1:] - stops[:-1] > _BRIDGED)
    starts, stops = starts[np.concatenate([[0], apart + 1])], stops[np.concatenate([apart, [len(stops) - 1]])]
    best = int(np.argmax(stops - starts))
    return int(starts[best]), int(stops[best])
