"""Constant, equal, complementary and nearly constant columns; zero gains."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.placement.tree import grow_id3
from thenar.compiler.trainers.logitboost import boost

from ..finding import Finding
from ..inputs.small_sets import parity
from ..reference.information import compare_gains

_EXACT = "gains as products of whole numbers' powers"

Bits = NDArray[np.bool_]


def findings(full: bool) -> Iterator[Finding]:
    """Check every decision of trees on such columns, and what columns without information change."""
    sets = [hard_columns(seed) for seed in range(60 if full else 8)]
    yield _decisions(sets)
    yield _unchanged_by_useless_columns(sets)
    yield from _parities(range(2, 11 if full else 6))


def hard_columns(seed: int) -> tuple[Bits, NDArray[np.intp]]:
    """Return X (n, 14) and labels (n,): noise, a constant, duplicates, complements, columns that differ in one row."""
    random = np.random.default_rng(seed)
    rows = int(random.integers(20, 60))
    labels = random.integers(0, 4, rows)
    telling = (labels[:, np.newaxis] >> np.arange(2) & 1 != (random.random((rows, 2)) < 0.2)).astype(bool)
    noise = random.random((rows, 3)) < 0.5
    nearly = np.zeros((rows, 3), bool)
    nearly[random.integers(0, rows, 3), np.arange(3)] = True
    constant = np.ones((rows, 1), bool)
    X = np.hstack([constant, telling, noise, nearly, ~telling, telling, ~nearly[:, :1]])
    return X[:, random.permutation(X.shape[1])], labels


def _decisions(sets: Sequence[tuple[Bits, NDArray[np.intp]]]) -> Finding:
    """Every decision takes the column of largest gain, the lowest-numbered of equal ones, and never a constant one."""
    wrong = Finding.of("decisions of ID3 that do not take the best column", _EXACT, 0, "decisions")
    for seed, (X, labels) in enumerate(sets):
        tree, rows_of = grow_id3(X, labels), {0: np.arange(len(X))}
        for number, node in enumerate(tree.nodes):
            rows = rows_of.pop(number)
            for value, child in zip(node.values, tree.children[number], strict=True):
                rows_of[child] = rows[X[rows, node.input] == value]
            if node.input is not None:
                wrong.see(node.input != _due(X[rows], labels[rows]), f"set {seed}, node {number}")
    return wrong


def _due(X: Bits, labels: NDArray[np.intp]) -> int | None:
    """Return the first varying column of the largest gain, by the reference."""
    best: tuple[int, list[list[int]]] | None = None
    for column, bits in enumerate(X.T):
        # The count of each label (rows) at each occurring value (columns).
        values, members = np.unique(bits), [labels == label for label in np.unique(labels)]
        table = [[int((member & (bits == value)).sum()) for value in values] for member in members]
        if len(values) > 1 and (best is None or compare_gains(table, best[1]) > 0):
            best = column, table
    return None if best is None else best[0]


def _unchanged_by_useless_columns(sets: Sequence[tuple[Bits, NDArray[np.intp]]]) -> Finding:
    """Constants, and later duplicates and complements, are never selected, and change no bit of an ensemble."""
    changed = Finding.of(
        "sets whose ensemble useless columns change", "the same, trained without them, bit for bit", 0, "sets"
    )
    for seed, (X, labels) in enumerate(sets):
        behind = np.hstack([X, ~X, X, np.zeros((len(X), 2), bool)])
        alone, padded = (boost(inputs, labels, 4, rounds=20)[0] for inputs in (X, behind))
        same = all(
            np.array_equal(getattr(alone, part), getattr(padded, part)) for part in ("columns", "thresholds", "values")
        )
        changed.see(not same or grow_id3(X, labels).nodes != grow_id3(behind, labels).nodes, f"set {seed}")
    return changed


def _parities(sizes: range) -> Iterator[Finding]:
    """The XOR of k switches: no gain before the last decision, but the tree still grows."""
    wrong = Finding.of("frames of an XOR that the tree gets wrong", "the XOR itself", 0, "frames")
    silent = Finding.of("decisions without a gain that the tree does not mark", "2^(k-1) - 1 of them", 0, "decisions")
    for k in sizes:
        grasp_set = parity(k)
        tree = grow_id3(grasp_set.switches, grasp_set.grasps)
        wrong.see(int((tree.predict(grasp_set.switches) != grasp_set.grasps).sum()), f"k = {k}", len(grasp_set))
        due = 2 ** (k - 1) - 1
        marked = tree.text().count("no input gains anything alone\n")
        silent.see(abs(marked - due) + abs(tree.n_zero_gain - due), f"k = {k}", due)
    yield from (wrong, silent)
