"""Invariances: repeating, reordering or renaming the parts of a set must not change the trained model.

Exact invariances: the order of rows, constant and copied columns, order-preserving recoding of codes, weights times a
power of two, two swapped classes; and for ID3, which compares gains exactly, all of these except ties. Three or more
renumbered classes are summed in another order, and three times the rows are summed on another grid: then scores change
by rounding. Ties go to the lowest number, so that two trainings with renumbered columns may diverge, but only at stumps
that explain equally much.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import Stumps
from thenar.compiler.elementary import Floats
from thenar.compiler.model.collapse import collapse
from thenar.compiler.model.substitutes import fit_lost
from thenar.compiler.placement.id3 import grow_id3
from thenar.compiler.placement.tree import Tree
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.quantise import quantise
from thenar.runtime.model.tables import TIE, ScoreTables
from thenar.runtime.model.terms.base import HIGHEST_CODE

from ..checks.class_rounds import ClassRound, Step, branches, class_rounds, grown, step_of
from ..checks.rounds import counted
from ..finding import Case, Finding, Worst
from ..inputs.hard_data import HardSet, contradictory, intervals, noisy, separable, words
from ..reference.numbers import precisely


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """A set equivalent to another.

    inputs[i] is the new number of column i, classes[k] the new number of class k; the rows of the other set are the
    rows of this one at `rows`.
    """

    name: str
    hard: HardSet
    inputs: tuple[int, ...]
    classes: tuple[int, ...]


def _same(name: str, hard: HardSet, changed: HardSet) -> Change:
    return Change(name, changed, tuple(range(hard.X.shape[1])), tuple(range(hard.n_classes)))


def unweighted(hard: HardSet) -> HardSet:
    """Return the set without weights."""
    return replace(hard, weights=None)


def rows_in_another_order(hard: HardSet, rng: np.random.Generator) -> Change:
    """Shuffle the rows."""
    return _same("rows in another order", hard, with_rows(hard, rng.permutation(len(hard.labels))))


def rows_several_times(hard: HardSet, times: int) -> Change:
    """Repeat the whole set several times."""
    return _same(f"the set {times} times", hard, with_rows(hard, np.tile(np.arange(len(hard.labels)), times)))


def with_rows(hard: HardSet, rows: NDArray[np.intp]) -> HardSet:
    """Return the set of the rows at these indices."""
    weights = None if hard.weights is None else hard.weights[rows]
    return replace(hard, X=hard.X[rows], labels=hard.labels[rows], weights=weights)


def constant_columns(hard: HardSet) -> Change:
    """Insert a constant open switch first, and append a constant joint."""
    n, d = hard.X.shape
    X = np.column_stack([np.zeros(n, np.int64), hard.X, np.full(n, 77)])
    changed = replace(hard, X=X, n_switches=hard.n_switches + 1)
    return Change("a constant switch and joint more", changed, tuple(range(1, d + 1)), tuple(range(hard.n_classes)))


def copied_columns(hard: HardSet) -> Change:
    """Append a copy of every column as a joint: equal columns tie, and the lowest number wins."""
    return _same("columns twice", hard, replace(hard, X=np.column_stack([hard.X, hard.X])))


def codes_recoded(hard: HardSet, rng: np.random.Generator) -> Change:
    """Replace the codes of every joint by others in the same order, including 0 and the largest."""
    X = hard.X.copy()
    for column in range(hard.n_switches, X.shape[1]):
        values, ranks = np.unique(X[:, column], return_inverse=True)
        codes = np.sort(rng.choice(HIGHEST_CODE + 1, len(values), replace=False))
        codes[[0, -1]] = 0, HIGHEST_CODE
        X[:, column] = codes[ranks] if len(values) > 1 else X[:, column]
    return _same("codes recoded in order", hard, replace(hard, X=X))


def weights_scaled(hard: HardSet, power: int) -> Change:
    """Multiply all weights by a power of two."""
    weights = np.ones(len(hard.labels)) if hard.weights is None else hard.weights
    return _same(f"weights times 2^{power}", hard, replace(hard, weights=np.ldexp(weights, power)))


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


ROUNDS = 30


@dataclass(frozen=True, slots=True, eq=False)
class Learnt:
    """The result of `learn`."""

    tree: Tree
    stumps: Stumps
    losses: tuple[float, ...]
    tables: ScoreTables
    integers: IntegerTables


def learn(hard: HardSet, rounds: int = ROUNDS) -> Learnt:
    """Train all models on `hard`. ID3 does not use weights."""
    stumps, falling = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds, weights=hard.weights)
    tables = collapse(stumps, hard.n_switches)
    integers = fit_lost(quantise(tables, hard.bits, hard.codes), hard.bits, hard.codes, hard.labels)
    return Learnt(grow_id3(hard.X, hard.labels), stumps, falling, tables, integers)


def numbers(learnt: Learnt, inputs: Sequence[int], classes: Sequence[int]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield name and array of all trained parameters except thresholds, with inputs and classes in the given numbering.

    A stump or node of any other input has number -1.
    """
    place = {column: number for number, column in enumerate(inputs)}
    tables, integers, order = learnt.tables, learnt.integers, list(classes)
    n_switches = len(tables.switch_rows)
    switches = [column for column in inputs if column < n_switches]
    joints = [column - n_switches for column in inputs if column >= n_switches]
    columns = np.vectorize(lambda column: place.get(column, -1), otypes=[np.intp])(learnt.stumps.columns)
    yield "columns", columns[:, order]
    yield "outputs", learnt.stumps.values[:, order]
    yield "losses", np.array(learnt.losses)
    yield "tree", np.array([place.get(-1 if node.input is None else node.input, -1) for node in learnt.tree.nodes])
    yield "counts", _counts(learnt.tree, order)
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


