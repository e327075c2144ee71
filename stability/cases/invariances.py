"""Facts without a scale: what a set says twice, in another order or in other words must not change an answer.

What is exact: the order of rows, constant and copied columns, codes recoded in order, weights times a power of two, two
classes swapped; and for ID3, which compares gains exactly, all of it but ties. Three and more classes add up in another
order when they are renumbered, and three times the rows lie on another grid: then scores move by rounding. Whatever
ties goes to the lowest number, so that renumbered columns may part two trainings, but on stumps that explain as much.
"""

from collections.abc import Callable, Iterator

import numpy as np

from thenar.compiler.placement.id3 import grow_id3

from ..checks.counted import counted
from ..checks.learnt import Learnt, learn, numbers
from ..checks.partings import SAME, Partings
from ..finding import Case, Finding, Worst
from ..inputs import changes
from ..inputs.changes import Change
from ..inputs.hard_data import HardSet, contradictory, intervals, noisy, separable, words

CASE = Case(
    title="Scale-free facts",
    danger="the order of rows, columns or classes, copies, units or names of codes decide what is learnt",
)

_EXACT: dict[str, Callable[[HardSet, np.random.Generator], Change]] = {
    "rows in another order": changes.rows_in_another_order,
    "a constant switch and a constant joint more": lambda hard, _: changes.constant_columns(hard),
    "codes recoded in order": changes.codes_recoded,
    "weights times 2^-1000 or 2^900": lambda hard, rng: changes.weights_scaled(hard, int(rng.choice([-1000, 900]))),
    "every column twice": lambda hard, _: changes.copied_columns(hard),
    "two classes swapped": changes.classes_permuted,
}


def findings(full: bool) -> Iterator[Finding]:
    """Yield what each change of a set changes in all that is learnt from it."""
    draws = 12 if full else 1
    sets = [hard for seed in range(draws) for hard in hard_sets(seed)]
    yield from _exact(sets)
    yield from _tree(sets)
    yield from _near(sets, 40 if full else 8)


def hard_sets(seed: int) -> Iterator[HardSet]:
    """Yield sets with and without ties of columns, of 2 to 6 classes, separable, contradictory and noisy."""
    rng = np.random.default_rng(seed)
    yield noisy(3, 16, 0.3, seed)
    yield noisy(2, 16, 0.5, seed)
    yield words(5)
    yield intervals(4)
    yield separable(3)
    yield contradictory([[5, 3, 1], [2, 9, 4]])
    both = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    yield HardSet("both switches of two", both, both.min(axis=1), 2, 2)
    X = np.column_stack([rng.integers(0, 2, (14, 4)), rng.integers(0, 3, (14, 1))])
    yield HardSet(f"random, draw {seed}", X, rng.integers(0, 6, 14), 6, 4)


def _exact(sets: list[HardSet]) -> Iterator[Finding]:
    """Yield, change by change, how many of the arrays that are learnt change in any bit."""
    before = [learn(hard) for hard in sets]
    for name, change_of in _EXACT.items():
        rng = np.random.default_rng(1)
        worst = Worst(f"{name}: all that is learnt", SAME, 0.0, "arrays")
        for hard, learnt in zip(sets, before, strict=True):
            if change_of is not changes.classes_permuted or hard.n_classes == 2:
                _see_exact(learnt, change_of(hard, rng), worst)
        yield worst.finding()


def _see_exact(learnt: Learnt, change: Change, worst: Worst) -> None:
    inputs, classes = range(learnt.stumps.n_inputs), range(learnt.stumps.n_classes)
    new = numbers(learn(change.hard), change.inputs, change.classes)
    for (name, before), (_, after) in zip(numbers(learnt, inputs, classes), new, strict=True):
        worst.see(float(not np.array_equal(before, after)), f"{change.hard.name}, {change.name}: {name}")


def _tree(sets: list[HardSet]) -> Iterator[Finding]:
    """What ID3 answers: its tree where classes or the number of copies change, its rows' classes where columns do."""
    rng = np.random.default_rng(2)
    trees = Worst("ID3: classes renumbered, the set 3 times", "the tree of the set as it was", 0.0, "trees")
    rows = Worst("ID3: columns renumbered", "the most frequent class of each frame", 0.0, "rows")
    for hard in sets:
        inputs = _asked(hard)
        for change in (changes.classes_permuted(hard, rng), changes.rows_several_times(hard, 3)):
            trees.see(float(_asked(change.hard) != inputs), f"{hard.name}, {change.name}")
        change = changes.columns_reversed(hard)
        answers = grow_id3(change.hard.X, change.hard.labels).predict(change.hard.X).tolist()
        most = counted(changes.unweighted(hard))
        for frame, answer in zip(hard.X.tolist(), answers, strict=True):
            own = most[tuple(frame)]
            rows.see(float(answer != own.index(max(own))), hard.name)
    yield from (trees.finding(), rows.finding())


def _asked(hard: HardSet) -> list[tuple[int | None, tuple[int, ...]]]:
    """Return what each node of ID3's tree asks for, and the values it meets there."""
    return [(node.input, node.values) for node in grow_id3(hard.X, hard.labels).nodes]


def _near(sets: list[HardSet], rounds: int) -> Iterator[Finding]:
    """What moves by rounding: how far, why trainings part if they do, and that rows get the same class until then."""
    rng, partings = np.random.default_rng(3), Partings()
    for hard in map(changes.unweighted, sets):
        partings.see(hard, changes.classes_permuted(hard, rng), rounds)
        partings.see(hard, changes.rows_several_times(hard, 2), rounds)
        partings.see(hard, changes.rows_several_times(hard, 3), rounds)
        partings.see(hard, changes.columns_reversed(hard), rounds)
    yield from partings.findings()
