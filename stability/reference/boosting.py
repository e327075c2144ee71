"""LogitBoost on stumps at 60 digits: probabilities, losses and responses, the best stump, and scores.

Friedman, Hastie and Tibshirani, Annals of Statistics 28 (2000), algorithm 6, with the clamp of the working response
that they recommend in section 5 and that Weka 3.6 has.

A stump splits the rows into left (x <= threshold), right and missing (NaN); a branch has as output its mean C/W, where
W = sum w and C = sum w z, and so explains C^2/W. All `weights` here are w, all `responses` w z, floats or mpf (n,).

A round adds to F_k  f_k = (K-1)/K (g_k - mean_j g_j)  with g_k = shrinkage * output of class k's stump (Friedman,
Hastie and Tibshirani 2000, algorithm 6, step 2b).
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import accumulate

import mpmath
from mpmath import mpf

from .numbers import DIGITS, added, precisely

exp, log = precisely()(mpmath.exp), precisely()(mpmath.log)


@precisely()
def softmax(scores: Sequence[float]) -> list[mpf]:
    """Return P_k = e^F_k / sum_j e^F_j; no F is too large here."""
    powers = [mpmath.exp(mpf(score)) for score in scores]
    total = mpmath.fsum(powers)
    return [power / total for power in powers]


@precisely()
def loss(scores: Sequence[float], label: int) -> mpf:
    """Return -ln P of class `label`, = ln(1 + sum over the others of e^(F_k - F_label)), even if tiny."""
    own = mpf(scores[label])
    others = (mpmath.exp(mpf(score) - own) for k, score in enumerate(scores) if k != label)
    return mpmath.log1p(mpmath.fsum(others))


@precisely()
def mean_loss(scores: Sequence[Sequence[float]], labels: Sequence[int], weights: Sequence[float] | None = None) -> mpf:
    """Return the mean of -ln P(label) over n rows of scores (n, K), weighted by `weights` (None: all 1)."""
    shares = [mpf(weight) for weight in ([1] * len(labels) if weights is None else weights)]
    losses = [loss(row, label) for row, label in zip(scores, labels, strict=True)]
    return mpmath.fsum(share * each for share, each in zip(shares, losses, strict=True)) / mpmath.fsum(shares)


@precisely()
def target(probability: float, is_member: bool, z_max: float, row_weight: float = 1) -> tuple[mpf, mpf]:
    """Return weight and working response (w, z) of a row: z = 1/P or -1/(1 - P) within +-z_max, w = u (Y - P) / z."""
    own = mpf(probability) if is_member else 1 - mpf(probability)
    size = 1 / own if own * z_max > 1 else mpf(z_max)
    z = size if is_member else -size
    return row_weight * (int(is_member) - mpf(probability)) / z, z


Numbers = Sequence[float]
Sums = tuple[mpf, mpf]  # W, C
Split = tuple[mpf, int, float, float]  # explained, column, the values on both sides of the threshold

# Equal values differ by at most a few 10^-60, in any order of summation.
EQUAL = mpf(10) ** (10 - DIGITS)


@precisely()
def explained(x: Numbers, weights: Numbers, responses: Numbers, threshold: float) -> mpf:
    """Return the sum of C^2/W over the branches that have weight."""
    left = [row for row, value in enumerate(x) if value <= threshold]
    right = [row for row, value in enumerate(x) if value > threshold]
    missing = [row for row, value in enumerate(x) if math.isnan(value)]
    return _explained([_sums(rows, weights, responses) for rows in (left, right, missing)])


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
    left, right = (list(accumulate(of, lambda a, b: (a[0] + b[0], a[1] + b[1]))) for of in (sums, sums[::-1]))
    right.reverse()
    for i in range(len(values) - 1):
        yield _explained([left[i], right[i + 1], missing]), number, values[i], values[i + 1]


def _sums(rows: Sequence[int], weights: Numbers, responses: Numbers) -> Sums:
    return mpmath.fsum(weights[row] for row in rows), mpmath.fsum(responses[row] for row in rows)


def _explained(branches: Sequence[Sums]) -> mpf:
    return mpmath.fsum(response**2 / weight for weight, response in branches if weight)


@precisely()
def step(outputs: Sequence[float], shrinkage: float) -> list[mpf]:
    """Return the step of a round for the K scores of a row."""
    g = [mpf(output) * shrinkage for output in outputs]
    mean = mpmath.fsum(g) / len(g)
    return [(each - mean) * (len(g) - 1) / len(g) for each in g]


@precisely()
def scores(
    columns: Sequence[Sequence[int]],
    thresholds: Sequence[Sequence[float]],
    values: Sequence[Sequence[Sequence[float]]],
    shrinkage: float,
    row: Sequence[float],
) -> list[mpf]:
    """Return F (K,) of one row; columns and thresholds (M, K), values (M, K, 3). A step is linear: one of all sums."""
    outputs = [
        [output(row[column], threshold, branches) for column, threshold, branches in zip(*stumps, strict=True)]
        for stumps in zip(columns, thresholds, values, strict=True)
    ]
    return step([added(own) for own in zip(*outputs, strict=True)], shrinkage)


def output(x: float, threshold: float, branches: Sequence[float]) -> float:
    """Return the output of a stump for x: its value left, right, or for missing x."""
    if math.isnan(x):
        return branches[2]
    return branches[0] if x <= threshold else branches[1]