Z_MAX = 3.0
SAME = "training on the original set"


class Followed:
    """A training on an unweighted set whose rounds are computed at 60 digits once, on demand.

    All changes of the set are compared with the same numbers.
    """

    def __init__(self, hard: HardSet, rounds: int) -> None:
        self.hard = hard
        self.stumps = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds)[0]
        self.scores = list(self.stumps.staged_scores(hard.X))
        self._given: dict[int, list[ClassRound]] = {}
        self._steps: dict[int, Step] = {}

    def given(self, number: int) -> list[ClassRound]:
        """Return the targets of the stumps of round `number`, from 0."""
        if number not in self._given:
            F = self.scores[number - 1] if number else np.zeros((len(self.hard.X), self.hard.n_classes))
            self._given[number] = class_rounds(F.tolist(), self.hard.labels.tolist(), Z_MAX)
        return self._given[number]

    def step(self, number: int, largest: float) -> Step:
        """Return the step of round `number`; |F| <= largest."""
        if number not in self._steps:
            places = zip(self.stumps.columns[number].tolist(), self.stumps.thresholds[number].tolist(), strict=True)
            parts = [branches(self.hard.X[:, column], threshold) for column, threshold in places]
            labels = self.hard.labels.tolist()
            self._steps[number] = step_of(self.given(number), parts, labels, self.stumps.shrinkage, Z_MAX)
        return self._steps[number].on_scores_of(largest)


class Partings:
    """Collects differences of scores and predictions between two trainings while their stumps are equal, and the
    difference in explained variation where their stumps first differ.

    After they have diverged at a tie no invariance holds: stumps that explain equally much are not the same stumps.
    """

    def __init__(self) -> None:
        self._apart = Worst("scores, renumbered or repeated, while stumps agree", SAME, 1.0, "x growth")
        self._winners = Worst("winners, except ties, while stumps agree", SAME, 0.0, "rows")
        self._diverged = Worst("variation explained by two stumps that first differ", "60 digits", 1.0, "x rounding")

    def findings(self) -> Iterator[Finding]:
        """Yield the findings."""
        return (worst.finding() for worst in (self._apart, self._winners, self._diverged))

    def see(self, training: Followed, change: Change) -> None:
        """Train on the other set without weights, and follow the rounds until the end or until the two diverge."""
        one, hard, of = training.stumps, training.hard, change.hard
        other = renumbered(boost(of.X, of.labels, of.n_classes, rounds=one.n_rounds)[0], change)
        alike: list[tuple[Floats, Floats]] = []
        for number, both in enumerate(zip(training.scores, other.staged_scores(hard.X), strict=True)):
            at = f"{hard.name}, {change.name}, round {number + 1}"
            if self._see_stumps(training, number, other, change, at):
                break
            alike.append(both)
            self._winners.see(_predicted_otherwise(*both), at, len(hard.X))
        self._see_scores(training, change, alike)

    def _see_scores(self, training: Followed, change: Change, alike: Sequence[tuple[Floats, Floats]]) -> None:
        """Compare the scores after rounds 1, 2, 4, 8 and so on, and after the last round whose stumps agree."""
        steps = [training.step(number, float(np.abs(both).max())) for number, both in enumerate(alike)]
        for number, (one, other) in enumerate(alike, 1):
            if number & (number - 1) == 0 or number == len(alike):
                at = f"{training.hard.name}, {change.name}, round {number}"
                self._apart.see(float((np.abs(one - other).ravel() / (2 * grown(steps[:number]))).max()), at)

    def _see_stumps(self, training: Followed, number: int, other: Stumps, change: Change, at: str) -> bool:
        """Return whether the stumps of round `number` differ; if so, record the difference in explained variation."""
        both = (training.stumps, other)
        places = [list(zip(of.columns[number].tolist(), of.thresholds[number].tolist(), strict=True)) for of in both]
        for k, (first, second) in enumerate(zip(*places, strict=True)):
            if first != second:
                given = training.given(number)[k]
                self._diverged.see(_doubt(training.hard, given, (first, second), len(change.hard.labels)), at)
        return places[0] != places[1]


def renumbered(other: Stumps, change: Change) -> Stumps:
    """Return the ensemble of a changed set with the original numbering of inputs and classes."""
    place = np.full(other.n_inputs, -1, np.int32)
    place[list(change.inputs)] = np.arange(len(change.inputs))
    order = list(change.classes)
    columns = place[other.columns[:, order]]
    return Stumps(len(change.inputs), columns, other.thresholds[:, order], other.values[:, order], other.shrinkage)


