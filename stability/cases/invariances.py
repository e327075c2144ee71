"""Invariances: repeating, reordering or renaming the parts of a set must not change the trained model.

Exact invariances: the order of rows, constant and copied columns, order-preserving recoding of codes, weights times a
power of two, two swapped classes; and for ID3, which compares gains exactly, all of these except ties. Three or more
renumbered classes are summed in another order, three times the rows are summed on another grid, and of equal stumps in
renumbered columns another one has the lowest number: such trainings may diverge, but each round must be right for the
original set, too.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.model.collapse import collapse
from thenar.compiler.model.faults import fit_lost
from thenar.compiler.placement.tree import Tree, grow_id3
from thenar.compiler.trainers.logitboost import boost
from thenar.compiler.trainers.stumps import Stumps
from thenar.runtime.model.quantise import quantise
from thenar.runtime.model.terms.base import HIGHEST_CODE

from ..checks.rounds import moments, see_round
from ..finding import REFERENCE, Finding
from ..inputs.hard_data import HardSet, contradictory, intervals, noisy, separable, words

ROUNDS = 30
SAME = "training on the original set"


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """A set equivalent to another: inputs[i] is the new number of column i, classes[k] the new number of class k."""

    name: str
    hard: HardSet
    inputs: tuple[int, ...]
    classes: tuple[int, ...]

    @property
    def key(self) -> tuple[object, ...]:
        """All that a training depends on: the fixed sets change alike in many draws, and are trained once."""
        hard = self.hard
        numbers = (part.tobytes() for part in (hard.X, hard.labels, hard.row_weights))
        return *numbers, hard.n_switches, self.inputs, self.classes


def _same(name: str, hard: HardSet, changed: HardSet) -> Change:
    return Change(name, changed, tuple(range(hard.X.shape[1])), tuple(range(hard.n_classes)))


def rows_several_times(hard: HardSet, times: int) -> Change:
    """Repeat the whole set several times."""
    return _same(f"the set {times} times", hard, hard.rows(np.tile(np.arange(len(hard.labels)), times)))


def exact_changes(hard: HardSet, rng: np.random.Generator) -> Iterator[Change]:
    """Yield equivalent sets whose trained models must be the same to the last bit."""
    n, d = hard.X.shape
    yield _same("rows in another order", hard, hard.rows(rng.permutation(n)))
    # The switch is the first column, the joint the last.
    constant = np.column_stack([np.zeros(n, np.int64), hard.X, np.full(n, 77)])
    more = replace(hard, X=constant, n_switches=hard.n_switches + 1)
    name = "a constant switch and a constant joint more"
    yield Change(name, more, tuple(range(1, d + 1)), tuple(range(hard.n_classes)))
    # Other codes in the same order, among them 0 and the largest.
    X = hard.X.copy()
    for column in range(hard.n_switches, d):
        values, ranks = np.unique(X[:, column], return_inverse=True)
        codes = np.sort(rng.choice(HIGHEST_CODE + 1, len(values), replace=False))
        codes[[0, -1]] = 0, HIGHEST_CODE
        X[:, column] = codes[ranks] if len(values) > 1 else X[:, column]
    yield _same("codes recoded in order", hard, replace(hard, X=X))
    scaled = np.ldexp(hard.row_weights, int(rng.choice([-1000, 900])))
    yield _same("weights times 2^-1000 or 2^900", hard, replace(hard, weights=scaled))
    # Copies are joints. Equal columns tie, and the lowest number wins.
    yield _same("every column twice", hard, replace(hard, X=np.column_stack([hard.X, hard.X])))
    if hard.n_classes == 2:
        yield replace(classes_permuted(hard, rng), name="two classes swapped")


def classes_permuted(hard: HardSet, rng: np.random.Generator) -> Change:
    """Renumber the classes; two classes are swapped."""
    classes = rng.permutation(hard.n_classes) if hard.n_classes > 2 else np.array([1, 0])
    changed = replace(hard, labels=classes[hard.labels].astype(np.intp))
    return Change("classes numbered otherwise", changed, tuple(range(hard.X.shape[1])), tuple(classes.tolist()))


def columns_reversed(hard: HardSet) -> Change:
    """Reverse the numbers of the switches, and those of the joints."""
    switches = np.arange(hard.n_switches)[::-1]
    joints = np.arange(hard.n_switches, hard.X.shape[1])[::-1]
    order = np.concatenate([switches, joints])
    changed = replace(hard, X=hard.X[:, order])
    inputs = tuple(np.argsort(order).tolist())
    return Change("columns in reverse", changed, inputs, tuple(range(hard.n_classes)))


def numbers(change: Change) -> Iterator[tuple[str, NDArray[Any]]]:
    """Train all models on the changed set; yield name and array of all parameters except thresholds.

    Inputs and classes have the original numbers. A stump or node of any other input has number -1. ID3 does not use
    weights.
    """
    hard, inputs, order = change.hard, change.inputs, list(change.classes)
    stumps, losses = boost(hard.X, hard.labels, hard.n_classes, rounds=ROUNDS, weights=hard.weights)
    tables = collapse(stumps, hard.n_switches)
    integers = fit_lost(quantise(tables, hard.bits, hard.codes), hard.bits, hard.codes, hard.labels)
    tree = grow_id3(hard.X, hard.labels)
    place = {column: number for number, column in enumerate(inputs)}
    switches = [column for column in inputs if column < hard.n_switches]
    joints = [column - hard.n_switches for column in inputs if column >= hard.n_switches]
    yield "columns", renumbered(stumps, change).columns
    yield "outputs", stumps.values[:, order]
    yield "losses", np.array(losses)
    yield "tree", np.array([place.get(-1 if node.input is None else node.input, -1) for node in tree.nodes])
    yield "counts", _counts(tree, order)
    yield "bias", tables.bias[order]
    yield "switch rows", tables.switch_rows[switches][:, order]
    yield "joint rows", _stacked([tables.joint_rows[joint][:, order] for joint in joints], tables.bias)
    yield "scale", np.array(integers.scale)
    yield "integer bias", integers.bias[order]
    yield "integer switch rows", integers.switch_rows[switches][:, order]
    yield "integer joint rows", _stacked([integers.joint_rows[joint][:, order] for joint in joints], integers.bias)
    yield "stand-ins", np.concatenate([integers.switch_means[switches], integers.joint_means[joints]])[:, order]


def _counts(tree: Tree, order: list[int]) -> NDArray[np.int64]:
    """Return the number of rows by class at every node; a tree numbers only the classes that have rows."""
    counts = np.zeros((len(tree.nodes), len(order)), np.int64)
    counts[:, np.array(tree.classes, np.intp)] = [node.counts for node in tree.nodes]
    return counts[:, order]


def _stacked(rows: list[NDArray[Any]], like: NDArray[Any]) -> NDArray[Any]:
    return np.concatenate([np.zeros((0, like.size), like.dtype), *rows])


def renumbered(other: Stumps, change: Change) -> Stumps:
    """Return the ensemble of a changed set with the original numbering of inputs and classes."""
    place = np.full(other.n_inputs, -1, np.int32)
    place[list(change.inputs)] = np.arange(len(change.inputs))
    order = list(change.classes)
    columns = place[other.columns[:, order]]
    return Stumps(len(change.inputs), columns, other.thresholds[:, order], other.values[:, order], other.shrinkage)


def findings(full: bool) -> Iterator[Finding]:
    """Yield the effect of each change of a set on the trained models."""
    sets = list(hard_sets(12 if full else 1))
    yield from _exact(sets)
    yield from _tree(sets)
    yield from _near(sets, 40 if full else 8)


def hard_sets(draws: int) -> Iterator[HardSet]:
    """Yield sets with and without ties of columns, of 2 to 6 classes, separable, contradictory and noisy, draw by draw.

    The sets that are not random are the same at every draw.
    """
    both = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    fixed = (
        words(5),
        intervals(4),
        separable(3),
        contradictory([[5, 3, 1], [2, 9, 4]]),
        HardSet("both switches of two", both, both.min(axis=1), 2, 2),
    )
    for seed in range(draws):
        rng = np.random.default_rng(seed)
        yield noisy(3, 16, 0.3, seed)
        yield noisy(2, 16, 0.5, seed)
        yield from fixed
        X = np.column_stack([rng.integers(0, 2, (14, 4)), rng.integers(0, 3, (14, 1))])
        yield HardSet(f"random, draw {seed}", X, rng.integers(0, 6, 14), 6, 4)


def _exact(sets: list[HardSet]) -> Iterator[Finding]:
    """Yield, change by change, the number of trained arrays that differ in any bit."""
    rng = np.random.default_rng(1)
    trained: dict[tuple[object, ...], list[tuple[str, NDArray[Any]]]] = {}
    differ: dict[str, Finding] = {}
    for hard in sets:
        unchanged, *changes = _same("unchanged", hard, hard), *exact_changes(hard, rng)
        for change in (unchanged, *changes):
            if change.key not in trained:
                trained[change.key] = list(numbers(change))
        for change in changes:
            name = change.name
            worst = differ.setdefault(name, Finding.of(f"{name}: all trained parameters", SAME, 0.0, "arrays"))
            for (part, one), (_, other) in zip(trained[unchanged.key], trained[change.key], strict=True):
                worst.see(float(not np.array_equal(one, other)), f"{hard.name}: {part}")
    yield from differ.values()


def _tree(sets: list[HardSet]) -> Iterator[Finding]:
    """Check ID3: the same tree if classes or the number of copies change, the same predictions if columns do."""
    rng = np.random.default_rng(2)
    trees = Finding.of("ID3: classes renumbered, the set 3 times", "the tree of the original set", 0.0, "trees")
    rows = Finding.of("ID3: columns renumbered", "the most frequent class of each frame", 0.0, "rows")
    for hard in sets:
        inputs = _asked(hard)
        for change in (classes_permuted(hard, rng), rows_several_times(hard, 3)):
            trees.see(float(_asked(change.hard) != inputs), f"{hard.name}, {change.name}")
        change = columns_reversed(hard)
        predicted = grow_id3(change.hard.X, change.hard.labels).predict(change.hard.X).tolist()
        most = replace(hard, weights=None).counts()
        for frame, prediction in zip(hard.X.tolist(), predicted, strict=True):
            own = most[tuple(frame)]
            rows.see(float(prediction != own.index(max(own))), hard.name)
    yield from (trees, rows)


def _asked(hard: HardSet) -> list[tuple[int | None, tuple[int, ...]]]:
    """Return the input of each node of ID3's tree, and its values."""
    return [(node.input, node.values) for node in grow_id3(hard.X, hard.labels).nodes]


