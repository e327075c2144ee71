"""The derivatives of a multinomial logit's penalised loss at 60 digits, from the formula alone.

loss = sum over frames i of u_i (log sum_k e^F_ik - F_iy) + 1/2 sum of pull |row|^2 + 1/2 smoothness |next - row|^2
"""

from collections.abc import Sequence
from typing import NamedTuple

import mpmath
from mpmath import mpf

from .boosting import softmax
from .numbers import precisely

Rows = Sequence[Sequence[float]]


class ReferenceColumn(NamedTuple):
    """The row of each frame (n,), -1: none; rows (r, K), the penalty of each (r,), and their smoothness."""

    added: Sequence[int]
    rows: Rows
    pulls: Sequence[float]
    smoothness: Sequence[tuple[int, int, float]]


@precisely()
def largest_derivative(columns: Sequence[ReferenceColumn], labels: Sequence[int], weights: Sequence[float]) -> mpf:
    """Return the largest derivative with respect to any entry of any column's rows; one column may be the bias."""
    n_classes = len(columns[0].rows[0])
    residuals: list[list[mpf]] = []
    known: dict[tuple[int, ...], list[mpf]] = {}
    for frame, (label, weight) in enumerate(zip(labels, weights, strict=True)):
        where = tuple(column.added[frame] for column in columns)
        if where not in known:
            rows = [column.rows[row] for column, row in zip(columns, where, strict=True) if row >= 0]
            known[where] = softmax([mpmath.fsum(map(mpf, entries)) for entries in zip(*rows, strict=True)])
        residuals.append([mpf(weight) * (p - (k == label)) for k, p in enumerate(known[where])])
    largest = mpf(0)
    for column in columns:
        sums = [[mpf(0)] * n_classes for _ in column.rows]
        for frame, row in enumerate(column.added):
            if row >= 0:
                sums[row] = [total + own for total, own in zip(sums[row], residuals[frame], strict=True)]
        largest = max([largest, *(abs(each) for row in _held(column, sums) for each in row)])
    return largest


def _held(column: ReferenceColumn, sums: list[list[mpf]]) -> list[list[mpf]]:
    """Return the sums plus the derivatives of the penalties."""
    rows = [[mpf(entry) for entry in row] for row in column.rows]
    for row, pull, own in zip(rows, column.pulls, sums, strict=True):
        own[:] = [total + mpf(pull) * entry for total, entry in zip(own, row, strict=True)]
    for one, other, smoothness in column.smoothness:
        steps = [mpf(smoothness) * (b - a) for a, b in zip(rows[one], rows[other], strict=True)]
        sums[one] = [total - step for total, step in zip(sums[one], steps, strict=True)]
        sums[other] = [total + step for total, step in zip(sums[other], steps, strict=True)]
    return sums
