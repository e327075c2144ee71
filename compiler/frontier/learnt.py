"""The work that a frontier shares: one path serves all placements of a method, one training all numbers of rounds."""

import time
from dataclasses import dataclass

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from ..boosting.boost import boost
from ..boosting.stumps import Stumps, winners
from ..evaluation.folds import Fold
from ..placement.methods.base import METHODS
from ..samples import Columns
from ..tables.collapse import collapse
from ..tables.quantise import integer_scores, quantise
from .material import Material
from .settings import Shape


class PathKey(Struct, frozen=True):
    """Which placements: a method's for several parameters, from the training rows of a fold, at these ports' costs."""

    method: str
    parameters: tuple[float, ...]
    joints: bool
    fold: str
    ports: str = ""


class Path(Struct, frozen=True):
    """The placements of a method, one for each parameter, and how long they took together."""

    columns: tuple[Columns, ...]
    seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class PathTask:
    """Choose switches by one method."""

    key: PathKey
    material: Material
    fold: Fold
    cost: float


def choose_path(task: PathTask) -> Path:
    """Return the placements that `task` asks for."""
    began = time.perf_counter()
    learning = task.material.learning(task.fold.train, task.key.joints)
    choose = METHODS[task.key.method].chooser(learning, task.material.ports)
    columns = tuple(choose(parameter) for parameter in task.key.parameters)
    return Path(columns, time.perf_counter() - began)


class FitKey(Struct, frozen=True):
    """Which training: on these switches and perhaps the joints of a fold's training rows; which stages are tested, and
    for which of them integer tables of which shapes.
    """

    columns: Columns
    joints: bool
    fold: str
    stages: tuple[int, ...]
    tabled: tuple[int, ...]
    shapes: tuple[Shape, ...]
    max_bins: int | None


class Fit(Struct, frozen=True):
    """How many of `total` test rows were recognised: after every stage, and by the tables of each shape after each
    tabled stage (stages x shapes).
    """

    total: int
    correct: tuple[int, ...]
    deployed: tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True, eq=False)
class FitTask:
    """Train once, test at every stage."""

    key: FitKey
    material: Material
    fold: Fold
    cost: float


def fit_stages(task: FitTask) -> Fit:
    """Return what `task` asks for. Rows of a placement without a switch that varies get the most frequent type."""
    key, material, fold = task.key, task.material, task.fold
    X = material.inputs(key.columns, key.joints)
    stumps = trained(material, X, fold.train, key.stages[-1], key.max_bins)
    right = material.labels[fold.test]
    if not stumps.n_rounds:
        most = np.bincount(material.labels[fold.train]).argmax()
        same = int(np.count_nonzero(right == most))
        return Fit(len(right), (same,) * len(key.stages), ((same,) * len(key.shapes),) * len(key.tabled))
    correct = _correct_after(stumps, X[fold.test], right, key.stages)
    kept = len(key.columns)
    deployed = tuple(
        tuple(_recognised(stumps.first(stage), shape, X, kept, fold, right) for shape in key.shapes)
        for stage in key.tabled
    )
    return Fit(len(right), correct, deployed)


def trained(
    material: Material, X: NDArray[np.uint16], rows: NDArray[np.intp], rounds: int, max_bins: int | None
) -> Stumps:
    """Return the ensemble of so many rounds on some rows of X (n, kept + j)."""
    return boost(X[rows], material.labels[rows], len(material.grasps), rounds=rounds, max_bins=max_bins)[0]


def _correct_after(
    stumps: Stumps, X: NDArray[np.uint16], right: NDArray[np.intp], stages: tuple[int, ...]
) -> tuple[int, ...]:
    counts = {}
    for done, scores in enumerate(stumps.staged_scores(X), 1):
        if done in stages:
            counts[done] = int(np.count_nonzero(winners(scores) == right))
    return tuple(counts[stage] for stage in stages)


def _recognised(
    stumps: Stumps, shape: Shape, X: NDArray[np.uint16], kept: int, fold: Fold, right: NDArray[np.intp]
) -> int:
    bits, codes = X[:, :kept].astype(bool), X[:, kept:]
    # The rows trained on have a say in what stands in for lost inputs, which nothing here looks at; in scores only
    # where entries are narrow.
    seen = fold.train if shape.table_bits < 16 else fold.train[:1]
    tables = quantise(collapse(stumps, kept), bits[seen], codes[seen], shape.width, shape.table_bits)
    answers = integer_scores(tables, bits[fold.test], codes[fold.test]).argmax(axis=1)
    return int(np.count_nonzero(answers == right))