def _near(sets: list[HardSet], rounds: int) -> Iterator[Finding]:
    """Check that each round is right for the original set, given its scores before: stumps explain as much as the best.

    Sums of three copies are on a grid that is three times as coarse, with three times the rows.
    """
    rng = np.random.default_rng(3)
    chosen = Finding.of("stumps chosen, renumbered or repeated", REFERENCE, 3.0, "x rounding")
    outputs = Finding.of("outputs of branches, renumbered or repeated", REFERENCE, 1.0, "x rounding")
    trained: dict[tuple[object, ...], Stumps] = {}
    for weighted in sets:
        hard = replace(weighted, weights=None)
        for change in (
            classes_permuted(hard, rng),
            rows_several_times(hard, 2),
            rows_several_times(hard, 3),
            columns_reversed(hard),
        ):
            of = change.hard
            if change.key not in trained:
                stumps, _ = boost(of.X, of.labels, of.n_classes, rounds=rounds)
                trained[change.key] = renumbered(stumps, change)
            named, stumps = replace(hard, name=f"{hard.name}, {change.name}"), trained[change.key]
            for number, moment in enumerate(moments(named, stumps)):
                if number < rounds and number & (number + 1) == 0:
                    see_round(named, stumps, number, moment.scores, 3.0, chosen, outputs)
    yield from (chosen, outputs)
