"""From score tables to integer tables: one scale for all, fine, yet such that no sum can overflow.

Rounding every row to whole steps moves a score by at most (inputs + 1)/2 steps, half a step for the bias and for each
input's row. Two scores can therefore approach each other by at most inputs + 1 steps, and a frame whose best score
leads by more than that keeps its grasp type. This holds of every scale: a coarser one only makes a step worth more.

Firmware adds up what look-ups give: the sum of the rows of a few switches, or a row of a joint. Where it stores these
in entries of 8 bits, as what exceeds the least of the look-up and class, no look-up may span more than 255 steps. A
scale for that is some 4 steps per unit of score, where one for 16 bits is some 300.
"""

import math

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import FINEST_SCALE, IntegerTables

from ..boosting.stumps import winners
from .collapse import Floats, ScoreTables


def balance(tables: ScoreTables) -> ScoreTables:
    """Return tables of equal scores whose bias is spread over the joints' rows, as far as their ranges take it.

    What moves from the bias into all rows of a joint changes no score. A partial sum can reach |bias| plus the range of
    every input; with the bias gone it reaches no further than complete scores do, and there is nothing better.
    """
    if not tables.joint_rows:
        return tables
    lowest = np.stack([rows.min(axis=0) for rows in tables.joint_rows])
    spans = np.stack([rows.max(axis=0) for rows in tables.joint_rows]) - lowest
    # Each joint gives up its lowest row and the same share of its span; the share is such that the bias becomes zero.
    wanted, room = -tables.bias - lowest.sum(axis=0), spans.sum(axis=0)
    share = np.divide(wanted, room, out=np.zeros_like(room), where=room > 0).clip(0, 1)
    moved = lowest + share * spans
    rows = tuple(rows - shift for rows, shift in zip(tables.joint_rows, moved, strict=True))
    return ScoreTables(tables.bias + moved.sum(axis=0), tables.switch_rows, tables.thresholds, rows)


# The most consecutive switches that firmware looks up together in tables of narrow entries. Any so many, wherever a
# group of them may begin, keep the span; so fewer do as well.
GROUP_SIZE = 5

# Scales that `kindest_scale` tries, evenly spaced down to four fifths of the finest.
TRIED, _TRIED_OF_ALL = 32, 160


def finest_scale(tables: ScoreTables, limit: int, widest: int) -> float:
    """Return the largest double below FINEST_SCALE at which no sum of rounded rows exceeds `limit` and no look-up
    spans more than `widest`; 1 for tables of zeros.

    Rounded terms never fall as the scale grows, so neither do sums and spans, and bisection over the doubles is exact.
    """
    whole = reach(tables, 1.0, rounded=False)
    if whole == 0:
        return 1.0
    outer = _outermost(tables)
    fits, too_fine = 0.0, min((limit + tables.n_inputs + 2) / whole, FINEST_SCALE)
    while (middle := (fits + too_fine) / 2) not in (fits, too_fine):
        if reach(outer, middle) <= limit and span(outer, middle) <= widest:
            fits = middle
        else:
            too_fine = middle
    return fits


