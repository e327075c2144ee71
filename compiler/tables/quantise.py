"""From score tables to integer tables: one scale for all, fine, yet such that no sum can overflow.

Rounding every row to whole steps moves a score by at most (inputs + 1)/2 steps, half a step for the bias and for each
input's row. Two scores can therefore approach each other by at most inputs + 1 steps, and a frame whose best score
leads by more than that keeps its grasp type. This holds of every scale: a coarser one only makes a step worth more.

Firmware adds up what look-ups give: the sum of the rows of a few switches, or a row of a joint. Where it stores these
in entries of 8 bits, as what exceeds the least of the look-up and class, no look-up may span more than 255 steps. A
scale for that is some 4 steps per unit of score, where one for 16 bits is some 300.

The row of a line becomes whole steps per distance from the middle of its range (runtime/tables.py), a byte each: half a
step times the largest distance, at most 127, is what that moves a score. Where tables have lines and entries are of 8
bits, these are the upper halves of steps: rows of switches and bins are then rounded to multiples of 256 steps, and
only lines and bias are as fine as the sums of 16 bits allow. The bias takes back what rounding moves scores by in the
mean: x times the error of a switch's row becomes x less its mean times the error, which is no more for an x of 0 or 1.
Such scores are relative to the last class, which is then one class less to add up.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import COARSE, FINEST_SCALE, WIDEST, IntegerTables, Slope

from ..boosting.stumps import winners
from .collapse import Floats, Line, ScoreTables


def balance(tables: ScoreTables) -> ScoreTables:
    """Return tables of equal scores whose bias is spread over the joints' rows, as far as their ranges take it.

    What moves from the bias into all rows of a joint changes no score. A partial sum can reach |bias| plus the range of
    every input; with the bias gone it reaches no further than complete scores do, and there is nothing better. A line
    reaches least where it adds nothing in the middle of its range: rows here are those that it has there.
    """
    if not tables.joint_rows:
        return tables
    middles = np.zeros((len(tables.joint_rows), tables.n_classes))
    for line in tables.lines:
        middles[line.joint] = line.row * ((line.high - line.low) / 2)
    middle_rows = [rows + middle for rows, middle in zip(tables.joint_rows, middles, strict=True)]
    lowest = np.stack([rows.min(axis=0) for rows in middle_rows])
    spans = np.stack([rows.max(axis=0) for rows in middle_rows]) - lowest
    # Each joint gives up its lowest row and the same share of its span; the share is such that the bias becomes zero.
    wanted, room = -tables.bias - lowest.sum(axis=0), spans.sum(axis=0)
    share = np.divide(wanted, room, out=np.zeros_like(room), where=room > 0).clip(0, 1)
    moved = lowest + share * spans
    rows = tuple(rows - shift for rows, shift in zip(tables.joint_rows, moved, strict=True))
    return replace(tables, bias=tables.bias + moved.sum(axis=0), joint_rows=rows)


def as_deployed(tables: ScoreTables, grid: int) -> ScoreTables:
    """Return the tables that integers with rows on a `grid` are made of: there, scores are relative to the last."""
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
    """Return a line in whole steps, without its row; and the row (K,), in whole steps per distance, that it should
    have.

    Codes are divided by the least power of two that makes their range fit a byte, or multiplied by the least one that
    makes a byte of every entry of the row, if there is one.
    """
    span, gain = line.high - line.low, 0
    while span >> -gain > WIDEST:
        gain -= 1
    while gain >= 0 and span << gain + 1 <= WIDEST and np.rint(np.abs(line.row).max() * scale / 2**gain) > _LARGEST:
        gain += 1
    none = np.zeros(len(line.row), np.int8)
    return Slope(line.joint, line.low, line.high, gain, none), np.rint(line.row * scale / 2.0**gain)


def offset_of(slope: Slope) -> float:
    """Return how far above the lowest code of a slope nothing is added: where codes are divided, in the middle of those
    that become one.
    """
    return slope.zero / 2.0**slope.gain + max(2.0**-slope.gain - 1, 0) / 2


# The most consecutive switches that firmware looks up together in tables of narrow entries. Any so many, wherever a
# group of them may begin, keep the span; so fewer do as well.
GROUP_SIZE = 5

# Scales that `kindest_scale` tries, evenly spaced down to four fifths of the finest.
TRIED, _TRIED_OF_ALL = 32, 160
_LARGEST = 127  # entry of a slope's row


def finest_scale(tables: ScoreTables, limit: float, widest: int, grid: int = 1) -> float:
    """Return the largest double below FINEST_SCALE at which no sum of rounded rows exceeds `limit` and no look-up
    spans more than `widest`; 1 for tables of zeros.

    Rounded terms never fall as the scale grows, so neither do sums and spans, and bisection over the doubles is exact.
    With lines, or rows on a `grid`, it finds one of the largest.
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


def kindest_scale(
    tables: ScoreTables, finest: float, bits: NDArray[np.bool_], codes: NDArray[np.uint16], grid: int = 1
) -> float:
    """Return, of `finest` and scales a little coarser, the one at which the fewest rows, bits (n, s) and codes (n, j),
    change their class; of equal ones the finest.

    Where steps are coarse, whether a frame that many rows share changes its class is a matter of luck and not of how
    coarse they are. What is proved of rounding is proved at every scale.
    """
    scales = finest * (1 - np.arange(TRIED) / _TRIED_OF_ALL)
    scores = tables.scores(bits, codes)
    most = max(rounding_error(tables, scale, grid) for scale in scales[[0, -1]].tolist())
    near = _leads(scores) * scales[-1] <= 2 * most + 1  # no scale can change the others: quantise.py
    right, closed = winners(scores[near]), bits[near].astype(np.float64)
    asked, means = codes[near], _mean(bits.astype(np.int64))
    changed = []
    for scale in scales.tolist():
        whole = _whole_scores(tables, scale, closed, asked, grid) + _whole_bias(tables, scale, grid, means)
        changed.append(np.count_nonzero(whole.argmax(axis=1) != right))
    return float(scales[int(np.argmin(changed))])


