"""Elements that a placement chooses from: switches, and levels of taxels. Each is one bit, set above a threshold.

Candidate levels of a taxel are found by splitting as C4.5 splits a number. First, of all thresholds between codes that
occur, take the one with the most information about the grasp type. Then, of the resulting intervals, split the one
whose best threshold has the most. Comparisons are exact; of equal thresholds the lowest is taken. A threshold lies
midway between the two codes. Splitting ends after `most` levels, or when no threshold adds information.

No level lies in the noise of a taxel at rest, where a bit would flicker: codes up to a fence count as rest. The fence
is four deviations from the median of the rows at rest. The deviation is that of the quartile away from the press, so
rows with a press do no harm; if noise is cut off there, as at 0, it is that of the other quartile. Rows at rest are
those of the grasp type with the nearest fence, and of all types whose median lies within that fence. A taxel rests at
the end of its code range that the median row is nearer to, or at the lower end if both are equally near. A fence past
the middle is ignored: such a taxel may never be at rest.
"""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import level_name

from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples
from .gain import Counts, error_bound, first_best, first_of_most_gain, gain_bits, n_log_n
from .ports import PortCosts

# Normal noise passes the fence in one row of 40,000: six times the quartile. A type with fewer rows has no fence.
_QUARTILES, _FEWEST = 6, 8
# Between the codes of two taxels, so that those of all can be numbered; codes that are counted together.
_SPAN, _TOGETHER = 1 << 18, 1 << 17
# Candidates of one taxel. iCub's, 5 x 4 folds, all of them: 1 level 83.5 %, 3 95.2, 5 96.7, 8 98.1.
LEVELS = 7


class Element(NamedTuple):
    """A bit: whether the code of a column exceeds `code`. The columns are the switches, then the taxels; for a switch,
    which is 0 or 1, the code is 0.
    """

    column: int
    code: int = 0


Elements = tuple[Element, ...]


