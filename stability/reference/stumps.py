"""The best decision stump of weights and responses: the one that explains most of sum w z^2.

A stump parts the rows into left (x <= threshold), right and missing (NaN); a branch answers with its mean C/W, where
W = sum w and C = sum w z, and so explains C^2/W. All `weights` here are w, all `responses` w z, floats or mpf (n,).
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import accumulate

import mpmath
from mpmath import mpf

from .numbers import DIGITS, precisely

Numbers = Sequence[float]
Sums = tuple[mpf, mpf]  # W, C
Split = tuple[mpf, int, float, float]  # explained, column, the values on both sides of the threshold

# What is equal comes out within a few 10^-60 of equal, whatever the order of its sums.
EQUAL = mpf(10) ** (10 - DIGITS)


@precisely()
def explained(x: Numbers, weights: Numbers, responses: Numbers, threshold: float) -> mpf:
    """Return the sum of C^2/W over the branches that have weight."""
    return _explained(_branches(x, weights, responses, threshold))


@precisely()
def branch_values(
    x: Numbers, weights: Numbers, responses: Numbers, threshold: float, z_max: float
) -> tuple[mpf, mpf, mpf]:
    """Return what left, right and missing answer: C/W within +-z_max; without weight, the mean of all rows."""
    branches = _branches(x, weights, responses, threshold)
    total = mpmath.fsum(weight for weight, _ in branches), mpmath.fsum(response for _, response in branches)
    left, right, missing = (_mean(branch if branch[0] else total, mpf(z_max)) for branch in branches)
    return left, right, missing


@precisely()
def best_splits(columns: Sequence[Numbers], weights: Numbers, responses: Numbers) -> list[Split]:
    """Return every split of every column, best first; of equal ones the lowest column, then the lowest value, first."""
    splits = [split for number, x in enumerate(columns) for split in _splits(number, x, weights, responses)]
    splits.sort(key=lambda split: split[0], reverse=True)
    runs: list[list[Split]] = []
    for split in splits:
        if runs and runs[-1][0][0] - split[0] <= EQUAL * runs[-1][0][0]:
            runs[-1].append(split)
        else:
            runs.append([split])
    return [split for run in runs for split in sorted(run, key=lambda split: split[1:])]


def _splits(number: int, x: Numbers, weights: Numbers, responses: Numbers) -> Iterator[Split]:
    rows: dict[float, list[int]] = defaultdict(list)
    for row, value in enumerate(x):
        rows[math.inf if math.isnan(value) else value].append(row)
    missing = _sums(rows.pop(math.inf, []), weights, responses)
    values = sorted(rows)
    sums = [_sums(rows[value], weights, responses) for value in values]
    left = list(accumulate(sums, _plus))
    right = list(accumulate(sums[::-1], _plus))[::-1]
    for i in range(len(values) - 1):
        yield _explained([left[i], right[i + 1], missing]), number, values[i], values[i + 1]


def _branches(x: Numbers, weights: Numbers, responses: Numbers, threshold: float) -> list[Sums]:
    left = [row for row, value in enumerate(x) if value <= threshold]
    right = [row for row, value in enumerate(x) if value > threshold]
    missing = [row for row, value in enumerate(x) if math.isnan(value)]
    return [_sums(rows, weights, responses) for rows in (left, right, missing)]


def _sums(rows: Sequence[int], weights: Numbers, responses: Numbers) -> Sums:
    return mpmath.fsum(weights[row] for row in rows), mpmath.fsum(responses[row] for row in rows)


def _plus(one: Sums, other: Sums) -> Sums:
    return one[0] + other[0], one[1] + other[1]


def _explained(branches: Sequence[Sums]) -> mpf:
    return mpmath.fsum(response**2 / weight for weight, response in branches if weight)


def _mean(branch: Sums, z_max: mpf) -> mpf:
    weight, response = branch
    return min(max(response / weight, -z_max), z_max) if weight else mpf(0)
