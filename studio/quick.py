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


class Quick(msgspec.Struct, frozen=True):
    """The result for some sensors, or for a build: the accuracy of trials, 0..1, and its 95 % interval, and what it is
    of; and the number of the recognised type of every trial.
    """

    of: str
    mean: float
    low: float
    high: float
    read: tuple[int, ...]


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
    held : GraspSet
        The rows in which something is held.
    trial : (n,) array of intp
        For each of these rows the number of its trial.
    truth : (T,) array of intp
        The number of each trial's type.
    typical : list of (d,) array
        For each type what the sensors showed on average, 0 to 1 of their ranges in the set.

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
        self.held = held
        _, first, self.trial = np.unique(rows.trials, return_index=True, return_inverse=True)
        self.truth = rows.labels[first]
        every = np.arange(len(rows.labels))
        self._every = self._summed(every, every)
        self.typical = [self._of_range(means) for means in self._every.means]

    def of(self, sensors: Sequence[int]) -> Quick:
        """Return the accuracy of sensors by their numbers. Raises EvaluationError if there is no such number."""
        columns = self._columns(sensors)
        rows, predicted = self._samples, np.empty(len(self._samples.labels), np.intp)
        for fold in self._folds:
            predicted[fold.test] = self._predicted(fold, columns, fold.test)
        rate = Rate.predicted(predicted, rows.labels, rows.trials, of=self._cut.of, groups=self._cut.groups)
        read = decided(predicted[np.newaxis], self.trial)[0]
        return Quick(str(self._cut.of), rate.mean, rate.low, rate.high, tuple(read.tolist()))

    def rows_of(self, trial: int) -> NDArray[np.intp]:
        """Return the rows of a trial. Raises EvaluationError if there is no such trial."""
        if not 0 <= trial < len(self.truth):
            raise EvaluationError(f"there are {len(self.truth)} trials, numbered from 0")
        return np.flatnonzero(self.trial == trial)

    def seen(self, trial: int) -> Floats:
        """Return the value of each sensor (d,) in a trial on average, 0 to 1 of its range in the set.

        Raises EvaluationError if there is no such trial.
        """
        return self._of_range(self._inputs[self.rows_of(trial)].mean(axis=0))

    def decisive(self, trial: int, sensors: Sequence[int]) -> list[int]:
        """Return which of these sensors decided for the wrong type of a misread trial, the strongest first; at most 3.

        Raises EvaluationError if there is no such trial or sensor.
        """
        columns, own = self._columns(sensors), self.rows_of(trial)
        truth = self.truth[trial]
        fold = next(fold for fold in self._folds if own[0] in fold.test)
        read = int(decided(self._predicted(fold, columns, own)[np.newaxis], np.zeros(len(own), np.intp))[0, 0])
        if not columns or read == truth:
            return []
        means, weights = fold.means[:, columns], self._weights(fold, columns)
        middle = 0.5 * (means[read] + means[truth])
        shares = (weights[:, read] - weights[:, truth]) * (self._inputs[own][:, columns].mean(axis=0) - middle)
        return [columns[place] for place in strongest(shares)]

    def _of_range(self, inputs: Floats) -> Floats:
        low, high = self._inputs.min(axis=0), self._inputs.max(axis=0)
        shares: Floats = ((inputs - low) / np.maximum(high - low, 1e-9)).round(3)
        return shares

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

    def places(self, sensors: Sequence[int]) -> Floats:
        """Return where each trial (T, 2), 0 to 1, lies on the two axes on which these sensors show the types furthest
        apart.

        They are the first axes of a discriminant of all rows. Raises EvaluationError if there is no such sensor.
        """
        columns, trial = self._columns(sensors), self.trial
        places = np.zeros((len(self.truth), 2))
        if not columns:
            return places
        inputs, means = self._inputs[:, columns], self._every.means[:, columns]
        # Where the types' rows are equally wide in all directions, their means are furthest apart on the main axes.
        width, turn = np.linalg.eigh(_shrunk(self._every.scatter[columns][:, columns]))
        whitened = turn / np.sqrt(width)
        axes = whitened @ np.linalg.svd((means - means.mean(axis=0)) @ whitened, full_matrices=False)[2][:2].T
        along = (inputs - inputs.mean(axis=0)) @ axes
        counts = np.bincount(trial)
        for axis in range(along.shape[1]):
            places[:, axis] = np.bincount(trial, weights=along[:, axis]) / counts
        places -= places.min(axis=0)
        shares: Floats = (places / np.maximum(places.max(axis=0), 1e-9)).round(4)
        return shares

    @staticmethod
    def _weights(fold: _Sums, columns: list[int]) -> Floats:
        return np.linalg.solve(_shrunk(fold.scatter[columns][:, columns]), fold.means[:, columns].T).astype(np.float64)

    def _predicted(self, fold: _Sums, columns: list[int], rows: NDArray[np.intp]) -> NDArray[np.intp]:
        means, weights = fold.means[:, columns], self._weights(fold, columns)
        offsets = fold.shares - 0.5 * (means * weights.T).sum(axis=1)
        scores = self._inputs[rows[:, np.newaxis], columns] @ weights + offsets
        best: NDArray[np.intp] = scores.argmax(axis=1)
        return best


def strongest(shares: Floats) -> list[int]:
    """Return the places of the largest positive shares, at most 3."""
    return [place for place in np.argsort(-shares, kind="stable").tolist()[:_DECISIVE] if shares[place] > 0]


def _shrunk(scatter: Floats) -> Floats:
    size = len(scatter)
    shrunk: Floats = scatter + np.eye(size) * (SHRINKAGE * np.trace(scatter) / max(size, 1) + 1e-9)
    return shrunk
