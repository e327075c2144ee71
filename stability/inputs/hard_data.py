"""Training sets that are hard on the numbers, made by rule or drawn from a seed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.tables.collapse import HIGHEST_CODE

Floats = NDArray[np.float64]


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
    def scale(self) -> float:
        """The power of two by which training divides row weights, so that all are below 1."""
        return 1.0 if self.weights is None else float(np.ldexp(1.0, np.frexp(self.weights.max())[1]))

    @property
    def scaled_weights(self) -> Floats:
        """(n,) the row weights as training sees them."""
        return (
            np.ones(len(self.labels))
            if self.weights is None
            else np.ldexp(self.weights, -np.frexp(self.weights.max())[1])
        )

    @property
    def member(self) -> NDArray[np.bool_]:
        """(K, n) whether a row is of a class."""
        member: NDArray[np.bool_] = self.labels == np.arange(self.n_classes)[:, np.newaxis]
        return member


def separable(classes: int, rows_a_class: int = 2) -> HardSet:
    """Return a set in which every class closes a switch of its own: one stump parts it from all others."""
    labels = np.arange(classes).repeat(rows_a_class)
    X = (labels[:, np.newaxis] == np.arange(classes)).astype(np.int64)
    return HardSet(f"{classes} classes, a switch each", X, labels, classes, classes)


def intervals(classes: int, rows_a_class: int = 2) -> HardSet:
    """Return a set in which every class has an interval of one joint's codes: two stumps part an inner one."""
    labels = np.arange(classes).repeat(rows_a_class)
    codes = np.linspace(0, HIGHEST_CODE, len(labels)).astype(np.int64)[:, np.newaxis]
    return HardSet(f"{classes} classes along one joint", codes, labels, classes, 0)


def words(classes: int, rows_a_class: int = 2) -> HardSet:
    """Return a set whose switches spell the class's number in binary: many stumps together part a class."""
    labels = np.arange(classes).repeat(rows_a_class)
    n_switches = max(1, (classes - 1).bit_length())
    X = labels[:, np.newaxis] >> np.arange(n_switches) & 1
    return HardSet(f"{classes} classes in binary", X.astype(np.int64), labels, classes, n_switches)


def noisy(classes: int, rows: int, noise: float, seed: int) -> HardSet:
    """Return rows of prototypes with a tenth of the switches wrong and joints that overlap; a share `noise` of the
    labels is drawn anew.
    """
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, classes, rows)
    prototypes = rng.random((classes, 6)) < 0.4
    switches = prototypes[truth] ^ (rng.random((rows, 6)) < 0.1)
    joints = rng.integers(0, 40, (rows, 2)) + 9 * truth[:, np.newaxis]
    labels = np.where(rng.random(rows) < noise, rng.integers(0, classes, rows), truth).astype(np.intp)
    X = np.column_stack([switches, joints]).astype(np.int64)
    return HardSet(f"{classes} classes, {noise:.0%} of labels drawn anew", X, labels, classes, 6)


def contradictory(counts: Sequence[Sequence[int]]) -> HardSet:
    """Return frames, numbered by one switch if there are two, else by one joint, of counts[f][k] rows of class k each.

    A row stands for all that are equal to it, and weighs their number.
    """
    table = np.array(counts)
    frames, labels = np.nonzero(table)
    name = f"{len(table)} frames, {' and '.join(':'.join(map(str, row)) for row in table)}"
    X = frames[:, np.newaxis].astype(np.int64)
    weights = table[frames, labels].astype(np.float64)
    return HardSet(name, X, labels, table.shape[1], int(len(table) == 2), weights)


def imbalanced(ratio: int) -> HardSet:
    """Return two frames: on one the classes stand `ratio` to 1, on the other 1 to 1."""
    return contradictory([[ratio, 1], [1, 1]])


def repeated(weighted: HardSet) -> HardSet:
    """Return the same set with every row there as often as it weighs."""
    if weighted.weights is None:
        return weighted
    times = weighted.weights.astype(np.intp)
    name = f"{weighted.name}, {times.sum()} rows"
    return replace(
        weighted,
        name=name,
        X=weighted.X.repeat(times, axis=0),
        labels=weighted.labels.repeat(times),
        weights=None,
    )
