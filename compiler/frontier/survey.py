"""What a frontier is computed from: rows and their folds; in these switches are chosen and classifiers trained."""

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from ..boosting.stumps import winners
from ..evaluation.folds import Fold, Rows, check_cut, leave_one_out, weka_folds
from ..placement.methods.base import METHODS
from ..placement.ports import PortCosts
from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples
from ..tables.collapse import ScoreTables, collapse, model_scores
from ..tables.quantise import integer_scores, quantise
from ..trainers.base import Training
from .cache import Cache, stored
from .equipment import Equipment
from .points import Way
from .search import NO_SWITCHES, Candidate, Search, Shape

# Expected seconds of one core, for so many rows: they only say how the time that is left is told.
_ROWS = 3000
_ROUND_S, _TABLE_S = 0.009, 0.06


@dataclass(frozen=True, slots=True, eq=False)
class Cuts:
    """All ways in which rows are parted: repeats of stratified folds, and each subject against the others."""

    repeats: tuple[tuple[Fold, ...], ...]
    subjects: tuple[Fold, ...]
    everything: Fold

    @classmethod
    def of(cls, labels: Rows, subjects: NDArray[np.str_], search: Search) -> "Cuts":
        """Return those of rows (n,). Raises EvaluationError if there are too few."""
        check_cut(len(labels), search.folds, "rows")
        seeds = range(search.seed, search.seed + search.repeats)
        rows = np.arange(len(labels))
        return cls(
            repeats=tuple(tuple(weka_folds(labels, search.folds, seed)) for seed in seeds),
            subjects=tuple(leave_one_out(subjects, "subject")) if len(np.unique(subjects)) > 1 else (),
            everything=Fold(rows, rows[:0], "all"),
        )

    @property
    def screening(self) -> tuple[Fold, ...]:
        """The folds of the first repeat."""
        return self.repeats[0]

    @property
    def others(self) -> tuple[Fold, ...]:
        """Every other fold that is tested."""
        return (*(fold for folds in self.repeats[1:] for fold in folds), *self.subjects)


class Ladder(Struct, frozen=True):
    """The placements of a method, one for each parameter, and how long they took together."""

    columns: tuple[Columns, ...]
    seconds: float


class Tally(Struct, frozen=True):
    """How many of `total` test rows were recognised: after every stage, and by the tables of each shape after each
    tabled stage (stages x shapes).
    """

    total: int
    correct: tuple[int, ...]
    deployed: tuple[tuple[int, ...], ...]


@dataclass(frozen=True, eq=False)
class Survey:
    """Rows, what is tried on them, and of what a glove may be built; placements and fits that were asked for are known.

    source  what the recordings are called
    ports   what they cost to read on the whole glove, None where that is not known
    """

    grasp_set: GraspSet
    source: str
    samples: Samples
    ports: PortCosts | None
    search: Search
    cuts: Cuts
    equipment: Equipment
    cache: Cache
    _columns: dict[tuple[Way, bool, Fold], Columns] = field(default_factory=dict, init=False)
    _seconds: dict[tuple[str, bool], float] = field(default_factory=dict, init=False)

    @property
    def switch_names(self) -> tuple[str, ...]:
        """The names of all switches."""
        return self.grasp_set.switch_names

    @property
    def n_joints(self) -> int:
        """How many joints a frame has."""
        return int(self.samples.codes.shape[1])

    @cached_property
    def _alone(self) -> Samples:
        return replace(self.samples, codes=self.samples.codes[:, :0])

    def inputs(self, joints: bool) -> Samples:
        """Return all rows, with the joints or without."""
        return self.samples if joints else self._alone

    def choose(self, stage: str, choices: Iterable[Candidate], folds: Sequence[Fold]) -> None:
        """Have the switches of all choices chosen from the training rows of these folds."""
        asked: dict[tuple[str, bool], dict[float, None]] = {}
        for choice in choices:
            if choice.way != NO_SWITCHES:
                asked.setdefault((choice.way.method, choice.learns_from_joints), {})[choice.way.parameter] = None
        places = [(method, joints, fold) for method, joints in asked for fold in folds]
        calls = [
            choose_path.call(
                path_s(method, len(fold.train)),
                self.inputs(joints),
                fold.train,
                method,
                tuple(asked[method, joints]),
                self.ports if METHODS[method].uses_ports else None,
            )
            for method, joints, fold in places
        ]
        for (method, joints, fold), path in zip(places, self.cache.ask(stage, calls), strict=True):
            for parameter, columns in zip(asked[method, joints], path.columns, strict=True):
                self._columns[Way(method, parameter), joints, fold] = columns
            if fold is self.cuts.everything:
                self._seconds[method, joints] = path.seconds

    def columns(self, choice: Candidate, fold: Fold) -> Columns:
        """Return the switches of a choice, once chosen, from the training rows of `fold`."""
        return () if choice.way == NO_SWITCHES else self._columns[choice.way, choice.learns_from_joints, fold]

    def choosing_s(self, choice: Candidate) -> float:
        """Return how long it took to choose the switches of a choice from all rows."""
        return self._seconds.get((choice.way.method, choice.learns_from_joints), 0.0)

    def fit(
        self,
        stage: str,
        choices: Sequence[Candidate],
        folds: Sequence[Fold],
        stages: tuple[int, ...],
        tabled: tuple[int, ...] = (),
        shapes: tuple[Shape, ...] = (),
    ) -> dict[tuple[Candidate, Fold], Tally]:
        """Return what came of every choice in every fold."""
        places = [(choice, fold) for choice in choices for fold in folds]
        calls = [
            fit_stages.call(
                fit_s(stages[-1], len(tabled) * len(shapes), len(fold.train)),
                self.inputs(choice.joints),
                fold,
                self.columns(choice, fold),
                stages,
                tabled,
                shapes,
                self.search.training,
            )
            for choice, fold in places
        ]
        return dict(zip(places, self.cache.ask(stage, calls), strict=True))


