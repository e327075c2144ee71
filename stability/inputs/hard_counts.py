"""Counts and bits that are hard for information gain: next to nothing to choose between, or everything."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.placement.gain import NodeCounts

Counts = NDArray[np.int64]
BitSet = tuple[NDArray[np.bool_], NDArray[np.intp], int]  # X (n, d), labels (n,), number of classes


def random_table(rng: np.random.Generator) -> Counts:
    """Return counts of all magnitudes up to 10^9, some of them none."""
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
    """Yield tables next to independence, next to certainty, and of one row in 10^9."""
    for m in (1, 10, 10**3, 10**6, 10**9):
        yield np.array([[m + 1, m - 1], [m, m]])
        yield np.array([[m, 0], [0, m]])
        yield np.array([[m, 1], [1, m]])
        yield np.array([[m, 0], [m, 1]])
        yield np.array([[m, m], [m, m]])


def equal_pairs() -> Iterator[tuple[Counts, Counts]]:
    """Yield tables of equal gains, whose terms differ."""
    for one, other in (
        ([[8, 0], [4, 4]], [[7, 1], [2, 6]]),
        ([[6, 0], [3, 3], [3, 3]], [[5, 1], [4, 2], [1, 5]]),
        ([[12, 0], [6, 6]], [[12, 0, 0], [6, 6, 0]]),
    ):
        for factor in (1, 10**3, 10**8):
            yield np.array(one) * factor, np.array(other) * factor


def close_pairs(rng: np.random.Generator, n: int) -> Iterator[tuple[Counts, Counts]]:
    """Yield tables of up to 10^9 rows a cell and the same class counts, of which one row lies elsewhere."""
    for _ in range(n):
        one = rng.integers(1, 10 ** int(rng.integers(1, 10)) + 1, (3, 2))
        other = one[:, ::-1].copy()
        if rng.random() < 0.8:
            row, moved = int(rng.integers(3)), int(rng.choice([-1, 1]))
            moved = min(max(moved, -int(other[row, 0])), int(other[row, 1]))
            other[row] += (moved, -moved)
        yield one, other


def bit_set(rng: np.random.Generator) -> BitSet:
    """Return 7 bits, some of them equal, opposite, constant and next to constant, of 2 to 8 classes."""
    n, classes = int(rng.integers(30, 3000)), int(rng.integers(2, 9))
    labels = rng.integers(0, classes, n)
    one, other = rng.random(n) < 0.3 + 0.1 * labels % 0.7, rng.random(n) < 0.5
    rare = np.arange(n) == n // 2
    return np.column_stack([one, ~one, one, other, one ^ other, rare, np.ones(n, bool)]), labels, classes
