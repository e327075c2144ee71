"""Trials: rows told apart by what several columns say, gaps filled from the same trial, many frames reduced to one."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_DIGITS = re.compile(r"(\d+)")


def natural_key(text: str) -> tuple[object, ...]:
    """Return what `text` is sorted by where numbers count as such: "T2" before "T10"."""
    parts = _DIGITS.split(text.casefold())
    # Digits by their length, then as text: int() takes no more than 4,300 of them.
    return (
        *((len(part.lstrip("0")), part.lstrip("0")) if odd % 2 else (-1, part) for odd, part in enumerate(parts)),
        text,
    )


def numbered(columns: Sequence[NDArray[np.str_]]) -> tuple[NDArray[np.int64], list[str]]:
    """Return a number (n,) from 1 for each row, equal where all `columns` (n,) are, and their texts in that order."""
    parts = [np.unique(column, return_inverse=True) for column in columns]
    pairs, number = np.unique(np.stack([inverse for _, inverse in parts], axis=1), axis=0, return_inverse=True)
    texts = [[str(found[place]) for (found, _), place in zip(parts, pair, strict=True)] for pair in pairs.tolist()]
    order = sorted(range(len(texts)), key=lambda row: [natural_key(text) for text in texts[row]])
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(1, len(order) + 1)
    return rank[number.reshape(-1)], [" ".join(texts[row]) for row in order]


def groups(*columns: NDArray[np.generic]) -> NDArray[np.intp]:
    """Return a number (n,) for each row, equal exactly where all `columns` (n,) are."""
    inverses = [np.unique(column, return_inverse=True)[1] for column in columns]
    return np.unique(np.stack(inverses, axis=1), axis=0, return_inverse=True)[1].reshape(-1)


def in_time(trials: NDArray[np.intp], time: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the rows (n,) such that each trial keeps its places and its frames in them are in the order of `time`."""
    order = np.empty(len(trials), np.intp)
    order[np.argsort(trials, kind="stable")] = np.lexsort((time, trials))
    return order


def fill(values: NDArray[np.generic], missing: NDArray[np.bool_], trials: NDArray[np.intp]) -> int:
    """Fill the `missing` (n,) of `values` (n,), in place, from the nearest frame of the same trial, of two the earlier.

    Where the trial has none, the lower median of all that are there. Returns how many were filled so. Labels are not
    looked at.
    """
    order = np.argsort(trials, kind="stable")
    there, trial, place = ~missing[order], trials[order], np.arange(len(order))
    before = np.maximum.accumulate(np.where(there, place, -1))
    after = np.minimum.accumulate(np.where(there, place, len(order))[::-1])[::-1]
    has_before = (before >= 0) & (trial[before] == trial)
    has_after = (after < len(order)) & (trial[np.minimum(after, len(order) - 1)] == trial)
    nearest = np.where(has_before & (~has_after | (place - before <= after - place)), before, after)
    known = has_before | has_after
    present = np.sort(values[~missing])
    filled = np.full(len(order), present[(len(present) - 1) // 2])
    filled[known] = values[order][nearest[known]]
    values[order[~there]] = filled[~there]
    return int((~there & ~known).sum())


class Frames:
    """The frames of each trial: rows in their order, where each trial starts, and its middle frame."""

    def __init__(self, trials: NDArray[np.intp]) -> None:
        self.order = np.argsort(trials, kind="stable")
        self._trials = trials[self.order]
        self._starts = np.flatnonzero(np.diff(self._trials, prepend=-1))
        self._middles = self._starts + (np.diff(self._starts, append=len(trials)) - 1) // 2
        self.middle: NDArray[np.intp] = np.sort(self.order[self._middles])
        # Trials in the order of their middle frames.
        self._sorted = np.argsort(self.order[self._middles])

    def median(self, values: NDArray[np.generic]) -> NDArray[np.generic]:
        """Return the lower median (trials,) of `values` (n,): a value that occurred; of switches what most are."""
        column = values[self.order]
        return column[np.lexsort((column, self._trials))][self._middles][self._sorted]

    def any(self, bits: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return (trials,) whether any of `bits` (n,) is set."""
        return np.logical_or.reduceat(bits[self.order], self._starts)[self._sorted]


def otsu(values: NDArray[np.float64]) -> float:
    """Return the threshold that parts `values` into two classes of least variance within (Otsu 1979).

    It lies half-way between two neighbouring ones of the finite `values`; where there is one, it is that.
    """
    found, counts = np.unique(values[np.isfinite(values)], return_counts=True)
    if len(found) < 2:
        return float(found[0]) if len(found) else 0.0
    # In units of the range, from its foot: what is squared stays finite.
    scaled = (found / 2 - found[0] / 2) / (found[-1] / 2 - found[0] / 2)
    below, total = np.cumsum(counts)[:-1], counts.sum()
    sums = np.cumsum(scaled * counts)
    between = (sums[-1] * below - sums[:-1] * total) ** 2 / (below * (total - below))
    best = int(np.argmax(between))
    return float(found[best] / 2 + found[best + 1] / 2)
