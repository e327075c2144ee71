"""Is the scale the finest at which no sum leaves its integers? Found anew, in exact arithmetic."""

import math

from thenar.compiler.tables.collapse import ScoreTables
from thenar.compiler.tables.quantise import balance

from ..finding import Finding, Worst
from ..inputs.hard_tables import dominated, drawn, quantised, rows_of
from ..reference.tables import steps
from .integer_sums import largest_sum

# Products of a row and the scale are doubles: relative 2^-53 off, so the scale at which one passes half a step is off
# by as much, one unit in its last place at the most; and the next double is another.
_BOUND = 2


def finest_scales(seeds: range) -> Finding:
    """Compare the compiler's scale with the finest, for classes alike and for one that dominates by up to 10^12."""
    worst = Worst("scale, one class up to 10^12 times the others", "bisection in exact arithmetic", _BOUND, "ulp")
    for seed in seeds:
        for width, factor in ((4, 1.0), (16, 1.0), (8, 1e3), (16, 1e-3), (16, 1e6), (16, 1e12)):
            tables = dominated(seed, 3, 4, (5, 3), factor)
            worst.see(_error(tables, width), f"draw {seed}, {width} bits, times {factor:g}")
        worst.see(_error(drawn(seed, 2, 1, ()), 16), f"draw {seed}, 2 classes, 1 switch")
    return worst.finding()


def _error(tables: ScoreTables, width: int) -> float:
    got, limit = quantised("", tables, width).integers.scale, 2 ** (width - 1) - 1
    finest = _finest(balance(tables), limit)
    return abs(got - finest) / math.ulp(finest)


def _finest(tables: ScoreTables, limit: int) -> float:
    """Return the largest double at which rows, rounded half to even from exact products, cannot add up beyond limit."""
    inputs = rows_of(tables)
    fits, too_fine = 0.0, 1.0
    while _furthest(inputs, too_fine) <= limit:
        fits, too_fine = too_fine, 2 * too_fine
    while (middle := (fits + too_fine) / 2) not in (fits, too_fine):
        fits, too_fine = (middle, too_fine) if _furthest(inputs, middle) <= limit else (fits, middle)
    return fits


def _furthest(inputs: list[list[list[float]]], scale: float) -> float:
    return largest_sum([[[steps(value, scale) for value in row] for row in rows] for rows in inputs])
