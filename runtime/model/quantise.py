"""Quantise score tables to integers: one scale for all rows, as fine as possible without overflow of any sum.

Rounding every row to whole steps moves a score by at most (inputs + 1)/2 steps, half a step for the bias and for each
input's row. Two scores can therefore approach each other by at most inputs + 1 steps, and a frame whose best score
leads by more than that keeps its grasp type. This holds for every scale: a coarser one only makes a step worth more.

The row of a line becomes whole steps per distance from the middle of its range (terms/line.py), a byte each. This moves
a score by at most half a step times the largest distance, which is at most 127. Where tables have lines, entries may
have 8 bits, the upper halves of steps, which straight-line code adds in one instruction: rows of switches and bins are
rounded to multiples of 256 steps, and only lines and bias use the full resolution of 16-bit sums. The bias compensates
the mean rounding error: x times the error of a switch's row becomes (x - mean) times the error, which is no larger for
x = 0 or 1. Such scores are relative to the last class, so there is one class less to add up.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .integers import COARSE, FINEST_SCALE, IntegerTables
from .tables import ScoreTables
from .terms.base import Floats, rounded
from .terms.line import LARGEST_SLOPE, WIDEST, Line


def balance(tables: ScoreTables) -> ScoreTables:
    """Return tables of equal scores whose bias is spread over the joints' rows, as far as their ranges allow.

    Moving a constant from the bias into all rows of a joint changes no score. A partial sum can reach |bias| plus the
    range of every input; without bias it reaches no further than complete scores do, which is optimal. A line reaches
    least where its zero is in the middle of its range: rows are evaluated there.
    """
    if not tables.n_joints:
        return tables
    middles = np.zeros((tables.n_joints, tables.n_classes))
    for line in tables.lines:
        middles[line.joint] = line.middle
    middle_rows = [rows + middle for rows, middle in zip(tables.joint_rows, middles, strict=True)]
    lowest = np.stack([rows.min(axis=0) for rows in middle_rows])
    spans = np.stack([rows.max(axis=0) for rows in middle_rows]) - lowest
    # Each joint gives up its lowest row and a common share of its span, chosen such that the bias becomes zero.
    wanted, room = -tables.bias - lowest.sum(axis=0), spans.sum(axis=0)
    share = np.divide(wanted, room, out=np.zeros_like(room), where=room > 0).clip(0, 1)
    moved = lowest + share * spans
    rows = [rows - shift for rows, shift in zip(tables.joint_rows, moved, strict=True)]
    return tables.changed(bias=tables.bias + moved.sum(axis=0), joint_rows=rows)


def as_deployed(tables: ScoreTables, grid: int) -> ScoreTables:
    """Return the tables before rounding to a `grid`: scores relative to the last class if rows are on one."""
    if grid == 1:
        return tables
    return ScoreTables(tables.bias - tables.bias[-1:], tuple(term.relative() for term in tables.core_terms))


def _centred(tables: ScoreTables, scale: float) -> ScoreTables:
    """Return the tables with what lines add at the zeros of their slopes in the rows of bins."""
    rows = list(tables.joint_rows)
    for line in tables.lines:
        rows[line.joint] = rows[line.joint] + line.offset(scale)
    return tables.changed(joint_rows=rows) if tables.lines else tables


def finest_scale(tables: ScoreTables, limit: float, grid: int = 1) -> float:
    """Return the largest scale at which no sum exceeds `limit`.

    It is a double below FINEST_SCALE; 1 for tables of zeros. Rounded terms never shrink as the scale grows, so neither
    do sums, and bisection over the doubles is exact. With lines, or rows on a `grid`, the result is only one of the
    largest.
    """
    extremes = Extremes(tables, grid)
    whole = extremes.reach(1.0, whole=False)
    if whole == 0:
        return 1.0
    most = limit + grid * (len(tables.terms) - len(tables.lines) + 2) + WIDEST * len(tables.lines)
    fits, too_fine = 0.0, min(most / whole, FINEST_SCALE)
    while (middle := (fits + too_fine) / 2) not in (fits, too_fine):
        if extremes.reach(middle) <= limit:
            fits = middle
        else:
            too_fine = middle
    return fits


def rounding_error(tables: ScoreTables, scale: float, grid: int = 1) -> float:
    """Return the most steps by which rounding can move a score: half a step for the bias, and that of each term."""
    return sum((term.rounding_error(scale, grid) for term in tables.core_terms), 0.5)


class Extremes:
    """The largest and smallest contributions of bias and terms, at any scale: rounding keeps them extreme."""

    def __init__(self, tables: ScoreTables, grid: int = 1) -> None:
        fixed = [term for term in tables.core_terms if not isinstance(term, Line)]
        ends = [(tables.bias, tables.bias), *(term.ends for term in fixed)]
        self._lines = tables.lines
        self._upper, self._lower = (np.stack(rows) for rows in zip(*ends, strict=True))
        # Where the bins of each joint begin, and the grid of each row.
        self._first = 1 + tables.n_switches
        self._grids = np.array([1.0] + [2 * term.rounding_error(1.0, grid) for term in fixed])[:, np.newaxis]

    def reach(self, scale: float, *, whole: bool = True) -> float:
        """Return the largest absolute value of a partial sum of the scaled rows, in any order; infinity if an entry of
        a slope's row does not fit its byte.
        """
        slopes = [line.whole(scale, 1) if whole else line.slope(scale) for line in self._lines]
        if whole and any(np.abs(slope.row).max() > LARGEST_SLOPE for slope in slopes):
            return math.inf
        # Bins count at the zeros of their joint's line.
        offsets = np.zeros_like(self._upper)
        for line in self._lines:
            offsets[self._first + line.joint] = line.offset(scale)
        rows = [(self._upper + offsets) * scale, (self._lower + offsets) * scale]
        if whole:
            rows = [np.rint(each / self._grids) * self._grids for each in rows]
        upper, lower = (np.vstack(ends) for ends in zip(rows, *(slope.ends for slope in slopes), strict=True))
        return float(max(np.maximum(upper, 0).sum(axis=0).max(), -np.minimum(lower, 0).sum(axis=0).min()))


def _whole_bias(tables: ScoreTables, scale: float, grid: int, means: Floats) -> Floats:
    """Return the bias in whole steps, with compensation for the mean error of rounding switches' rows to a `grid`.

    `means` (s,) are the shares of rows in which each switch is closed.
    """
    rows = tables.switch_rows * scale
    lost = means[:, np.newaxis] * (rows - rounded(rows, grid)) if grid > 1 else 0 * rows
    whole: Floats = np.rint(tables.bias * scale + [math.fsum(column) for column in lost.T])
    return whole


def quantise(
    tables: ScoreTables,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    width: int = 16,
    entry_bits: int = 16,
) -> IntegerTables:
    """Return integer tables whose sums fit `width` bits (4 to 16), rounded half to even.

    bits (n, s) and codes (n, j) are the training rows; their mean contributions replace missing inputs. Where tables
    have lines, entries of fewer than 16 bits are multiples of 256 steps.
    """
    grid, means = COARSE if tables.lines and entry_bits < 16 else 1, bits.sum(axis=0) / len(bits)
    balanced = balance(as_deployed(tables, grid))
    limit, room = 2 ** (width - 1) - 1, 0.0
    while True:
        scale = finest_scale(balanced, limit - room, grid)
        bias = _whole_bias(balanced, scale, grid, means)
        beyond = Extremes(ScoreTables(bias / scale, balanced.terms), grid).reach(scale) - limit
        if grid == 1 or beyond <= 0:
            break
        room += beyond  # the compensation in the bias needs room, too
    terms = tuple(term.whole(scale, grid).integers() for term in _centred(balanced, scale).core_terms)
    s, j, K = tables.n_switches, tables.n_joints, tables.n_classes
    none = np.zeros((s + j, K), np.int16)
    integers = IntegerTables(bias.astype(np.int16), terms, none[:s], none[s:], scale, grid)
    added = [*(balanced.switch_rows * means[:, np.newaxis])]
    lines = {line.joint: line for line in balanced.lines}
    for joint, (column, bins) in enumerate(zip(codes.T, balanced.bins, strict=True)):
        added.append(_mean(bins.of(column) + (lines[joint].of(column) if joint in lines else 0.0)))
    # A mean computed in floating point may round to just outside the range of its values, and so of int16.
    whole = np.clip(np.rint(np.reshape(added, (s + j, K)) * scale), *integers.ends).astype(np.int16)
    return replace(integers, switch_means=whole[:s], joint_means=whole[s:])


def in_bytes(tables: IntegerTables) -> IntegerTables:
    """Return tables with means of missing inputs that firmware stores in bytes, each row in steps of a power of two.

    Each is the nearest one that is not beyond what its input can add, so no sum leaves its bounds.
    """
    s, shift, missing = tables.n_switches, tables.missing_shifts[:, np.newaxis], tables.missing
    zero = np.vstack([tables.switch_means, tables.joint_means]) - missing
    least, most = (end - zero for end in tables.ends)
    steps = np.rint(missing / 2**shift).astype(np.int64)
    # Shifts round down.
    steps = np.clip(steps, np.maximum(-(-least >> shift), -127), np.minimum(most >> shift, 127))
    means = (zero + (steps << shift)).astype(np.int16)
    return replace(tables, switch_means=means[:s], joint_means=means[s:])


def _mean(rows: NDArray[Any]) -> Floats:
    """Return the mean (K,) of rows (n, K), summed exactly, so that its bits are the same on every machine."""
    return np.array([math.fsum(column) / len(rows) for column in rows.T])