def elements_of(samples: Samples, most: int | None = None) -> Elements:
    """Return the elements of these rows: every switch, then 1 to `most` levels of each taxel, in the order of codes."""
    step = max(1, _TOGETHER // len(samples.labels))
    parts = (samples.taxels[:, start : start + step] for start in range(0, samples.taxels.shape[1], step))
    several = [codes for part in parts for codes in levels_of(part, samples.labels, samples.n_classes, most or LEVELS)]
    levels = (Element(column, code) for column, codes in enumerate(several, samples.n_switches) for code in codes)
    return (*map(Element, range(samples.n_switches)), *levels)


class _Split(NamedTuple):
    """The best threshold of an interval of values: before value `at` of `start` to `stop` - 1.

    table  the counts (K, 2) below and above it; gain: rows times its information, in nats
    """

    start: int
    at: int
    stop: int
    table: Counts
    gain: float


def levels_of(taxels: NDArray[np.uint16], labels: NDArray[np.intp], n_classes: int, most: int) -> list[tuple[int, ...]]:
    """Return 1 to `most` ascending thresholds of each taxel, given its codes (n, t) in rows of classes `labels` (n,).

    Each threshold is the largest code at which the bit is not set.
    """
    n, t = taxels.shape
    # The values of one taxel after those of the other.
    first = np.arange(t + 1) * _SPAN
    keys, place = np.unique(_above_rest(taxels.T, labels, n_classes) + first[:-1, np.newaxis], return_inverse=True)
    counts = np.bincount(place.ravel() * n_classes + np.tile(labels, t), minlength=len(keys) * n_classes)
    below = np.zeros((len(keys) + 1, n_classes), np.int64)
    np.cumsum(counts.reshape(-1, n_classes), axis=0, out=below[1:])
    slack = error_bound(n, 3 * n_classes + 3, 4)
    ends = np.searchsorted(keys, first - _SPAN // 2).tolist()
    # Codes that never occurred cannot be judged.
    found = [[int(keys[start])] if stop - start == 1 else [] for start, stop in pairwise(ends)]
    parts = [(at, start, stop) for at, (start, stop) in enumerate(pairwise(ends)) if stop - start > 1]
    open_: dict[int, list[_Split]] = {at: [] for at, *_ in parts}
    while open_:
        for (at, *_), split in zip(parts, _splits(below, [part[1:] for part in parts], slack), strict=True):
            open_[at].append(split)
        parts = []
        for at, splits in list(open_.items()):
            splits.sort(key=lambda split: split.start)
            most_gain = max((split.gain for split in splits), default=0.0)
            close = [split for split in splits if split.gain >= most_gain - 2 * slack]
            one = first_of_most_gain(np.array([split.table for split in close])) if len(close) > 1 else 0
            tells = bool(close) and (not found[at] or most_gain > slack or gain_bits(close[one].table) > 0)
            if tells:
                best = splits.pop(splits.index(close[one]))
                found[at].append((int(keys[best.at - 1]) + int(keys[best.at])) // 2)
                halves = (at, best.start, best.at), (at, best.at, best.stop)
                parts += [half for half in halves if half[2] - half[1] > 1 and len(found[at]) < most]
            if not tells or len(found[at]) == most:
                del open_[at]
    return [tuple(sorted(code - at * _SPAN for code in codes)) for at, codes in enumerate(found)]


def _splits(below: Counts, parts: list[tuple[int, ...]], slack: float) -> list[_Split]:
    """Return the best threshold of each of several intervals of values, given the counts (values + 1, K) below each."""
    if not parts:
        return []
    starts, stops = np.array(parts).T
    part = np.repeat(np.arange(len(parts)), stops - starts - 1)
    ends = np.cumsum(stops - starts - 1)
    at = np.arange(len(part)) + (stops - ends)[part]
    totals = below[stops] - below[starts]
    under = below[at] - below[starts][part]
    over = totals[part] - under
    terms = n_log_n(np.arange(int(totals.sum(axis=1).max()) + 1))
    sizes = under.sum(axis=1), over.sum(axis=1)
    scores = (terms[under] + terms[over]).sum(axis=1) - terms[sizes[0]] - terms[sizes[1]]
    best = np.maximum.reduceat(scores, ends - (stops - starts - 1))
    close = np.flatnonzero(scores >= best[part] - 2 * slack)
    gains = best + terms[totals.sum(axis=1)] - terms[totals].sum(axis=1)
    found = []
    for rows, gain, start, stop in zip(
        np.split(close, np.searchsorted(close, ends[:-1])), gains.tolist(), starts.tolist(), stops.tolist(), strict=True
    ):
        tables = np.stack([under[rows], over[rows]], axis=2)
        one = first_best(tables.reshape(len(rows), -1), tables.sum(axis=1)) if len(rows) > 1 else 0
        found.append(_Split(start, int(at[rows[one]]), stop, tables[one], gain))
    return found


def _above_rest(codes: NDArray[np.uint16], labels: NDArray[np.intp], n_classes: int) -> NDArray[np.int64]:
    """Return the codes (t, n) of taxels, with those in the noise of rest replaced by the fence."""
    wide = codes.astype(np.int64)
    least, median, largest = np.sort(wide)[:, [0, (wide.shape[1] - 1) // 2, -1]].T
    sign = np.where(median - least <= largest - median, 1, -1)
    wide *= sign[:, np.newaxis]
    own = [np.sort(wide[:, labels == each]) for each in range(n_classes)]
    own = [rows for rows in own if rows.shape[1] >= _FEWEST]
    if not own:
        return sign[:, np.newaxis] * wide
    nearest = np.min([_fence(rows, np.full(len(rows), rows.shape[1])) for rows in own], axis=0)
    rests = [rows[:, (rows.shape[1] - 1) // 2] <= nearest for rows in own]
    resting = [np.where(rest[:, np.newaxis], rows, _SPAN) for rest, rows in zip(rests, own, strict=True)]
    counts = np.sum([rest * rows.shape[1] for rest, rows in zip(rests, own, strict=True)], axis=0)
    fence = _fence(np.sort(np.concatenate(resting, axis=1)), counts)
    fenced = np.where(2 * fence <= sign * (least + largest), fence, -_SPAN)
    return sign[:, np.newaxis] * np.maximum(wide, fenced[:, np.newaxis])


def _fence(ascending: NDArray[np.int64], counts: NDArray[np.intp]) -> NDArray[np.int64]:
    """Return the fence (t,) of the first `counts` (t,) of ascending codes (t, n)."""
    quartiles = np.take_along_axis(ascending, np.arange(1, 4) * (counts - 1)[:, np.newaxis] // 4, axis=1)
    low, median, high = quartiles.T
    fence: NDArray[np.int64] = median + _QUARTILES * np.where(low > ascending[:, 0], median - low, high - median)
    return fence


def bits_of(samples: Samples, elements: Elements) -> Samples:
    """Return samples without taxels, whose switches are these elements, in their order."""
    if not samples.taxels.shape[1]:
        return samples if elements == elements_of(samples) else samples.keeping(columns_of(elements))
    return replace(samples, switches=above(samples.switches, samples.taxels, elements), taxels=samples.taxels[:, :0])


def above(switches: NDArray[np.bool_], taxels: NDArray[np.uint16], elements: Elements) -> NDArray[np.bool_]:
    """Return the bits (n, e) of these elements, of switches (n, s) and taxels (n, t)."""
    raw = np.hstack([switches, taxels], dtype=np.uint16)
    columns, codes = np.array(elements, np.int64).reshape(-1, 2).T
    bits: NDArray[np.bool_] = raw[:, columns] > codes
    return bits


def columns_of(elements: Elements) -> Columns:
    """Return the column of each element."""
    return tuple(element.column for element in elements)


def names_of(grasp_set: GraspSet, elements: Elements) -> tuple[str, ...]:
    """Return the names: a switch's name; for a level, the taxel's name and the code, as in "pad3>118"."""
    names, n_switches = grasp_set.element_names, len(grasp_set.switch_names)
    return tuple(names[column] if column < n_switches else level_name(names[column], code) for column, code in elements)


def ports_of(ports: PortCosts, elements: Elements) -> PortCosts:
    """Return the costs of reading the elements, given the `ports` of the columns; levels of one taxel share its
    conversion.
    """
    return PortCosts(tuple(ports.port_of[element.column] for element in elements), ports.us)
