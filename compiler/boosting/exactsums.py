"""Weights and responses on a grid on which every sum is exact.

A double holds every integer up to 2^53. So numbers rounded to multiples of 2^-e, with e chosen such that the sum of
their magnitudes stays below 2^52 multiples, can be added and subtracted in any order, by any BLAS, on any number of
threads, with the same integer result. Rounding costs at most half a multiple per number, n * 2^-51 of the total in the
worst case: four times the possible loss of an ordinary floating-point sum of n numbers. The remainder of the rounding
can be put on a second, finer grid, where a sum needs more accuracy than that.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SUM_BITS = 52
_LARGEST_POWER = 1023
_FINEST = 1000


@dataclass(frozen=True, slots=True)
class OnGrid:
    """Numbers (K, n) as integer units: row k is units[k] * 2^-exponents[k], and any sum of units is exact."""

    units: Floats  # (K, n) integers whose magnitudes sum to at most 2^52 a row and, unless all are 0, to 2^50 at least
    exponents: NDArray[np.int32]  # (K,)

    def branch_sums(self, left: Floats, missing: Floats | None, base: NDArray[np.int32]) -> Floats:
        """Return the sums (3, K) over the rows left of, right of and missing in a split; members are 0 or 1, (K, n).

        Sums are in units of 2^-base, base (K,), of the class's own grid, so that numbers near the smallest doubles keep
        their bits. The right sum is a difference, and still exact: all three are integer units.
        """
        in_left = np.einsum("kn,kn->k", self.units, left)
        in_missing = np.zeros_like(in_left) if missing is None else np.einsum("kn,kn->k", self.units, missing)
        branches = np.array([in_left, self.units.sum(axis=1) - in_left - in_missing, in_missing])
        sums: Floats = np.ldexp(branches, base - self.exponents)
        return sums


def on_grids(values: Floats) -> tuple[OnGrid, OnGrid]:
    """Round each row of `values` (K, n) to the finest grid with exact sums, and the remainder to a finer one."""
    n = values.shape[1]
    sizes = np.abs(values)
    # First from the largest magnitude, which no order of summation can change, then from the exact sum on that grid.
    rough = SUM_BITS - _bits(sizes.max(axis=1, initial=0.0) * n)
    total = np.rint(_scaled(sizes, rough)).sum(axis=1)
    # One bit is left as room for n/2 units of rounding, which is enough as long as n < 2^50.
    exponents = (rough + np.where(total > 0, SUM_BITS - 1 - _bits(total), 0)).astype(np.int32)
    scaled = _scaled(values, exponents)
    units = np.rint(scaled)
    # The remainder is at most half a unit per number, n/2 per row, which determines its grid.
    finer = SUM_BITS - n.bit_length()
    scaled -= units
    scaled *= 2.0**finer
    rest = np.rint(scaled, out=scaled)
    return OnGrid(units, exponents), OnGrid(rest, exponents + np.int32(finer))


def on_one_grid(values: Floats, terms: float) -> Floats:
    """Round all `values`, any shape, to the finest grid on which every sum of `terms` values is exact.

    The error of each is at most 2^-52 of `terms` times the largest, or 2^-1001. Sums of products with bits are exact
    too.
    """
    top = max(float(values.max(initial=0.0)), -float(values.min(initial=0.0)))
    exponent = min(SUM_BITS - math.frexp(top * terms)[1], _FINEST) if top else 0
    rounded: Floats = np.rint(values * 2.0**exponent)
    rounded *= 2.0**-exponent
    return rounded


def exact_sum(values: Floats) -> float:
    """Return the sum of `values`, any shape, rounded as by `on_one_grid`."""
    return float(on_one_grid(values, values.size).sum())


def dot(a: Floats, b: Floats) -> float:
    """Return the sum of a * b, arrays of the same shape; see `exact_sum`."""
    return exact_sum(a * b)


def _scaled(values: Floats, exponents: NDArray[np.int32]) -> Floats:
    """Return each row of `values` (K, n) times a power of two, several times faster than ldexp."""
    if exponents.max(initial=0) > _LARGEST_POWER:
        return np.ldexp(values, exponents[:, np.newaxis])
    return values * np.ldexp(1.0, exponents)[:, np.newaxis]


def _bits(magnitudes: Floats) -> NDArray[np.int32]:
    """Return the smallest b with magnitude < 2^b."""
    return np.frexp(magnitudes)[1]
