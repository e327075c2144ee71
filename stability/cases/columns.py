"""Constant, equal, complementary and nearly constant columns; zero gains; nearly equal gains."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.boosting.boost import boost
from thenar.compiler.placement.gain import best_position, compare_scores
from thenar.compiler.placement.id3 import grow_id3
from thenar.compiler.placement.tree import Tree

from ..finding import Case, Finding, Worst
from ..inputs.hard_data import Counts, node_of
from ..inputs.small_sets import parity
from ..reference.information import compare_gains

CASE = Case(
    title="Uninformative and duplicate columns",
    danger="rounding decides between equal columns, or a tree without a gain stops silently",
)

# Counts at which one row more or less vanishes in a double's sum of n ln n: one in 1e9.
_LARGE = 10**9
_EXACT = "gains as products of whole numbers' powers"

Bits = NDArray[np.bool_]


def findings(full: bool) -> Iterator[Finding]:
    """Check every decision of trees on such columns, all small tables, and tables of 1e9 rows."""
    sets = [hard_columns(seed) for seed in range(60 if full else 8)]
    yield _decisions(sets)
    yield _unchanged_by_useless_columns(sets)
    yield from _parities(range(2, 11 if full else 6))
    yield from _small_tables(15 if full else 8)
    yield _large_tables(40 if full else 4)


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
    wrong = Worst("decisions of ID3 that do not take the best column", _EXACT, 0, "decisions")
    for seed, (X, labels) in enumerate(sets):
        tree = grow_id3(X, labels)
        for number, rows in _rows_of_nodes(tree, X):
            if tree.nodes[number].input is not None:
                wrong.see(tree.nodes[number].input != _due(X[rows], labels[rows]), f"set {seed}, node {number}")
    return wrong.finding()


def _rows_of_nodes(tree: Tree, X: Bits) -> Iterator[tuple[int, NDArray[np.intp]]]:
    rows_of = {0: np.arange(len(X))}
    for number, node in enumerate(tree.nodes):
        rows = rows_of.pop(number)
        for value, child in zip(node.values, tree.children[number], strict=True):
            rows_of[child] = rows[X[rows, node.input] == value]
        yield number, rows


def _due(X: Bits, labels: NDArray[np.intp]) -> int | None:
    """Return the first varying column of the largest gain, by the reference."""
    best: tuple[int, list[list[int]]] | None = None
    for column in range(X.shape[1]):
        table = table_of(X[:, column], labels)
        if len(table[0]) > 1 and (best is None or compare_gains(table, best[1]) > 0):
            best = column, table
    return None if best is None else best[0]


def table_of(column: Bits, labels: NDArray[np.intp]) -> list[list[int]]:
    """Return the counts of each label (rows) at each occurring value (columns)."""
    values = np.unique(column)
    return [[int(((labels == label) & (column == value)).sum()) for value in values] for label in np.unique(labels)]


def _unchanged_by_useless_columns(sets: Sequence[tuple[Bits, NDArray[np.intp]]]) -> Finding:
    """Constants, and later duplicates and complements, are never selected, and change no bit of an ensemble."""
    changed = Worst(
        "sets whose ensemble useless columns change", "the same, trained without them, bit for bit", 0, "sets"
    )
    for seed, (X, labels) in enumerate(sets):
        behind = np.hstack([X, ~X, X, np.zeros((len(X), 2), bool)])
        alone, padded = (boost(inputs, labels, 4, rounds=20)[0] for inputs in (X, behind))
        same = all(
            np.array_equal(getattr(alone, part), getattr(padded, part)) for part in ("columns", "thresholds", "values")
        )
        changed.see(not same or grow_id3(X, labels).nodes != grow_id3(behind, labels).nodes, f"set {seed}")
    return changed.finding()


def _parities(sizes: range) -> Iterator[Finding]:
    """The XOR of k switches: no gain before the last decision, but the tree still grows."""
    wrong = Worst("frames of an XOR that the tree gets wrong", "the XOR itself", 0, "frames")
    silent = Worst("decisions without a gain that the tree does not mark", "2^(k-1) - 1 of them", 0, "decisions")
    for k in sizes:
        grasp_set = parity(k)
        tree = grow_id3(grasp_set.switches, grasp_set.grasps)
        wrong.see(int((tree.predict(grasp_set.switches) != grasp_set.grasps).sum()), f"k = {k}", len(grasp_set))
        due = 2 ** (k - 1) - 1
        marked = tree.text().count("no input gains anything alone\n")
        silent.see(abs(marked - due) + abs(tree.n_zero_gain - due), f"k = {k}", due)
    yield wrong.finding()
    yield silent.finding()


def _small_tables(most: int) -> Iterator[Finding]:
    """Compare all pairs of tables with two values and the same counts of two classes, up to `most` rows."""
    signs = Worst("wrong comparisons of two gains", _EXACT, 0, "pairs")
    ties = Worst("equal gains for which the lowest number does not win", _EXACT, 0, "pairs")
    for classes, tables in small_tables(most).items():
        for one, other in combinations(tables, 2):
            sign = compare_gains(one.tolist(), other.tolist())
            signs.see(compare_scores(one, other) != sign, f"classes {classes}: {one.tolist()} and {other.tolist()}")
            if sign == 0 and one.sum(axis=0).all() and other.sum(axis=0).all():
                found = [_best(*pair, numbers=n) for pair in ((one, other), (other, one)) for n in ((0, 1), (1, 0))]
                ties.see(found != [0, 1, 0, 1], f"classes {classes}: {one.tolist()} and {other.tolist()}")
    yield signs.finding()
    yield ties.finding()


def small_tables(most: int) -> dict[tuple[int, int], list[Counts]]:
    """Return all tables (2, 2) of 2 to `most` rows, by their class counts."""
    found = defaultdict(list)
    for a, b in product(range(1, most), repeat=2):
        if a + b <= most:
            found[a, b] = [np.array([[i, a - i], [j, b - j]]) for i in range(a + 1) for j in range(b + 1)]
    return found


def _best(one: Counts, other: Counts, numbers: tuple[int, int] = (0, 1)) -> int | None:
    """Return which of two inputs with these tables and numbers is selected: 0 or 1."""
    return best_position(node_of(one, other), np.array(numbers))


def _large_tables(draws: int) -> Finding:
    """Gains of tables of about 1e9 rows that differ by the cell of one row: only integers distinguish them."""
    wrong = Worst("wrong choices between gains that differ by one row in 10^9", _EXACT, 0, "pairs")
    for one, other in large_tables(draws):
        sign = compare_gains(one.tolist(), other.tolist())
        due = [0 if sign >= 0 else 1, 0 if sign <= 0 else 1]
        wrong.see([_best(one, other), _best(other, one)] != due, f"{one.tolist()} and {other.tolist()}")
    return wrong.finding()


def large_tables(draws: int) -> Iterator[tuple[Counts, Counts]]:
    """Yield pairs of tables (3, 2) with the same classes: a random table, or one without a gain, and one row moved."""
    random = np.random.default_rng(3)
    for _ in range(draws):
        table = random.integers(_LARGE // 10, _LARGE, (3, 2))
        independent = random.integers(1, 1000, (3, 1)) * random.integers(1, 1000, 2) * 1000
        for base in (table, independent, np.repeat(table[:, :1], 2, axis=1)):
            for label in range(3):
                moved = base.copy()
                moved[label] += [1, -1]
                yield base, moved
                # Compared with the same row moved the other way.
                turned = base.copy()
                turned[label] += [-1, 1]
                yield moved, turned
