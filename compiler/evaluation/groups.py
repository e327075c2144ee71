"""Folds that keep what belongs together on one side of the cut: a subject, an object, a block of the recording."""

import numpy as np
from numpy.typing import NDArray

from .errors import EvaluationError
from .folds import Fold, Rows, check_cut


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


def block_folds(trials: NDArray[np.int64], n_folds: int) -> list[Fold]:
    """Return folds by recording block: the trial numbers (n,), in order, cut into `n_folds` contiguous ranges.

    Neighbouring trials resemble each other (the glove has not moved on the hand); this cut never trains on one and
    tests on the other, but at the borders. Raises EvaluationError if there are fewer trial numbers than folds.
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
