"""Quantise score tables to integers: one scale for all rows, as fine as possible without overflow of any sum.

Rounding every row to whole steps moves a score by at most (inputs + 1)/2 steps, half a step for the bias and for each
input's row. Two scores can therefore approach each other by at most inputs + 1 steps, and a frame whose best score
leads by more than that keeps its grasp type. This holds for every scale: a coarser one only makes a step worth more.

Firmware adds the results of table lookups: the sum of the rows of a few switches, or a row of a joint. Where it stores
these in entries of 8 bits, as the excess over the minimum for the lookup and class, no lookup may span more than 255
steps. The scale is then about 4 steps per unit of score, compared with about 300 for 16 bits.

The row of a line becomes whole steps per distance from the middle of its range (runtime/tables.py), a byte each. This
moves a score by at most half a step times the largest distance, which is at most 127. Where tables have lines and
entries of 8 bits, the entries are the upper halves of steps: rows of switches and bins are rounded to multiples of 256
steps, and only lines and bias use the full resolution of 16-bit sums. The bias compensates the mean rounding error: x
times the error of a switch's row becomes (x - mean) times the error, which is no larger for x = 0 or 1. Such scores are
relative to the last class, so there is one class less to add up.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import COARSE, FINEST_SCALE, WIDEST, IntegerTables, Slope

from ..boosting.stumps import winners
from .collapse import Floats, Line, ScoreTables


def balance(tables: ScoreTables) -> ScoreTables:
    """Return tables of equal scores whose bias is spread over the joints' rows, as far as their ranges allow.

    Moving a constant from the bias into all rows of a joint changes no score. A partial sum can reach |bias| plus the
    range of every input; without bias it reaches no further than complete scores do, which is optimal. A line reaches
    least where its zero is in the middle of its range: rows here are taken there.
    """
    if not tables.joint_rows:
        return tables
    middles = np.zeros((len(tables.joint_rows), tables.n_classes))
    for line in tables.lines:
        middles[line.joint] = line.row * ((line.high - line.low) / 2)
    middle_rows = [rows + middle for rows, middle in zip(tables.joint_rows, middles, strict=True)]
    lowest = np.stack([rows.min(axis=0) for rows in middle_rows])
    spans = np.stack([rows.max(axis=0) for rows in middle_rows]) - lowest
    # Each joint gives up its lowest row and a common share of its span, chosen such that the bias becomes zero.
    wanted, room = -tables.bias - lowest.sum(axis=0), spans.sum(axis=0)
    share = np.divide(wanted, room, out=np.zeros_like(room), where=room > 0).clip(0, 1)
    moved = lowest + share * spans
    rows = tuple(rows - shift for rows, shift in zip(tables.joint_rows, moved, strict=True))
    return replace(tables, bias=tables.bias + moved.sum(axis=0), joint_rows=rows)


def as_deployed(tables: ScoreTables, grid: int) -> ScoreTables:
    """Return the tables before rounding to a `grid`: scores relative to the last class if rows are on one."""
    if grid == 1:
        return tables

    def less_last(rows: Floats) -> Floats:
        found: Floats = rows - rows[..., -1:]
        return found

    lines = tuple(replace(line, row=less_last(line.row)) for line in tables.lines)
    rows = tuple(map(less_last, tables.joint_rows))
    pairs = tuple(replace(pair, rows=less_last(pair.rows)) for pair in tables.pairs)
    bias, switch_rows = less_last(tables.bias), less_last(tables.switch_rows)
    return ScoreTables(bias, switch_rows, tables.thresholds, rows, lines, pairs)


def slope_of(line: Line, scale: float) -> tuple[Slope, Floats]:
    """Return a line in whole steps, without its row; and the exact row (K,) in steps per distance.

    Codes are divided by the smallest power of two that makes their range fit a byte, or multiplied by the smallest one
    that makes every entry of the row fit a byte, if there is one.
    """
    span, gain = line.high - line.low, 0
    while span >> -gain > WIDEST:
        gain -= 1
    while gain >= 0 and span << gain + 1 <= WIDEST and np.rint(np.abs(line.row).max() * scale / 2**gain) > _LARGEST:
        gain += 1
    none = np.zeros(len(line.row), np.int8)
    return Slope(line.joint, line.low, line.high, gain, none), np.rint(line.row * scale / 2.0**gain)


def offset_of(slope: Slope) -> float:
    """Return the distance from a slope's lowest code to its zero: the middle of the codes that share the zero distance,
    where codes are divided.
    """
    return slope.zero / 2.0**slope.gain + max(2.0**-slope.gain - 1, 0) / 2


# The most consecutive switches that firmware looks up together in tables of narrow entries. Every group of this many
# consecutive switches keeps the span, so smaller groups do as well.
GROUP_SIZE = 5

# Scales that `least_disruptive_scale` tries, evenly spaced down to four fifths of the finest.
TRIED, _TRIED_OF_ALL = 32, 160
_LARGEST = 127  # entry of a slope's row


def finest_scale(tables: ScoreTables, limit: float, widest: int, grid: int = 1) -> float:
    """Return the largest scale at which no sum exceeds `limit` and no lookup spans more than `widest`.

    It is a double below FINEST_SCALE; 1 for tables of zeros. Rounded terms never shrink as the scale grows, so neither
    do sums and spans, and bisection over the doubles is exact. With lines, or rows on a `grid`, the result is only one
    of the largest.
    """
    whole = reach(tables, 1.0, rounded=False)
    if whole == 0:
        return 1.0
    outer = _outermost(tables)
    most = limit + grid * (tables.n_inputs + len(tables.pairs) + 2) + WIDEST * len(tables.lines)
    fits, too_fine = 0.0, min(most / whole, FINEST_SCALE)
    while (middle := (fits + too_fine) / 2) not in (fits, too_fine):
        if reach(outer, middle, grid=grid) <= limit and (grid > 1 or span(outer, middle) <= widest):
            fits = middle
        else:
            too_fine = middle
    return fits


def least_disruptive_scale(
    tables: ScoreTables, finest: float, bits: NDArray[np.bool_], codes: NDArray[np.uint16], grid: int = 1
) -> float:
    """Return, of `finest` and slightly coarser scales, the one at which the fewest rows change class.

    The rows are bits (n, s) and codes (n, j); ties go to the finest scale. With coarse steps, whether a common frame
    changes its class depends on luck rather than on the scale. The bounds on rounding hold at every scale.
    """
    scales = finest * (1 - np.arange(TRIED) / _TRIED_OF_ALL)
    scores = tables.scores(bits, codes)
    most = max(rounding_error(tables, scale, grid) for scale in scales[[0, -1]].tolist())
    near = _leads(scores) * scales[-1] <= 2 * most + 1  # no scale can change the other rows: quantise.py
    right, closed = winners(scores[near]), bits[near].astype(np.float64)
    asked, means = codes[near], _mean(bits.astype(np.int64))
    changed = []
    for scale in scales.tolist():
        whole = _whole_scores(tables, scale, closed, asked, grid) + _whole_bias(tables, scale, grid, means)
        changed.append(np.count_nonzero(whole.argmax(axis=1) != right))
    return float(scales[int(np.argmin(changed))])


def rounding_error(tables: ScoreTables, scale: float, grid: int = 1) -> float:
    """Return the most steps by which rounding can move a score.

    It is half a step for the bias, for a joint's only row and for the row of a pair; half of the `grid` for the row of
    each switch and bin; and for each line half a step times the largest distance, plus the difference between codes
    that share a distance.
    """
    binned = sum(len(steps) > 0 for steps in tables.thresholds)
    error = (tables.n_inputs + len(tables.pairs) + 1 + (grid - 1) * (len(tables.switch_rows) + binned)) / 2
    for line in tables.lines:
        slope, _ = slope_of(line, scale)
        error += slope.zero / 2 + float(np.abs(line.row).max()) * scale * max(2.0**-slope.gain - 1, 0) / 2
    return error


def reach(tables: ScoreTables, scale: float, *, rounded: bool = True, grid: int = 1) -> float:
    """Return the largest absolute value of a partial sum of the scaled rows, in any order; infinity if an entry of a
    slope's row does not fit its byte.
    """
    upper, lower = _extremes(tables, scale, rounded=rounded, grid=grid)
    for line in tables.lines:
        slope, row = slope_of(line, scale)
        if rounded and np.abs(row).max() > _LARGEST:
            return math.inf
        row = row if rounded else line.row * scale / 2.0**slope.gain
        ends = np.stack([-slope.zero * row, (slope.most - slope.zero) * row])
        upper, lower = np.vstack([upper, ends.max(axis=0)]), np.vstack([lower, ends.min(axis=0)])
    return float(max(upper.sum(axis=0).max(), -lower.sum(axis=0).min()))


def span(tables: ScoreTables, scale: float) -> float:
    """Return the largest difference between results of one lookup for a class.

    A lookup returns a joint's row or zero, scaled and rounded, or the sum of the rows of some of GROUP_SIZE consecutive
    switches. Zero, which `balance` puts between a joint's rows anyway, is included so that no span shrinks as the scale
    grows.
    """
    upper, lower = _extremes(tables, scale)
    switches, joints = np.split(upper[1:] - lower[1:], [len(tables.switch_rows)])
    # Sums of integers are exact, and so is the difference of two of them, GROUP_SIZE switches apart.
    sums = np.cumsum(np.vstack([np.zeros((GROUP_SIZE, len(tables.bias))), switches]), axis=0)
    groups = sums[GROUP_SIZE:] - sums[:-GROUP_SIZE]
    return float(np.vstack([groups, joints]).max(initial=0.0))


def _leads(scores: Floats) -> Floats:
    """Return the lead (n,) of the best over the second best score in each row of (n, K)."""
    second, best = np.partition(scores, -2, axis=1)[:, -2:].T
    leads: Floats = best - second
    return leads


def _whole_scores(tables: ScoreTables, scale: float, closed: Floats, codes: NDArray[np.uint16], grid: int) -> Floats:
    """Return the scores (n, K) of the tables without the bias, in whole steps, for closed switches (n, s) and the
    joints' codes (n, j).
    """
    # Sums of integers are exact in any order, so a matrix product may add them up.
    scores: Floats = closed @ _whole(tables.switch_rows * scale, grid)
    for column, steps, rows in zip(codes.T, tables.thresholds, _middle_rows(tables, scale, grid), strict=True):
        scores += rows[np.searchsorted(steps, column)]
    for line in tables.lines:
        slope, row = slope_of(line, scale)
        scores += slope.distances(codes[:, line.joint])[:, np.newaxis] * row
    for pair in tables.pairs:
        scores += np.rint(pair.of(codes) * scale)
    return scores


def _whole_bias(tables: ScoreTables, scale: float, grid: int, means: Floats) -> Floats:
    """Return the bias in whole steps, with compensation for the mean error of rounding switches' rows to a `grid`.

    `means` (s,) are the shares of rows in which each switch is closed.
    """
    rows = tables.switch_rows * scale
    lost = means[:, np.newaxis] * (rows - _whole(rows, grid)) if grid > 1 else 0 * rows
    whole: Floats = np.rint(tables.bias * scale + [math.fsum(column) for column in lost.T])
    return whole


def _whole(rows: Floats, grid: int) -> Floats:
    whole: Floats = np.rint(rows / grid) * grid
    return whole


def _middle_rows(tables: ScoreTables, scale: float, grid: int, *, rounded: bool = True) -> list[Floats]:
    """Return the joints' rows (T_a + 1, K) in whole steps, at the zeros of their slopes.

    A joint's only row becomes part of the starting value and needs no grid.
    """
    middle = list(tables.joint_rows)
    for line in tables.lines:
        middle[line.joint] = middle[line.joint] + line.row * offset_of(slope_of(line, scale)[0])
    return [_whole(rows * scale, grid if len(rows) > 1 else 1) if rounded else rows * scale for rows in middle]


def _outermost(tables: ScoreTables) -> ScoreTables:
    """Return the tables with only each joint's largest and smallest rows: rounding keeps them extreme."""
    outer = (np.array([rows.max(axis=0), rows.min(axis=0)]) if len(rows) > 1 else rows for rows in tables.joint_rows)
    return replace(tables, joint_rows=tuple(outer))


