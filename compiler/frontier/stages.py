"""The stages of a frontier's learning: switches chosen in every fold, classifiers trained and tested on them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from ..evaluation.folds import Fold
from ..placement.methods.base import METHODS
from ..samples import Columns
from .candidates import NO_SWITCHES, Choice
from .learnt import Fit, FitKey, FitTask, Path, PathKey, PathTask, choose_path, fit_stages
from .material import Cuts, Material
from .points import Way
from .settings import Shape
from .storing.asking import Desk

# Expected seconds of one core, for so many rows: they only say how the time that is left is told.
_ROWS = 3000
_ROUND_S, _TABLE_S = 0.009, 0.06


def path_s(method: str, rows: int) -> float:
    """Return the expected seconds of all placements of a method."""
    return METHODS[method].seconds * rows / _ROWS


def fit_s(rounds: int, tables: int, rows: int) -> float:
    """Return the expected seconds of a training with tests, and with so many tables made and tested."""
    return (rounds * _ROUND_S + tables * _TABLE_S) * rows / _ROWS


@dataclass(frozen=True, slots=True, eq=False)
class Learner:
    """Asks for placements and fits on the folds of `cuts`; what was asked before is known."""

    desk: Desk
    material: Material
    cuts: Cuts
    max_bins: int | None
    _columns: dict[tuple[Way, bool, Fold], Columns] = field(default_factory=dict, init=False)
    _seconds: dict[tuple[str, bool], float] = field(default_factory=dict, init=False)

    def choose(self, stage: str, choices: Iterable[Choice], folds: Sequence[Fold]) -> None:
        """Have the switches of all choices chosen from the training rows of these folds."""
        asked: dict[tuple[str, bool], list[float]] = {}
        for choice in choices:
            if choice.way != NO_SWITCHES:
                parameters = asked.setdefault((choice.way.method, _learns_from_joints(choice)), [])
                parameters.append(choice.way.parameter)
        tasks = [
            PathTask(
                PathKey(
                    method,
                    tuple(dict.fromkeys(parameters)),
                    joints,
                    self.cuts.names[fold],
                    self.material.wired if METHODS[method].uses_ports else "",
                ),
                self.material,
                fold,
                path_s(method, len(fold.train)),
            )
            for (method, joints), parameters in asked.items()
            for fold in folds
        ]
        folds_of = {task.key: task.fold for task in tasks}
        for key, path in self.desk.ask(stage, tasks, choose_path, Path).items():
            assert isinstance(key, PathKey)
            fold = folds_of[key]
            for parameter, columns in zip(key.parameters, path.columns, strict=True):
                self._columns[Way(key.method, parameter), key.joints, fold] = tuple(columns)
            if fold is self.cuts.everything:
                self._seconds[key.method, key.joints] = path.seconds

    def columns(self, choice: Choice, fold: Fold) -> Columns:
        """Return the switches of a choice, once chosen, from the training rows of `fold`."""
        if choice.way == NO_SWITCHES:
            return ()
        return self._columns[choice.way, _learns_from_joints(choice), fold]

    def choosing_s(self, choice: Choice) -> float:
        """Return how long it took to choose the switches of a choice from all rows."""
        return self._seconds.get((choice.way.method, _learns_from_joints(choice)), 0.0)

    def fit(
        self,
        stage: str,
        choices: Sequence[Choice],
        folds: Sequence[Fold],
        stages: tuple[int, ...],
        tabled: tuple[int, ...] = (),
        shapes: tuple[Shape, ...] = (),
    ) -> dict[tuple[Choice, Fold], Fit]:
        """Return what came of every choice in every fold."""
        keys = {
            (choice, fold): FitKey(
                self.columns(choice, fold), choice.joints, self.cuts.names[fold], stages, tabled, shapes, self.max_bins
            )
            for choice in choices
            for fold in folds
        }
        tables = len(tabled) * len(shapes)
        tasks = [
            FitTask(key, self.material, fold, fit_s(stages[-1], tables, len(fold.train)))
            for (_, fold), key in keys.items()
        ]
        found = self.desk.ask(stage, tasks, fit_stages, Fit)
        return {place: found[key] for place, key in keys.items()}


def _learns_from_joints(choice: Choice) -> bool:
    """Return whether the choice of switches looks at the joints; where it does not, inputs share it."""
    return choice.joints and METHODS[choice.way.method].uses_joints
