"""Numerically hard training sets, counts and scores, constructed by rule or random from a seed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats
from thenar.compiler.placement.gain import NodeCounts
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
    def scale(self) -> float:
        """The power of two by which training divides row weights, so that all are below 1."""
        return 1.0 if self.weights is None else float(np.ldexp(1.0, np.frexp(self.weights.max())[1]))

    @property
    def scaled_weights(self) -> Floats:
        """(n,) the scaled row weights used in training."""
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


Counts = NDArray[np.int64]
BitSet = tuple[NDArray[np.bool_], NDArray[np.intp], int]  # X (n, d), labels (n,), number of classes


def random_table(rng: np.random.Generator) -> Counts:
    """Return counts of all magnitudes up to 10^9, some of them 0."""
    shape = int(rng.integers(2, 15)), int(rng.integers(2, 5))
    counts = np.floor(10.0 ** rng.uniform(-1, 9, shape)).astype(np.int64)
    counts[0, 0] += 1
    return counts


def node_of(*tables: Counts) -> NodeCounts:
    """Return the node at which inputs have these tables (K, values), each of the same classes."""
    cells = np.concatenate([table[:, 1:] for table in tables], axis=1)
    starts = np.cumsum([0] + [table.shape[1] - 1 for table in tables])[:-1]
    return NodeCounts(tables[0].sum(axis=1), cells, starts)


def hand_made() -> Iterator[Counts]:
    """Yield tables close to independence, close to certainty, and with one row in 10^9."""
    for m in (1, 10, 10**3, 10**6, 10**9):
        yield np.array([[m + 1, m - 1], [m, m]])
        yield np.array([[m, 0], [0, m]])
        yield np.array([[m, 1], [1, m]])
        yield np.array([[m, 0], [m, 1]])
        yield np.array([[m, m], [m, m]])


def equal_pairs() -> Iterator[tuple[Counts, Counts]]:
    """Yield tables of equal gains with different terms."""
    for one, other in (
        ([[8, 0], [4, 4]], [[7, 1], [2, 6]]),
        ([[6, 0], [3, 3], [3, 3]], [[5, 1], [4, 2], [1, 5]]),
        ([[12, 0], [6, 6]], [[12, 0, 0], [6, 6, 0]]),
    ):
        for factor in (1, 10**3, 10**8):
            yield np.array(one) * factor, np.array(other) * factor


def close_pairs(rng: np.random.Generator, n: int) -> Iterator[tuple[Counts, Counts]]:
    """Yield tables of up to 10^9 rows a cell and the same class counts that differ by the cell of one row."""
    for _ in range(n):
        one = rng.integers(1, 10 ** int(rng.integers(1, 10)) + 1, (3, 2))
        other = one[:, ::-1].copy()
        if rng.random() < 0.8:
            row, moved = int(rng.integers(3)), int(rng.choice([-1, 1]))
            moved = min(max(moved, -int(other[row, 0])), int(other[row, 1]))
            other[row] += (moved, -moved)
        yield one, other


def bit_set(rng: np.random.Generator) -> BitSet:
    """Return 7 bits, some of them equal, opposite, constant and almost constant, of 2 to 8 classes."""
    n, classes = int(rng.integers(30, 3000)), int(rng.integers(2, 9))
    labels = rng.integers(0, classes, n)
    one, other = rng.random(n) < 0.3 + 0.1 * labels % 0.7, rng.random(n) < 0.5
    rare = np.arange(n) == n // 2
    return np.column_stack([one, ~one, one, other, one ^ other, rare, np.ones(n, bool)]), labels, classes


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