def _extremes(tables: ScoreTables, scale: float, *, rounded: bool = True, grid: int = 1) -> tuple[Floats, Floats]:
    """Return the largest and smallest contributions, zero included, of bias, switches, joints (without their lines) and
    pairs: (1 + s + j + p, K) each.
    """
    bias, switches = tables.bias[np.newaxis] * scale, tables.switch_rows * scale
    if rounded:
        bias, switches = np.rint(bias), _whole(switches, grid)
    joints = _middle_rows(tables, scale, grid, rounded=rounded)
    pairs = (pair.rows.reshape(-1, tables.n_classes) * scale for pair in tables.pairs)
    joints += [np.rint(rows) if rounded else rows for rows in pairs]
    upper = np.vstack([bias, switches, *(rows.max(axis=0) for rows in joints)])
    lower = np.vstack([bias, switches, *(rows.min(axis=0) for rows in joints)])
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

    bits (n, s) and codes (n, j) are the training rows; their mean contributions replace missing inputs. No lookup (a
    joint, or up to GROUP_SIZE consecutive switches) spans more than 2^entry_bits - 1 steps in any class. With 16 bits
    this is no restriction, since sums of 16 bits span no more, and the scale is the finest; with fewer it is the
    kindest. With lines, entries of fewer than 16 bits are multiples of 256 instead.
    """
    grid, means = COARSE if tables.lines and entry_bits < 16 else 1, _mean(bits.astype(np.int64))
    balanced = balance(as_deployed(tables, grid))
    limit, room = 2 ** (width - 1) - 1, 0.0
    while True:
        scale = finest_scale(balanced, limit - room, 2**entry_bits - 1, grid)
        if entry_bits < 16:
            scale = least_disruptive_scale(balanced, scale, bits, codes, grid)
        bias = _whole_bias(balanced, scale, grid, means)
        beyond = reach(replace(balanced, bias=bias / scale), scale, grid=grid) - limit
        if grid == 1 or beyond <= 0:
            break
        room += beyond  # the compensation in the bias needs room, too
    lines = {line.joint: line.of(codes) for line in balanced.lines}
    switch_rows = _whole(balanced.switch_rows * scale, grid).astype(np.int16)
    switch_means = np.rint(balanced.switch_rows * means[:, np.newaxis] * scale)
    merged = [
        _merged(steps, rows.astype(np.int16))
        for steps, rows in zip(balanced.thresholds, _middle_rows(balanced, scale, grid), strict=True)
    ]
    slopes = (slope_of(line, scale) for line in balanced.lines)
    integers = IntegerTables(
        bias=bias.astype(np.int16),
        switch_rows=switch_rows,
        thresholds=tuple(steps for steps, _ in merged),
        joint_rows=tuple(rows for _, rows in merged),
        switch_means=np.clip(switch_means, np.minimum(switch_rows, 0), np.maximum(switch_rows, 0)).astype(np.int16),
        joint_means=np.zeros((len(merged), len(tables.bias)), np.int16),
        scale=scale,
        slopes=tuple(replace(slope, row=row.astype(np.int8)) for slope, row in slopes),
        grid=grid,
        pairs=tuple(replace(pair, rows=np.rint(pair.rows * scale).astype(np.int16)) for pair in balanced.pairs),
    )
    joint_means = []
    for joint, (column, steps, rows) in enumerate(zip(codes.T, balanced.thresholds, balanced.joint_rows, strict=True)):
        # A mean computed in floating point may round to just outside the range of its values, and so of int16.
        mean = np.rint(_mean(rows[np.searchsorted(steps, column)] + lines.get(joint, 0.0)) * scale)
        added = integers.choices(joint)[1].sum(axis=0)
        joint_means.append(np.clip(mean, added.min(axis=0), added.max(axis=0)))
    return replace(integers, joint_means=np.array(joint_means, np.int16).reshape(len(joint_means), len(tables.bias)))


def _merged(thresholds: NDArray[np.uint16], rows: Integers) -> tuple[NDArray[np.uint16], Integers]:
    """Return the joint's thresholds and rows without the thresholds that rounding has made redundant."""
    kept = (rows[1:] != rows[:-1]).any(axis=1)
    return thresholds[kept], rows[np.concatenate([[True], kept])]


def _mean(rows: NDArray[np.int64] | Floats) -> Floats:
    """Return the mean (K,) of rows (n, K), summed exactly, so that its bits are the same on every machine."""
    return np.array([math.fsum(column) / len(rows) for column in rows.T])


def integer_scores(tables: IntegerTables, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.int32]:
    """Return the scores (n, K), in steps, of the kept switches (n, s) and the joints' codes (n, j)."""
    # No partial sum leaves int16 (IntegerTables), so nothing overflows; a product of small integers is exact.
    scores: NDArray[np.int32] = tables.joint_sums(codes) + bits.astype(np.int32) @ tables.switch_rows.astype(np.int32)
    return scores
