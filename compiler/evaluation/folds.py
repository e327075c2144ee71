"""Four-fold stratified cross-validation exactly as Weka 3.6 cuts it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import EvaluationError
from .javarandom import JavaRandom

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """Row numbers to train on, in training order, and row numbers to test on. Compared by identity."""

    train: Rows
    test: Rows
    name: str

    def of(self, rows: Rows) -> "Fold":
        """Return this fold of a part, `rows` (n_part,), as a fold of the whole."""
        return Fold(rows[self.train], rows[self.test], self.name)


def weka_folds(labels: ArrayLike, n_folds: int, seed: int) -> list[Fold]:
    """Return the folds of `weka -x n_folds -s seed` for labels (n,) in the order of the file.

    One generator shuffles all rows and then, fold by fold, each training part; classes are dealt out as Weka's
    `stratify` does. A class of fewer rows than folds is missing from some test parts, as in Weka.
    Raises EvaluationError for fewer than two folds, or fewer rows than folds.
    """
    values = np.asarray(labels).tolist()
    check_cut(len(values), n_folds, "rows")
    random = JavaRandom(seed)
    order = list(range(len(values)))
    random.shuffle(order)
    order = _dealt(_grouped(order, values), n_folds)
    return [_cut(order, n_folds, fold, random) for fold in range(n_folds)]


def check_cut(n_parts: int, n_folds: int, what: str) -> None:
    """Raise EvaluationError unless `n_parts` `what` can be cut into `n_folds` folds that all have some."""
    if n_folds < 2:
        raise EvaluationError(f"{n_folds} fold(s) leave nothing to train on; ask for 2 or more")
    if n_parts < n_folds:
        raise EvaluationError(
            f"{n_parts} {what} cannot be cut into {n_folds} folds; record more or ask for fewer folds"
        )


def _grouped(order: list[int], labels: Sequence[object]) -> list[int]:
    """Bring rows of one class together by Weka's swaps, classes by first appearance. Not stable: swaps move others."""
    order = list(order)
    placed = 1
    while placed < len(order):
        label = labels[order[placed - 1]]
        for k in range(placed, len(order)):
            if labels[order[k]] == label:
                order[placed], order[k] = order[k], order[placed]
                placed += 1
        placed += 1
    return order


def _dealt(order: list[int], n_folds: int) -> list[int]:
    return [row for start in range(n_folds) for row in order[start::n_folds]]


def _cut(order: list[int], n_folds: int, fold: int, random: JavaRandom) -> Fold:
    size, larger = divmod(len(order), n_folds)
    start = fold * size + min(fold, larger)
    stop = start + size + (fold < larger)
    train = order[:start] + order[stop:]
    random.shuffle(train)
    return Fold(np.array(train, dtype=np.intp), np.array(order[start:stop], dtype=np.intp), str(fold + 1))