def path_s(method: str, rows: int) -> float:
    """Return the expected seconds of all placements of a method."""
    return METHODS[method].seconds * rows / _ROWS


def fit_s(rounds: int, tables: int, rows: int) -> float:
    """Return the expected seconds of a training with tests, and with so many tables made and tested."""
    return (rounds * _ROUND_S + tables * _TABLE_S) * rows / _ROWS


@stored(1)
def choose_path(
    samples: Samples, rows: Rows, method: str, parameters: tuple[float, ...], ports: PortCosts | None
) -> Ladder:
    """Choose switches from some rows by one method, for all of its parameters."""
    began = time.perf_counter()
    choose = METHODS[method].chooser(samples.rows(rows), ports)
    columns = tuple(choose(parameter) for parameter in parameters)
    return Ladder(columns, time.perf_counter() - began)


@stored(1)
def fit_stages(
    samples: Samples,
    fold: Fold,
    columns: Columns,
    stages: tuple[int, ...],
    tabled: tuple[int, ...],
    shapes: tuple[Shape, ...],
    training: Training,
) -> Tally:
    """Train once on a fold's training rows, on the switches `columns` and the joints; test at every stage.

    Rows of a placement without a switch that varies get the most frequent type.
    """
    kept = samples.keeping(columns)
    train, test = kept.rows(fold.train), kept.rows(fold.test)
    if not (train.inputs != train.inputs[0]).any():
        same = int(np.count_nonzero(test.labels == np.bincount(train.labels).argmax()))
        return Tally(len(test.labels), (same,) * len(stages), ((same,) * len(shapes),) * len(tabled))
    rounds = (*stages, *tabled)
    models = dict(zip(rounds, training.stages(train, rounds), strict=True))
    answers = (winners(model_scores(models[stage], test.switches, test.codes)) for stage in stages)
    correct = tuple(int(np.count_nonzero(answer == test.labels)) for answer in answers)
    scores = [collapse(models[stage], kept.n_switches) for stage in tabled]
    deployed = tuple(tuple(_recognised(each, shape, train, test) for shape in shapes) for each in scores)
    return Tally(len(test.labels), correct, deployed)


def _recognised(scores: ScoreTables, shape: Shape, train: Samples, test: Samples) -> int:
    # The rows trained on have a say in what stands in for lost inputs, which nothing here looks at; in scores only
    # where entries are narrow.
    seen = train if shape.table_bits < 16 else train.rows(np.arange(1))
    tables = quantise(scores, seen.switches, seen.codes, shape.width, shape.table_bits)
    answers = integer_scores(tables, test.switches, test.codes).argmax(axis=1)
    return int(np.count_nonzero(answers == test.labels))
