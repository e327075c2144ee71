"""Trials: number rows by the values of several columns, fill gaps within a trial, and reduce frames to one row."""

import re
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

_DIGITS = re.compile(r"(\d+)")


def natural_key(text: str) -> tuple[list[tuple[int, str]], str]:
    """Return a sort key for `text` that orders numbers by value: "T2" before "T10"."""
    parts = enumerate(_DIGITS.split(text.casefold()))
    # Digits by length, then as text: int() takes at most 4,300 of them.
    return [(len(part.lstrip("0")), part.lstrip("0")) if odd % 2 else (-1, part) for odd, part in parts], text


def numbered(columns: Sequence[NDArray[np.str_]]) -> tuple[NDArray[np.int64], list[str]]:
    """Return a number (n,) from 1 for each row, equal where all `columns` (n,) are, and the texts in that order."""
    number = groups(*columns)
    first = np.unique(number, return_index=True)[1]
    texts = [[str(column[row]) for column in columns] for row in first.tolist()]
    order = sorted(range(len(texts)), key=lambda row: [natural_key(text) for text in texts[row]])
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(1, len(order) + 1)
    return rank[number], [" ".join(texts[row]) for row in order]


def groups(*columns: NDArray[np.generic]) -> NDArray[np.intp]:
    """Return a number (n,) for each row from 0 in the order of first appearance, equal where all `columns` (n,) are."""
    ids = np.zeros(len(columns[0]), np.intp)
    for column in columns:
        _, part = np.unique(column, return_inverse=True)
        # Renumber densely at once: the product of all counts may overflow.
        ids = np.unique(ids * (part.max(initial=0) + 1) + part, return_inverse=True)[1]
    _, first, ids = np.unique(ids, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[ids]


# A stream has at least this many rows per run.
_RUN = 5


def in_runs(*columns: NDArray[np.generic]) -> bool:
    """Return whether rows lie in runs in which all `columns` (n,) are constant, as in a stream."""
    changes = np.logical_or.reduce([column[1:] != column[:-1] for column in columns])
    return _RUN * (int(np.count_nonzero(changes)) + 1) <= len(columns[0])


def restarts(ids: NDArray[np.intp], time: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return numbers (n,) from 1 that increase by one where `ids` (n,) change or the clock `time` (n,) starts again.

    It does where it falls by a usual step or more, to before the middle of what has passed since it last began. Times
    that are repeated, or fall less, are those of a clock that is coarse or jitters.
    """
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    begins = np.diff(ids, prepend=-1) != 0
    begun = np.maximum.accumulate(np.where(begins, np.arange(len(ids)), 0))
    first = 0
    for row in np.flatnonzero((steps < 0) & (steps <= -usual)) + 1:
        first = max(first, int(begun[row]))
        if first < row and 2 * time[row] < time[first] + time[row - 1]:
            begins[row], first = True, int(row)
    return np.cumsum(begins).astype(np.int64)


# Units of time by the words that name them, and the smallest step between two frames for each: frames come 2 to 2000
# times a second.
UNITS = {
    "s": ({"s", "sec", "secs", "second", "seconds", "sekunde", "sekunden"}, 0.0005, 0.5),
    "ms": ({"ms", "msec", "milli", "millis", "millisecond", "milliseconds"}, 2.0, 500.0),
    "us": ({"us", "usec", "µs", "μs", "micro", "micros", "microsecond", "microseconds"}, 500.0, 5e5),
    "ns": ({"ns", "nsec", "nano", "nanos", "nanosecond", "nanoseconds"}, 5e5, 5e8),
}


def unit_of_time(name: str, time: NDArray[np.float64]) -> Literal["s", "ms", "us", "ns"] | None:
    """Return the unit of times (n,) in a column called `name`, by its name or by the distance between frames.

    Return None if neither is conclusive, as for numbered frames.
    """
    words = {*re.findall(r"[^\W\d_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).casefold())}
    steps = np.diff(time)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    named = [unit for unit, (those, _, _) in UNITS.items() if words & those]
    # Numbers of frames have no unit, however far apart they are.
    numbered = words & {"frame", "frames", "bild"}
    found = named or [unit for unit, (_, least, most) in UNITS.items() if least <= step < most and not numbered]
    return found[0] if len(found) == 1 else None  # type: ignore[return-value]


def in_time(trials: NDArray[np.intp], time: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the rows (n,) ordered such that each trial keeps its places, with its frames in the order of `time`."""
    order = np.empty(len(trials), np.intp)
    order[np.argsort(trials, kind="stable")] = np.lexsort((time, trials))
    return order


def fill(values: NDArray[np.generic], missing: NDArray[np.bool_], trials: NDArray[np.intp]) -> int:
    """Fill the `missing` (n,) of `values` (n,) in place from the nearest frame of the same trial, the earlier of two.

    If the trial has none, use the lower median of all known values. Return the number of cells filled that way. Labels
    are not used.
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


def frame_of_each(
    trials: NDArray[np.intp], values: NDArray[np.generic] | None = None, largest: bool = False
) -> NDArray[np.intp]:
    """Return a row of each of the `trials` (n,), in the order of their middle frames.

    It is the middle frame; with `values` (n,) a frame with the lower median of them, for switches the majority, or with
    the largest.
    """
    order = np.argsort(trials, kind="stable")
    starts = np.flatnonzero(np.diff(trials[order], prepend=-1))
    sizes = np.diff(starts, append=len(trials))
    middles = starts + (sizes - 1) // 2
    by_value = order if values is None else np.lexsort((values, trials))
    chosen: NDArray[np.intp] = by_value[starts + sizes - 1 if largest else middles]
    return chosen[np.argsort(order[middles])]


def otsu(values: NDArray[np.float64]) -> float:
    """Return the threshold that splits `values` into two classes with the least variance within (Otsu 1979).

    It lies half-way between two neighbours among the finite `values`; if there is only one value, it is that.
    """
    found, counts = np.unique(values[np.isfinite(values)], return_counts=True)
    if len(found) < 2:
        return float(found[0]) if len(found) else 0.0
    # In units of the range, from its minimum, so that squares stay finite.
    scaled = (found / 2 - found[0] / 2) / (found[-1] / 2 - found[0] / 2)
    below, total = np.cumsum(counts)[:-1], counts.sum()
    sums = np.cumsum(scaled * counts)
    between = (sums[-1] * below - sums[:-1] * total) ** 2 / (below * (total - below))
    best = int(np.argmax(between))
    return float(found[best] / 2 + found[best + 1] / 2)