def rounding_error(tables: ScoreTables, scale: float, grid: int = 1) -> float:
    """Return the most steps that rounding can move a score: half of one for the bias, for a joint's only row and for
    that of a pair, half of the `grid` for the row of each switch and bin, and for each line half of one times the
    largest distance, besides what codes that become one differ by.
    """
    binned = sum(len(steps) > 0 for steps in tables.thresholds)
    error = (tables.n_inputs + len(tables.pairs) + 1 + (grid - 1) * (len(tables.switch_rows) + binned)) / 2
    for line in tables.lines:
        slope, _ = slope_of(line, scale)
        error += slope.zero / 2 + float(np.abs(line.row).max()) * scale * max(2.0**-slope.gain - 1, 0) / 2
    return error


def reach(tables: ScoreTables, scale: float, *, rounded: bool = True, grid: int = 1) -> float:
    """Return the largest absolute value that a partial sum of the scaled rows can take, in any order; infinity if an
    entry of a slope's row does not fit its byte.
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


def _whole_scores(tables: ScoreTables, scale: float, closed: Floats, codes: NDArray[np.uint16], grid: int) -> Floats:
    """Return the scores (n, K) of the tables but for the bias in whole steps: closed (n, s) switches, and the joints'
    codes (n, j).
    """
    # Sums of whole numbers are exact, in any order: a matrix product may add them up.
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
    """Return the bias in whole steps, with what the rounding of switches' rows to a `grid` takes from scores in the
    mean, where each of the switches is closed in `means` (s,) of all rows.
    """
    rows = tables.switch_rows * scale
    lost = means[:, np.newaxis] * (rows - _whole(rows, grid)) if grid > 1 else 0 * rows
    whole: Floats = np.rint(tables.bias * scale + [math.fsum(column) for column in lost.T])
    return whole


def _whole(rows: Floats, grid: int) -> Floats:
    whole: Floats = np.rint(rows / grid) * grid
    return whole


def _middle_rows(tables: ScoreTables, scale: float, grid: int, *, rounded: bool = True) -> list[Floats]:
    """Return the joints' rows (T_a + 1, K) in whole steps, at the codes where their slopes add nothing. A joint's only
    row is part of the start, and needs no grid.
    """
    middle = list(tables.joint_rows)
    for line in tables.lines:
        middle[line.joint] = middle[line.joint] + line.row * offset_of(slope_of(line, scale)[0])
    return [_whole(rows * scale, grid if len(rows) > 1 else 1) if rounded else rows * scale for rows in middle]


def _outermost(tables: ScoreTables) -> ScoreTables:
    """Return the tables with each joint's largest and smallest rows alone: rounding keeps them outermost."""
    outer = (np.array([rows.max(axis=0), rows.min(axis=0)]) if len(rows) > 1 else rows for rows in tables.joint_rows)
    return replace(tables, joint_rows=tuple(outer))


def _extremes(tables: ScoreTables, scale: float, *, rounded: bool = True, grid: int = 1) -> tuple[Floats, Floats]:
    """Return the most and the least, zero included, that bias, switches, joints, but for their lines, and pairs add:
    (1 + s + j + p, K) each.
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

    bits (n, s) and codes (n, j) are the rows trained on; their mean contributions stand in for missing inputs. No
    look-up, a joint or up to GROUP_SIZE consecutive switches, spans more than 2^entry_bits - 1 steps in any class. With
    16 that is no limit, as sums of 16 bits span no more, and the scale is the finest; with fewer it is the kindest.
    With lines, entries of fewer than 16 bits are multiples of 256 instead.
    """
    grid, means = COARSE if tables.lines and entry_bits < 16 else 1, _mean(bits.astype(np.int64))
    balanced = balance(as_deployed(tables, grid))
    limit, room = 2 ** (width - 1) - 1, 0.0
    while True:
        scale = finest_scale(balanced, limit - room, 2**entry_bits - 1, grid)
        if entry_bits < 16:
            scale = kindest_scale(balanced, scale, bits, codes, grid)
        bias = _whole_bias(balanced, scale, grid, means)
        beyond = reach(replace(balanced, bias=bias / scale), scale, grid=grid) - limit
        if grid == 1 or beyond <= 0:
            break
        room += beyond  # what the bias takes back, too, needs room
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
        pairs=tuple(replace(pair, rows=np.rint(pair.rows * scale).astype(np.int16)) for pair in balanced.pairs),
    )
    joint_means = []
    for joint, (column, steps, rows) in enumerate(zip(codes.T, balanced.thresholds, balanced.joint_rows, strict=True)):
        # A mean computed in floating point may round to just outside of what it is the mean of, and so of int16.
        mean = np.rint(_mean(rows[np.searchsorted(steps, column)] + lines.get(joint, 0.0)) * scale)
        added = integers.choices(joint)[1].sum(axis=0)
        joint_means.append(np.clip(mean, added.min(axis=0), added.max(axis=0)))
    return replace(integers, joint_means=np.array(joint_means, np.int16).reshape(len(joint_means), len(tables.bias)))


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
    scores: NDArray[np.int32] = tables.joint_sums(codes) + bits.astype(np.int32) @ tables.switch_rows.astype(np.int32)
    return scores
