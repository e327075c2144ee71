"""The derivatives of a multinomial logit's penalised loss at 60 digits, from the formula alone.

loss = sum over frames i of (log sum_k e^F_ik - F_iy) + 1/2 sum of pull |row|^2 + 1/2 smoothness |next - row|^2

Sums are exact, in whole units of 2^-256; only probabilities are rounded before.
"""

from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from operator import add
from typing import NamedTuple

import mpmath
from mpmath import mpf

from .numbers import precisely

UNIT_BITS = 256


class ReferenceColumn(NamedTuple):
    """The row of each frame (n,), -1: none; rows (r, K), the penalty of each (r,), and their smoothness."""

    added: Sequence[int]
    rows: Sequence[Sequence[float]]
    pulls: Sequence[float]
    smoothness: Sequence[tuple[int, int, float]]


@precisely()
def largest_derivative(columns: Sequence[ReferenceColumn], labels: Sequence[int]) -> mpf:
    """Return the largest derivative with respect to any entry of any column's rows; one column may be the bias."""
    rows = [[list(map(_units, row)) for row in column.rows] for column in columns]
    sums = [list(map(_pulled, of, column.pulls)) for of, column in zip(rows, columns, strict=True)]
    for column, entries, totals in zip(columns, rows, sums, strict=True):
        for one, other, smoothness in column.smoothness:
            step = _pulled([b - a for a, b in zip(entries[one], entries[other], strict=True)], smoothness)
            totals[one] = [total - part for total, part in zip(totals[one], step, strict=True)]
            totals[other] = list(map(add, totals[other], step))
    residuals: dict[tuple[object, ...], list[int]] = {}
    nothing = [0] * len(columns[0].rows[0])
    for frame in zip(*(column.added for column in columns), labels, strict=True):
        places = [(number, row) for number, row in enumerate(frame[:-1]) if row >= 0]
        if frame not in residuals:
            scores = list(map(sum, zip(nothing, *(rows[number][row] for number, row in places), strict=True)))
            residuals[frame] = _residual(scores, frame[-1])
        for number, row in places:
            sums[number][row] = list(map(add, sums[number][row], residuals[frame]))
    largest = max(abs(total) for totals in sums for row in totals for total in row)
    return mpmath.ldexp(mpf(largest), -UNIT_BITS)


@lru_cache(maxsize=1 << 16)
def _units(number: float) -> int:
    numerator, denominator = number.as_integer_ratio()
    return (numerator << UNIT_BITS) // denominator


def _pulled(row: Sequence[int], pull: float) -> list[int]:
    """Return the derivatives of 1/2 pull |row|^2."""
    return [_units(pull) * entry >> UNIT_BITS for entry in row]


def _residual(scores: Sequence[int], label: int) -> list[int]:
    """Return P_k - Y_k of a frame's scores (K,)."""
    counts = Counter(scores)
    powers = {score: mpmath.exp(mpmath.ldexp(mpf(score), -UNIT_BITS)) for score in counts}
    total = mpmath.fsum(count * powers[score] for score, count in counts.items())
    shares = {score: int(mpmath.ldexp(power / total, UNIT_BITS)) for score, power in powers.items()}
    residual = [shares[score] for score in scores]
    residual[label] -= _units(1.0)
    return residual
