"""Numerically hard training sets and scores, constructed by rule or random from a seed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats
from thenar.runtime.model.terms.base import HIGHEST_CODE


@dataclass(frozen=True, slots=True, eq=False)
class HardSet:
    """n rows: X (n, d) of n_switches bits and then codes, labels (n,) in 0..n_classes-1, weights (n,); None: all 1."""

    name: str
    X: NDArray[np.int64]
    labels: NDArray[np.intp]
    n_classes: int
    n_switches: int
    weights: Floats | None = None

    @property
    def bits(self) -> NDArray[np.bool_]:
        """The switches (n, s)."""
        return self.X[:, : self.n_switches].astype(np.bool_)

    @property
    def codes(self) -> NDArray[np.uint16]:
        """The joints' codes (n, j)."""
        return self.X[:, self.n_switches :].astype(np.uint16)

    @property
    def row_weights(self) -> Floats:
        """The weights (n,), also if all are 1."""
        return np.ones(len(self.labels)) if self.weights is None else self.weights

    @property
    def scaled_weights(self) -> Floats:
        """The row weights (n,) used in training: divided by a power of two, so that all are below 1."""
        return self.row_weights if self.weights is None else np.ldexp(self.weights, -np.frexp(self.weights.max())[1])

    @property
    def member(self) -> NDArray[np.bool_]:
        """(K, n) whether a row is of a class."""
        member: NDArray[np.bool_] = self.labels == np.arange(self.n_classes)[:, np.newaxis]
        return member

    def rows(self, rows: NDArray[np.intp]) -> "HardSet":
        """Return the set of the rows at these indices."""
        weights = None if self.weights is None else self.weights[rows]
        return replace(self, X=self.X[rows], labels=self.labels[rows], weights=weights)

    def counts(self) -> dict[tuple[int, ...], list[int]]:
        """Return the count of each class on each frame; weights are integers."""
        counts: dict[tuple[int, ...], list[int]] = {}
        for row, label, weight in zip(map(tuple, self.X.tolist()), self.labels, self.row_weights, strict=True):
            counts.setdefault(row, [0] * self.n_classes)[label] += int(weight)
        return counts


def separable(classes: int, rows_a_class: int = 2) -> HardSet:
    """Return a set in which every class closes its own switch: one stump separates it from all others."""
    labels = np.arange(classes).repeat(rows_a_class)
    X = (labels[:, np.newaxis] == np.arange(classes)).astype(np.int64)
    return HardSet(f"{classes} classes, a switch each", X, labels, classes, classes)


def intervals(classes: int, rows_a_class: int = 2) -> HardSet:
    """Return a set in which every class has an interval of one joint's codes: two stumps separate an inner one."""
    labels = np.arange(classes).repeat(rows_a_class)
    codes = np.linspace(0, HIGHEST_CODE, len(labels)).astype(np.int64)[:, np.newaxis]
    return HardSet(f"{classes} classes along one joint", codes, labels, classes, 0)


def words(classes: int, rows_a_class: int = 2) -> HardSet:
    """Return a set whose switches spell the class's number in binary: a class needs many stumps."""
    labels = np.arange(classes).repeat(rows_a_class)
    n_switches = max(1, (classes - 1).bit_length())
    X = labels[:, np.newaxis] >> np.arange(n_switches) & 1
    return HardSet(f"{classes} classes in binary", X.astype(np.int64), labels, classes, n_switches)


def noisy(classes: int, rows: int, noise: float, seed: int) -> HardSet:
    """Return rows of prototypes with a tenth of the switches wrong and overlapping joints; a share `noise` of the
    labels is random.
    """
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, classes, rows)
    prototypes = rng.random((classes, 6)) < 0.4
    switches = prototypes[truth] ^ (rng.random((rows, 6)) < 0.1)
    joints = rng.integers(0, 40, (rows, 2)) + 9 * truth[:, np.newaxis]
    labels = np.where(rng.random(rows) < noise, rng.integers(0, classes, rows), truth).astype(np.intp)
    X = np.column_stack([switches, joints]).astype(np.int64)
    return HardSet(f"{classes} classes, {noise:.0%} of labels random", X, labels, classes, 6)


def contradictory(counts: Sequence[Sequence[int]]) -> HardSet:
    """Return frames, numbered by one switch if there are two, else by one joint, of counts[f][k] rows of class k each.

    Equal rows are merged to one, with their number as weight.
    """
    table = np.array(counts)
    frames, labels = np.nonzero(table)
    name = f"{len(table)} frames, {' and '.join(':'.join(map(str, row)) for row in table)}"
    X = frames[:, np.newaxis].astype(np.int64)
    weights = table[frames, labels].astype(np.float64)
    return HardSet(name, X, labels, table.shape[1], int(len(table) == 2), weights)


def imbalanced(ratio: int) -> HardSet:
    """Return two frames: on one the ratio of the classes is `ratio` to 1, on the other 1 to 1."""
    return contradictory([[ratio, 1], [1, 1]])


def hard_scores(rng: np.random.Generator, n: int) -> Iterator[Floats]:
    """Yield scores (K, columns) of 2 to 33 classes: equal, almost equal, 1e4 apart, and of every size between."""
    for number in range(n):
        classes = int(rng.choice([2, 3, 5, 14, 33]))
        size = 10.0 ** float(rng.uniform(-16, 4))
        scores = rng.normal(0, size, (classes, 6))
        scores[:, 0] = 1e4 * (number % 2)
        scores[:, 1] = 1.0 + np.spacing(1.0) * rng.integers(0, 2, classes)
        scores[:, 2] = np.where(np.arange(classes) == number % classes, 1e4, -1e4)
        scores[:, 3] = np.linspace(-746, 0, classes)
        yield scores
