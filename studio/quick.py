"""The accuracy of any sensors at once: discriminants of sums that are added up once for each fold.

The scatter of all sensors is summed for the training rows of every fold. For some of the sensors, a shrunk linear
discriminant (R. A. Fisher, 1936; J. H. Friedman, "Regularized discriminant analysis", 1989) needs only their part of
it: a set of a few sensors is solved in milliseconds. Somebody who looks at the result and chooses again has seen the
test rows, so the accuracy is a guide, and not evidence: `study_sensors` measures.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.compiler.artifact.training import Cut, cuts_of, samples_of
from thenar.compiler.evaluation.folds import EvaluationError
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.placement.logistic import lines
from thenar.compiler.placement.sensors import sensor_names
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples, decided
from thenar.runtime.recipe import Recipe

Floats = NDArray[np.float64]
# The share of the mean variance that is added to each: sensors are few, and trials fewer.
SHRINKAGE = 0.1
_DECISIVE = 3
# Of more rows, each sensor that could be added or dropped is tried on as many.
_MOST_TRIED = 4000


class Misread(msgspec.Struct, frozen=True):
    """A trial that was recognised as another type: its number in `trials`, and the two types."""

    trial: int
    truth: str
    read: str


class Quick(msgspec.Struct, frozen=True):
    """The result for some sensors: the accuracy of trials, 0..1, and its 95 % interval, and what it is of; how many
    trials of each type (rows) were read as each (columns); and those that were misread.

    map  for every trial its type's number, and its place on the two axes on which the types are furthest apart
    """

    of: str
    mean: float
    low: float
    high: float
    confusion: tuple[tuple[int, ...], ...]
    misread: tuple[Misread, ...]
    map: tuple[tuple[int, float, float], ...]


class SeenTrial(msgspec.Struct, frozen=True):
    """A trial: what each sensor showed in it, 0 to 1 of its range in the set, and typically in trials of the true and
    of the recognised type; the numbers of these types; and the sensors that decided for the wrong one, most first.
    """

    shown: tuple[float, ...]
    truth: int
    read: int
    typical: tuple[tuple[float, ...], ...]
    decisive: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Sums:
    """Of the training rows of a fold: the means (K, d) of the types, their scatter (d, d), and ln of their shares."""

    test: NDArray[np.intp]
    means: Floats
    scatter: Floats
    shares: Floats


class QuickAccuracy:
    """The accuracy of any sensors of a set, new subjects if there are several, otherwise new trials.

    Parameters
    ----------
    grasp_set : GraspSet
        The recordings; rows in which nothing is held are left out.

    Attributes
    ----------
    names : tuple of str
        The names of the sensors, by number: switches, pads, joints.
    grasps : tuple of str
        The grasp types.
    trials : tuple of str
        The trials in which something is held, in words: "trial 7 of Ana, cup", as the recordings number them.

    Raises
    ------
    CompileError, EvaluationError
        If the recordings have a single grasp type, or cannot be cut into folds.
    """

    def __init__(self, grasp_set: GraspSet) -> None:
        held, recipe = grasp_set.without_none(), Recipe()
        self._samples: Samples = samples_of(held, recipe)
        self._cut: Cut = cuts_of(held, recipe)[0]
        self.names = sensor_names(self._samples, held.element_names, held.joint_names)
        self.grasps = self._samples.grasps
        rows = self._samples
        self._inputs = np.concatenate([rows.switches.T, lines(rows.taxels), lines(rows.codes)]).T
        self._folds = [self._summed(fold.train, fold.test) for fold in self._cut.folds]
        self.trials = tuple(
            f"trial {held.trials[row]} of {held.subjects[row]}, {held.objects[row]}"
            for row in np.unique(rows.trials, return_index=True)[1].tolist()
        )
        every = np.arange(len(rows.labels))
        self._every = self._summed(every, every)

    def of(self, sensors: Sequence[int]) -> Quick:
        """Return the accuracy of sensors by their numbers. Raises EvaluationError if there is no such number."""
        columns = self._columns(sensors)
        rows, predicted = self._samples, self._all_predicted(columns)
        rate = Rate.predicted(predicted, rows.labels, rows.trials, of=self._cut.of, groups=self._cut.groups)
        _, first, trial = np.unique(rows.trials, return_index=True, return_inverse=True)
        read, truth = decided(predicted[np.newaxis], trial)[0], rows.labels[first]
        confusion = np.zeros((len(self.grasps), len(self.grasps)), np.intp)
        np.add.at(confusion, (truth, read), 1)
        wrong = np.flatnonzero(read != truth).tolist()
        return Quick(
            of=str(self._cut.of),
            mean=rate.mean,
            low=rate.low,
            high=rate.high,
            confusion=tuple(map(tuple, confusion.tolist())),
            misread=tuple(Misread(one, self.grasps[truth[one]], self.grasps[read[one]]) for one in wrong),
            map=tuple(
                (int(kind), x, y) for kind, (x, y) in zip(truth, self._places(columns, trial).tolist(), strict=True)
            ),
        )

    def best_next(self, sensors: Sequence[int]) -> int | None:
        """Return the sensor that raises the accuracy of rows most; None if all are there.

        Raises EvaluationError if there is no sensor of a number.
        """
        self.check(sensors)
        others = [one for one in range(len(self.names)) if one not in sensors]
        return max(others, key=lambda one: self._right([*sensors, one]), default=None)

    def least(self, sensors: Sequence[int]) -> int | None:
        """Return the sensor without which the accuracy of rows falls least; None if there is none.

        Raises EvaluationError if there is no sensor of a number.
        """
        self.check(sensors)
        return max(sensors, key=lambda one: self._right([other for other in sensors if other != one]), default=None)

    def trial(self, number: int, sensors: Sequence[int]) -> SeenTrial:
        """Return a trial as it was seen, and as these sensors read it.

        Raises EvaluationError if there is no such trial or sensor.
        """
        columns, rows = self._columns(sensors), self._samples
        trials = np.unique(rows.trials)
        if not 0 <= number < len(trials):
            raise EvaluationError(f"there are {len(trials)} trials, numbered from 0")
        own = np.flatnonzero(rows.trials == trials[number])
        truth = int(rows.labels[own[0]])
        fold = next(fold for fold in self._folds if own[0] in fold.test)
        predicted = self._predicted(fold, columns, own)
        read = int(decided(predicted[np.newaxis], np.zeros(len(own), np.intp))[0, 0])
        inputs, decisive = self._inputs[own].mean(axis=0), list[int]()
        if columns and read != truth:
            means, weights = fold.means[:, columns], self._weights(fold, columns)
            middle = 0.5 * (means[read] + means[truth])
            shares = (weights[:, read] - weights[:, truth]) * (inputs[columns] - middle)
            decisive = [columns[place] for place in np.argsort(-shares, kind="stable")[:_DECISIVE] if shares[place] > 0]
        return SeenTrial(
            shown=self._of_range(inputs),
            truth=truth,
            read=read,
            typical=tuple(self._of_range(self._every.means[one]) for one in (truth, read)),
            decisive=tuple(decisive),
        )

    def _of_range(self, inputs: Floats) -> tuple[float, ...]:
        low, high = self._inputs.min(axis=0), self._inputs.max(axis=0)
        return tuple(((inputs - low) / np.maximum(high - low, 1e-9)).round(3).tolist())

    def check(self, sensors: Sequence[int]) -> None:
        """Raise EvaluationError unless there are sensors with these numbers."""
        if not all(0 <= sensor < len(self.names) for sensor in sensors):
            raise EvaluationError(f"there are {len(self.names)} sensors, numbered from 0")

    def _columns(self, sensors: Sequence[int]) -> list[int]:
        """Return the sensors in their order, each once. Raises EvaluationError if there is no such number."""
        self.check(sensors)
        return sorted(set(sensors))

    def _summed(self, train: NDArray[np.intp], test: NDArray[np.intp]) -> _Sums:
        labels, inputs = self._samples.labels[train], self._inputs[train]
        member = (labels == np.arange(len(self.grasps))[:, np.newaxis]).astype(np.float64)
        counts = member.sum(axis=1)
        means = (member @ inputs) / np.maximum(counts, 1.0)[:, np.newaxis]
        inside = inputs - means[labels]
        with np.errstate(divide="ignore"):
            shares = np.log(counts / counts.sum())
        return _Sums(test, means, inside.T @ inside / len(train), shares)

    def _places(self, columns: list[int], trial: NDArray[np.intp]) -> Floats:
        """Return where each trial (m,) lies on the first two axes (m, 2) of a discriminant of all rows."""
        places = np.zeros((trial.max() + 1, 2))
        if not columns:
            return places
        inputs = self._inputs[:, columns]
        means = self._every.means[:, columns]
        # Where the types' rows are equally wide in all directions, their means are furthest apart on the main axes.
        width, turn = np.linalg.eigh(_shrunk(self._every.scatter[columns][:, columns]))
        whitened = turn / np.sqrt(width)
        axes = whitened @ np.linalg.svd((means - means.mean(axis=0)) @ whitened, full_matrices=False)[2][:2].T
        along = (inputs - inputs.mean(axis=0)) @ axes
        counts = np.bincount(trial)
        for axis in range(along.shape[1]):
            places[:, axis] = np.bincount(trial, weights=along[:, axis]) / counts
        return places.round(3)

    def _right(self, columns: list[int]) -> int:
        labels, step = self._samples.labels, -(-len(self._samples.labels) // _MOST_TRIED)
        several = ((fold, fold.test[::step]) for fold in self._folds)
        return sum(int((self._predicted(fold, columns, rows) == labels[rows]).sum()) for fold, rows in several)

    def _all_predicted(self, columns: list[int]) -> NDArray[np.intp]:
        predicted = np.empty(len(self._samples.labels), np.intp)
        for fold in self._folds:
            predicted[fold.test] = self._predicted(fold, columns, fold.test)
        return predicted

    @staticmethod
    def _weights(fold: _Sums, columns: list[int]) -> Floats:
        return np.linalg.solve(_shrunk(fold.scatter[columns][:, columns]), fold.means[:, columns].T).astype(np.float64)

    def _predicted(self, fold: _Sums, columns: list[int], rows: NDArray[np.intp]) -> NDArray[np.intp]:
        means, weights = fold.means[:, columns], self._weights(fold, columns)
        offsets = fold.shares - 0.5 * (means * weights.T).sum(axis=1)
        scores = self._inputs[rows[:, np.newaxis], columns] @ weights + offsets
        best: NDArray[np.intp] = scores.argmax(axis=1)
        return best


def _shrunk(scatter: Floats) -> Floats:
    size = len(scatter)
    shrunk: Floats = scatter + np.eye(size) * (SHRINKAGE * np.trace(scatter) / max(size, 1) + 1e-9)
    return shrunk
