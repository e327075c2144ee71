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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.names import level_name

from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples
from .gain import Counts, NodeCounts, best_position, first_of_most_gain, gain_bits
from .ports import PortCosts

# Normal noise passes the fence in one row of 40,000: six times the quartile. A type with fewer rows has no fence.
_QUARTILES, _FEWEST = 6, 8
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
    levels = (
        Element(column, code)
        for column, codes in enumerate(samples.taxels.T, samples.n_switches)
        for code in taxel_levels(codes, samples.labels, samples.n_classes, most or LEVELS)
    )
    return (*map(Element, range(samples.n_switches)), *levels)


def taxel_levels(codes: NDArray[np.uint16], labels: NDArray[np.intp], n_classes: int, most: int) -> tuple[int, ...]:
    """Return 1 to `most` ascending thresholds of codes (n,) in rows of classes `labels` (n,).

    Each is the largest code at which the bit is not set.
    """
    values, place = np.unique(_above_rest(codes, labels, n_classes), return_inverse=True)
    if len(values) == 1:
        # Codes that never occurred cannot be judged.
        return (int(values[0]),)
    counts = np.zeros((n_classes, len(values)), np.int64)
    np.add.at(counts, (labels, place), 1)
    splits, found = [_split(counts, 0, len(values))], list[int]()
    while splits and len(found) < most:
        start, at, stop, table = splits.pop(first_of_most_gain(np.array([table for *_, table in splits])))
        if found and not gain_bits(table):
            break
        found.append((int(values[at - 1]) + int(values[at])) // 2)
        parts = ((start, at), (at, stop))
        splits = sorted([*splits, *(_split(counts, *part) for part in parts if part[1] - part[0] > 1)])
    return tuple(sorted(found))


def _above_rest(codes: NDArray[np.uint16], labels: NDArray[np.intp], n_classes: int) -> NDArray[np.int64]:
    """Return the codes (n,), with those in the noise of rest replaced by the fence."""
    wide = codes.astype(np.int64)
    least, median, largest = np.sort(wide)[[0, (len(wide) - 1) // 2, -1]].tolist()
    sign = 1 if median - least <= largest - median else -1
    wide *= sign
    own = [np.sort(wide[labels == each]) for each in range(n_classes)]
    own = [rows for rows in own if len(rows) >= _FEWEST]
    nearest = min(map(_fence, own), default=0)
    resting = [rows for rows in own if rows[(len(rows) - 1) // 2] <= nearest]
    fence = _fence(np.sort(np.concatenate(resting))) if resting else nearest
    known = own and 2 * fence <= sign * (least + largest)
    return sign * (np.maximum(wide, fence) if known else wide)


def _fence(ascending: NDArray[np.int64]) -> int:
    low, median, high = (int(ascending[quarter * (len(ascending) - 1) // 4]) for quarter in (1, 2, 3))
    return median + _QUARTILES * (median - low if low > ascending[0] else high - median)


def _split(counts: Counts, start: int, stop: int) -> tuple[int, int, int, Counts]:
    """Return (start, at, stop, counts (K, 2)): the best threshold lies before value `at` of `start` to `stop` - 1."""
    inside = counts[:, start:stop]
    totals = inside.sum(axis=1)
    above = totals[:, np.newaxis] - np.cumsum(inside, axis=1)[:, :-1]
    places = np.arange(stop - start - 1)
    best = best_position(NodeCounts(totals, above, places), places) or 0
    return start, start + best + 1, stop, np.column_stack([totals - above[:, best], above[:, best]])


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
