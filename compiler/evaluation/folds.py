"""Folds: stratified exactly as in Weka 3.6, and folds that keep related rows on the same side of the split."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thenar.drivers.errors import ThenarError


class EvaluationError(ThenarError, ValueError):
    """The set cannot be split or compared as requested: too few rows, subjects or blocks, or an unknown name."""


_MULTIPLIER = 0x5DEECE66D
_INCREMENT = 0xB
_MASK = (1 << 48) - 1


class JavaRandom:
    """The 48-bit linear congruential generator of java.util.Random, seeded as `new Random(seed)`."""

    def __init__(self, seed: int) -> None:
        self._state = (seed ^ _MULTIPLIER) & _MASK

    def next_bits(self, bits: int) -> int:
        """Return the next `bits` (1 to 32) random bits, as a non-negative number."""
        self._state = (self._state * _MULTIPLIER + _INCREMENT) & _MASK
        return self._state >> (48 - bits)

    def next_int(self, bound: int) -> int:
        """Return a uniform integer in [0, bound), as nextInt(bound); ValueError unless 0 < bound < 2^31."""
        if not 0 < bound < 1 << 31:
            raise ValueError(f"bound {bound} is not in 1..2147483647")
        if bound & (bound - 1) == 0:
            return bound * self.next_bits(31) >> 31
        while True:
            drawn = self.next_bits(31)
            remainder = drawn % bound
            # The last, incomplete run of `bound` numbers below 2^31 would favour small remainders: draw again.
            if drawn - remainder + bound <= 1 << 31:
                return remainder

    def shuffle(self, items: list[int]) -> None:
        """Shuffle `items` in place: for i from the end down to 1, swap items i and nextInt(i + 1)."""
        for i in range(len(items) - 1, 0, -1):
            j = self.next_int(i + 1)
            items[i], items[j] = items[j], items[i]


Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """Row numbers to train on, in training order, and row numbers to test on. Compared by identity."""

    train: Rows
    test: Rows
    name: str

    def of(self, rows: Rows) -> "Fold":
        """Return this fold of a part with rows `rows` (n_part,) as a fold of the whole."""
        return Fold(rows[self.train], rows[self.test], self.name)


def weka_folds(labels: ArrayLike, n_folds: int, seed: int) -> list[Fold]:
    """Return the folds of `weka -x n_folds -s seed` for labels (n,) in the order of the file.

    One generator shuffles all rows and then each fold's training part; classes are distributed as in Weka's `stratify`.
    A class with fewer rows than folds is missing from some test parts, as in Weka. Raises EvaluationError for fewer
    than two folds, or fewer rows than folds.
    """
    values = np.asarray(labels).tolist()
    check_cut(len(values), n_folds, "rows")
    random = JavaRandom(seed)
    order = list(range(len(values)))
    random.shuffle(order)
    order = _dealt(_grouped(order, values), n_folds)
    return [_cut(order, n_folds, fold, random) for fold in range(n_folds)]


def trial_folds(labels: ArrayLike, trials: NDArray[np.intp], n_folds: int, seed: int) -> list[Fold]:
    """Return stratified folds of rows (n,) that split no trial: rows with equal numbers in `trials` (n,) stay together.

    The trials, in the order of their first rows, are split as `weka_folds` splits rows; if each row is a separate
    trial, these are Weka's folds. The label of a trial is the smallest of its rows' labels. For a movement this is the
    grasp, since rows without one have the highest label. Raises EvaluationError as `weka_folds` does.
    """
    _, first, number = np.unique(trials, return_index=True, return_inverse=True)
    least = np.asarray(labels)[first]
    np.minimum.at(least, number, labels)
    order = np.argsort(first)
    number = np.argsort(order)[number]
    rows, starts = np.argsort(number, kind="stable"), np.concatenate([[0], np.cumsum(np.bincount(number))])
    check_cut(len(order), n_folds, "trials" if len(order) < len(number) else "rows")

    def expanded(chosen: Rows) -> Rows:
        return np.concatenate([rows[starts[trial] : starts[trial + 1]] for trial in chosen.tolist()])

    folds = weka_folds(least[order], n_folds, seed)
    return [Fold(expanded(fold.train), expanded(fold.test), fold.name) for fold in folds]


def check_cut(n_parts: int, n_folds: int, what: str) -> None:
    """Raise EvaluationError unless `n_parts` `what` can be split into `n_folds` non-empty folds."""
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


def leave_one_out(groups: NDArray[np.str_], what: str) -> list[Fold]:
    """Return one fold for each name in groups (n,): test on its rows, train on all others; in the order of names.

    `what` is the word for a group ("subject", "object"). Raises EvaluationError if there is only one.
    """
    names = np.unique(groups).tolist()
    if len(names) < 2:
        raise EvaluationError(
            f"leaving one {what} out needs two or more; all {len(groups)} rows are of {what} {', '.join(names)!r}"
        )
    return [_fold(groups == name, name) for name in names]


# With more groups than this, several are left out together.
_MOST_GROUPS = 10


def leave_groups_out(names: NDArray[np.generic], what: str, most: int = _MOST_GROUPS) -> list[Fold]:
    """Return the folds of `leave_one_out`; for more than `most` names in names (n,), `most` folds of several names."""
    found, number = np.unique(names, return_inverse=True)
    parts = names if len(found) <= most else number % most
    return leave_one_out(parts.astype(np.str_), what)


def block_folds(trials: NDArray[np.int64], n_folds: int) -> list[Fold]:
    """Return folds by recording block: the trial numbers (n,), in order, split into `n_folds` contiguous ranges.

    Neighbouring trials resemble each other (the glove has not moved on the hand); this split never trains on one and
    tests on the other, except at the borders. Raises EvaluationError if there are fewer trial numbers than folds.
    """
    numbers = np.unique(trials)
    if len(numbers) < 2:
        raise EvaluationError(
            f"all {len(trials)} rows have trial number {', '.join(map(str, numbers))}: blocks need trial numbers "
            "(name their column in columns.toml)"
        )
    check_cut(len(numbers), n_folds, "trial numbers")
    blocks = np.array_split(numbers, n_folds)
    return [_fold(np.isin(trials, block), _range(block)) for block in blocks]


def _fold(tested: NDArray[np.bool_], name: str) -> Fold:
    return Fold(train=_where(~tested), test=_where(tested), name=name)


def _where(mask: NDArray[np.bool_]) -> Rows:
    return np.flatnonzero(mask)


def _range(block: NDArray[np.int64]) -> str:
    return f"trials {block[0]}-{block[-1]}" if len(block) > 1 else f"trial {block[0]}"