def kindest_scale(tables: ScoreTables, finest: float, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> float:
    """Return, of `finest` and scales a little coarser, the one at which the fewest rows, bits (n, s) and codes (n, j),
    change their class; of equal ones the finest.

    Where steps are coarse, whether a frame that many rows share changes its class is a matter of luck and not of how
    coarse they are. What is proved of rounding is proved at every scale.
    """
    scales = finest * (1 - np.arange(TRIED) / _TRIED_OF_ALL)
    scores = tables.scores(bits, codes)
    near = _leads(scores) * scales[-1] <= tables.n_inputs + 2  # no scale can change the others: quantise.py
    right, closed = winners(scores[near]), bits[near].astype(np.float64)
    columns = zip(tables.thresholds, codes[near].T, strict=True)
    bins = [np.searchsorted(steps, column) for steps, column in columns]
    changed = [np.count_nonzero(_whole_scores(tables, scale, closed, bins).argmax(axis=1) != right) for scale in scales]
    return float(scales[int(np.argmin(changed))])


def reach(tables: ScoreTables, scale: float, *, rounded: bool = True) -> float:
    """Return the largest absolute value that a partial sum of the scaled rows can take, in any order."""
    upper, lower = _extremes(tables, scale, rounded=rounded)
    return float(max(upper.sum(axis=0).max(), -lower.sum(axis=0).min()))


def span(tables: ScoreTables, scale: float) -> float:
    """Return the most that what a look-up gives a class can differ by: a joint's rows and zero, scaled and rounded, or
    the sums of some of GROUP_SIZE consecutive switches' rows.

    Zero, which `balance` puts between a joint's rows anyhow, is among them so that no span falls as the scale grows.
    """
    upper, lower = _extremes(tables, scale)
    switches, joints = np.split(upper[1:] - lower[1:], [len(tables.switch_rows)])
    # Sums of whole numbers are exact: so is the difference of two of them, GROUP_SIZE switches apart.
    sums = np.cumsum(np.vstack([np.zeros((GROUP_SIZE, len(tables.bias))), switches]), axis=0)
    groups = sums[GROUP_SIZE:] - sums[:-GROUP_SIZE]
    return float(np.vstack([groups, joints]).max(initial=0.0))


def _leads(scores: Floats) -> Floats:
    """Return by how much the best of each row of (n, K) leads the second best, (n,)."""
    second, best = np.partition(scores, -2, axis=1)[:, -2:].T
    leads: Floats = best - second
    return leads


def _whole_scores(tables: ScoreTables, scale: float, closed: Floats, bins: list[NDArray[np.intp]]) -> Floats:
    """Return the scores (n, K) of the tables in whole steps: closed (n, s) switches, and the bin (n,) of each joint."""
    # Sums of whole numbers are exact, in any order: a matrix product may add them up.
    scores: Floats = closed @ np.rint(tables.switch_rows * scale) + np.rint(tables.bias * scale)
    for rows, found in zip(tables.joint_rows, bins, strict=True):
        scores += np.rint(rows * scale)[found]
    return scores


def _outermost(tables: ScoreTables) -> ScoreTables:
    """Return the tables with each joint's largest and smallest rows alone: rounding keeps them outermost."""
    joint_rows = tuple(np.array([rows.max(axis=0), rows.min(axis=0)]) for rows in tables.joint_rows)
    return ScoreTables(tables.bias, tables.switch_rows, tables.thresholds, joint_rows)


def _extremes(tables: ScoreTables, scale: float, *, rounded: bool = True) -> tuple[Floats, Floats]:
    """Return the most and the least, zero included, that bias, switches and joints add: (1 + s + j, K) each."""
    upper = np.vstack([tables.bias, tables.switch_rows, *(rows.max(axis=0) for rows in tables.joint_rows)]) * scale
    lower = np.vstack([tables.bias, tables.switch_rows, *(rows.min(axis=0) for rows in tables.joint_rows)]) * scale
    if rounded:
        upper, lower = np.rint(upper), np.rint(lower)
    return np.maximum(upper, 0), np.minimum(lower, 0)


Integers = NDArray[np.int16]


def quantise(
    tables: ScoreTables,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    width: int = 16,
    entry_bits: int = 16,
) -> IntegerTables:
    """Return integer tables whose sums fit `width` bits (4 to 16), rounded half to even.

    bits (n, s) and codes (n, j) are the rows trained on; their mean contributions stand in for missing inputs. No
    look-up, a joint or up to GROUP_SIZE consecutive switches, spans more than 2^entry_bits - 1 steps in any class. With
    16 that is no limit, as sums of 16 bits span no more, and the scale is the finest; with fewer it is the kindest.
    """
    balanced = balance(tables)
    scale = finest_scale(balanced, 2 ** (width - 1) - 1, 2**entry_bits - 1)
    if entry_bits < 16:
        scale = kindest_scale(balanced, scale, bits, codes)
    switch_rows = _rounded(balanced.switch_rows, scale)
    switch_means = _rounded(balanced.switch_rows * _mean(bits.astype(np.int64))[:, np.newaxis], scale)
    thresholds, joint_rows, joint_means = [], [], []
    for column, steps, rows in zip(codes.T, balanced.thresholds, balanced.joint_rows, strict=True):
        merged_steps, merged_rows = _merged(steps, _rounded(rows, scale))
        thresholds.append(merged_steps)
        joint_rows.append(merged_rows)
        # A mean computed in floating point may round to just outside of what it is the mean of, and so of int16.
        mean = np.rint(_mean(rows[np.searchsorted(steps, column)]) * scale)
        joint_means.append(np.clip(mean, merged_rows.min(axis=0), merged_rows.max(axis=0)))
    return IntegerTables(
        bias=_rounded(balanced.bias, scale),
        switch_rows=switch_rows,
        thresholds=tuple(thresholds),
        joint_rows=tuple(joint_rows),
        switch_means=switch_means,
        joint_means=np.array(joint_means, np.int16).reshape(len(joint_means), len(tables.bias)),
        scale=scale,
    )


def _rounded(rows: Floats, scale: float) -> Integers:
    return np.rint(rows * scale).astype(np.int16)


def _merged(thresholds: NDArray[np.uint16], rows: Integers) -> tuple[NDArray[np.uint16], Integers]:
    """Return the joint's thresholds and rows without the thresholds that rounding has made meaningless."""
    kept = (rows[1:] != rows[:-1]).any(axis=1)
    return thresholds[kept], rows[np.concatenate([[True], kept])]


def _mean(rows: NDArray[np.int64] | Floats) -> Floats:
    """Return the mean (K,) of rows (n, K), summed exactly, so that it has the same bits on every machine."""
    return np.array([math.fsum(column) / len(rows) for column in rows.T])


def integer_scores(tables: IntegerTables, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.int32]:
    """Return the scores (n, K), in steps, of the kept switches (n, s) and the joints' codes (n, j)."""
    # No partial sum leaves int16 (IntegerTables), so nothing overflows; a product of small whole numbers is exact.
    scores = bits.astype(np.int32) @ tables.switch_rows.astype(np.int32) + tables.bias.astype(np.int32)
    for column, thresholds, rows in zip(codes.T, tables.thresholds, tables.joint_rows, strict=True):
        scores += rows[np.searchsorted(thresholds, column, side="left")]
    return scores