@precisely()
def _doubt(hard: HardSet, given: ClassRound, places: Sequence[tuple[int, float]], rows: int) -> float:
    """Return the difference of two stumps in explained variation, as a share of the tolerance of training.

    `rows` is the number of rows of the larger set, on which the rounding of its grid depends.
    """
    one, other = (given.explained(hard.X, *place) for place in places)
    return float(abs(one - other) / given.doubt(Z_MAX, rows / len(given.weights)))


def _predicted_otherwise(one: Floats, other: Floats) -> int:
    """Return the number of rows of scores (n, K) with different winners, except for ties in either."""
    rows, first, second = np.arange(len(one)), one.argmax(axis=1), other.argmax(axis=1)
    leads = one[rows, first] - one[rows, second], other[rows, second] - other[rows, first]
    return int(np.count_nonzero(np.minimum(*leads) > TIE))


CASE = Case(
    title="Scale-free facts",
    danger="the order of rows, columns or classes, copies, units or names of codes change the trained model",
)

_EXACT: dict[str, Callable[[HardSet, np.random.Generator], Change]] = {
    "rows in another order": rows_in_another_order,
    "a constant switch and a constant joint more": lambda hard, _: constant_columns(hard),
    "codes recoded in order": codes_recoded,
    "weights times 2^-1000 or 2^900": lambda hard, rng: weights_scaled(hard, int(rng.choice([-1000, 900]))),
    "every column twice": lambda hard, _: copied_columns(hard),
    "two classes swapped": classes_permuted,
}


def findings(full: bool) -> Iterator[Finding]:
    """Yield the effect of each change of a set on the trained models."""
    sets = list(hard_sets(12 if full else 1))
    yield from _exact(sets)
    yield from _tree(sets)
    yield from _near(sets, 40 if full else 8)


def hard_sets(draws: int) -> Iterator[HardSet]:
    """Yield sets with and without ties of columns, of 2 to 6 classes, separable, contradictory and noisy, draw by draw.

    The sets that are not random are the same objects at every draw, so they are trained once.
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
    before = {hard: learn(hard) for hard in dict.fromkeys(sets)}
    for name, change_of in _EXACT.items():
        rng = np.random.default_rng(1)
        worst = Worst(f"{name}: all trained parameters", SAME, 0.0, "arrays")
        for hard in sets:
            if change_of is not classes_permuted or hard.n_classes == 2:
                _see_exact(before[hard], change_of(hard, rng), worst)
        yield worst.finding()


def _see_exact(learnt: Learnt, change: Change, worst: Worst) -> None:
    inputs, classes = range(learnt.stumps.n_inputs), range(learnt.stumps.n_classes)
    new = numbers(learn(change.hard), change.inputs, change.classes)
    for (name, before), (_, after) in zip(numbers(learnt, inputs, classes), new, strict=True):
        worst.see(float(not np.array_equal(before, after)), f"{change.hard.name}, {change.name}: {name}")


def _tree(sets: list[HardSet]) -> Iterator[Finding]:
    """Check ID3: the same tree if classes or the number of copies change, the same predictions if columns do."""
    rng = np.random.default_rng(2)
    trees = Worst("ID3: classes renumbered, the set 3 times", "the tree of the original set", 0.0, "trees")
    rows = Worst("ID3: columns renumbered", "the most frequent class of each frame", 0.0, "rows")
    for hard in sets:
        inputs = _asked(hard)
        for change in (classes_permuted(hard, rng), rows_several_times(hard, 3)):
            trees.see(float(_asked(change.hard) != inputs), f"{hard.name}, {change.name}")
        change = columns_reversed(hard)
        predicted = grow_id3(change.hard.X, change.hard.labels).predict(change.hard.X).tolist()
        most = counted(unweighted(hard))
        for frame, prediction in zip(hard.X.tolist(), predicted, strict=True):
            own = most[tuple(frame)]
            rows.see(float(prediction != own.index(max(own))), hard.name)
    yield from (trees.finding(), rows.finding())


def _asked(hard: HardSet) -> list[tuple[int | None, tuple[int, ...]]]:
    """Return the input of each node of ID3's tree, and its values."""
    return [(node.input, node.values) for node in grow_id3(hard.X, hard.labels).nodes]


def _near(sets: list[HardSet], rounds: int) -> Iterator[Finding]:
    """Yield the changes by rounding, the reasons of divergence, and differing predictions until then."""
    rng, partings = np.random.default_rng(3), Partings()
    trainings = {hard: Followed(unweighted(hard), rounds) for hard in dict.fromkeys(sets)}
    for training in map(trainings.__getitem__, sets):
        hard = training.hard
        for change in (
            classes_permuted(hard, rng),
            rows_several_times(hard, 2),
            rows_several_times(hard, 3),
            columns_reversed(hard),
        ):
            partings.see(training, change)
    yield from partings.findings()
