"""Changes of a training set that say nothing new: the same rows, inputs and classes in other words."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.tables.collapse import HIGHEST_CODE

from .hard_data import HardSet


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """A set that says the same as another.

    inputs[i] is the column that was number i, classes[k] the number that class k has now, and the rows of the other set
    are those of this one at `rows`.
    """

    name: str
    hard: HardSet
    inputs: tuple[int, ...]
    classes: tuple[int, ...]


def _same(name: str, hard: HardSet, changed: HardSet) -> Change:
    return Change(name, changed, tuple(range(hard.X.shape[1])), tuple(range(hard.n_classes)))


def unweighted(hard: HardSet) -> HardSet:
    """Return the set with every row as good as any other."""
    return replace(hard, weights=None)


def rows_in_another_order(hard: HardSet, rng: np.random.Generator) -> Change:
    """Shuffle the rows."""
    return _same("rows in another order", hard, with_rows(hard, rng.permutation(len(hard.labels))))


def rows_several_times(hard: HardSet, times: int) -> Change:
    """Write the whole set several times over."""
    return _same(f"the set {times} times", hard, with_rows(hard, np.tile(np.arange(len(hard.labels)), times)))


def with_rows(hard: HardSet, rows: NDArray[np.intp]) -> HardSet:
    """Return the set of rows of these numbers."""
    weights = None if hard.weights is None else hard.weights[rows]
    return replace(hard, X=hard.X[rows], labels=hard.labels[rows], weights=weights)


def constant_columns(hard: HardSet) -> Change:
    """Put an open switch before all, and a silent joint behind."""
    n, d = hard.X.shape
    X = np.column_stack([np.zeros(n, np.int64), hard.X, np.full(n, 77)])
    changed = replace(hard, X=X, n_switches=hard.n_switches + 1)
    return Change("a constant switch and joint more", changed, tuple(range(1, d + 1)), tuple(range(hard.n_classes)))


def copied_columns(hard: HardSet) -> Change:
    """Put every column behind the others once more, as a joint: equal columns tie, and the lowest number wins."""
    return _same("columns twice", hard, replace(hard, X=np.column_stack([hard.X, hard.X])))


def codes_recoded(hard: HardSet, rng: np.random.Generator) -> Change:
    """Replace the codes of every joint by others in the same order, 0 and the largest among them."""
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
    """Number the classes in another order; two classes swap."""
    classes = rng.permutation(hard.n_classes) if hard.n_classes > 2 else np.array([1, 0])
    changed = replace(hard, labels=classes[hard.labels].astype(np.intp))
    return Change("classes numbered otherwise", changed, tuple(range(hard.X.shape[1])), tuple(classes.tolist()))


def columns_reversed(hard: HardSet) -> Change:
    """Number the switches from the last to the first, and the joints."""
    switches = np.arange(hard.n_switches)[::-1]
    joints = np.arange(hard.n_switches, hard.X.shape[1])[::-1]
    order = np.concatenate([switches, joints])
    changed = replace(hard, X=hard.X[:, order])
    inputs = tuple(np.argsort(order).tolist())
    return Change("columns in reverse", changed, inputs, tuple(range(hard.n_classes)))
