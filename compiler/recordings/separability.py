"""How far apart the grasp types of a set lie, before anything is trained."""

import msgspec
import numpy as np
from numpy.typing import NDArray

from .findings import frame_numbers
from .graspset import GraspSet

# Rows compared with each other at most, a sample of a larger set: their number is squared in the time it takes.
NEIGHBOUR_ROWS = 2000


class Separability(msgspec.Struct, frozen=True):
    """What one choice of inputs can tell apart.

    `ceiling` is the recognition rate of the best possible memory: the commonest grasp type of every distinct frame; no
    classifier that sees these inputs alone is right more often on these rows. `neighbour_rate` is leave-one-out nearest
    neighbour (Euclidean; joints in standard deviations, switches as 0 and 1) over `neighbour_rows` rows, None without
    scikit-learn.
    """

    inputs: str
    distinct_frames: int
    ceiling: float
    neighbour_rate: float | None
    neighbour_rows: int


def separabilities(grasp_set: GraspSet) -> tuple[Separability, ...]:
    """Return the separability by switches, by joints, and by both, as far as the set has them."""
    choices = {"switches": bool(grasp_set.switch_names), "joints": bool(grasp_set.joints)}
    inputs = [name for name, there in choices.items() if there] + ["both"] * all(choices.values())
    return tuple(_separability(grasp_set, name) for name in inputs) if len(grasp_set) else ()


def _separability(grasp_set: GraspSet, inputs: str) -> Separability:
    switches = grasp_set.switches if inputs != "joints" else grasp_set.switches[:, :0]
    codes = grasp_set.codes if inputs != "switches" else grasp_set.codes[:, :0]
    frames = frame_numbers(switches, codes)
    rate, rows = _neighbour_rate(switches, codes, grasp_set.labels)
    return Separability(inputs, int(frames.max()) + 1, _ceiling(frames, grasp_set.labels), rate, rows)


def _ceiling(frames: NDArray[np.intp], labels: NDArray[np.intp]) -> float:
    """Return sum over distinct frames of their commonest label's count, over n."""
    pairs, counts = np.unique(np.stack([frames, labels], axis=1), axis=0, return_counts=True)
    commonest = np.zeros(int(frames.max()) + 1, np.intp)
    np.maximum.at(commonest, pairs[:, 0], counts)
    return float(commonest.sum() / len(frames))


def _neighbour_rate(
    switches: NDArray[np.bool_], codes: NDArray[np.uint16], labels: NDArray[np.intp]
) -> tuple[float | None, int]:
    try:
        from sklearn.neighbors import NearestNeighbors
    except ImportError:
        return None, 0
    rows = np.arange(len(labels))
    if len(rows) > NEIGHBOUR_ROWS:
        rows = np.sort(np.random.default_rng(0).choice(rows, NEIGHBOUR_ROWS, replace=False))
    if len(rows) < 2:
        return None, len(rows)
    spread = codes.std(axis=0)
    points = np.hstack([switches[rows], codes[rows] / np.where(spread, spread, 1.0)])
    nearest = NearestNeighbors(n_neighbors=1, algorithm="kd_tree").fit(points).kneighbors(return_distance=False)[:, 0]
    return float(np.mean(labels[rows][nearest] == labels[rows])), len(rows)
