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
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import accumulate

import mpmath
from mpmath import mpf

from .numbers import DIGITS, added, precisely

Numbers = Sequence[float]
Branch = tuple[mpf, mpf]  # W, C
Sums = dict[tuple[int, int, float], list[mpf]]  # by column, class and threshold: left, right, missing
Split = tuple[mpf, int, float, float]  # explained, column, the values on both sides of the threshold

# Equal values differ by at most a few 10^-60, in any order of summation.
EQUAL = mpf(10) ** (10 - DIGITS)

exp, log = precisely()(mpmath.exp), precisely()(mpmath.log)


@lru_cache(maxsize=1 << 12)
@precisely()
def softmax(scores: tuple[float, ...]) -> list[mpf]:
    """Return P_k = e^F_k / sum_j e^F_j; no F is too large here."""
    powers = {score: mpmath.exp(mpf(score)) for score in set(scores)}
    total = mpmath.fsum(powers[score] for score in scores)
    shares = {score: power / total for score, power in powers.items()}
    return [shares[score] for score in scores]


@lru_cache(maxsize=1 << 12)
@precisely()
def loss(scores: tuple[float, ...], label: int) -> mpf:
    """Return -ln P of class `label`, = ln(1 + sum over the others of e^(F_k - F_label)), even if tiny."""
    own = mpf(scores[label])
    powers = {score: mpmath.exp(mpf(score) - own) for score in set(scores)}
    return mpmath.log1p(mpmath.fsum(powers[score] for k, score in enumerate(scores) if k != label))


@precisely()
def mean_loss(scores: Sequence[Sequence[float]], labels: Sequence[int], weights: Sequence[float] | None = None) -> mpf:
    """Return the mean of -ln P(label) over n rows of scores (n, K), weighted by `weights` (None: all 1)."""
    shares = [mpf(weight) for weight in ([1] * len(labels) if weights is None else weights)]
    losses = [loss(tuple(row), label) for row, label in zip(scores, labels, strict=True)]
    return mpmath.fsum(share * each for share, each in zip(shares, losses, strict=True)) / mpmath.fsum(shares)


@precisely()
def target(probability: float, is_member: bool, z_max: float, row_weight: float = 1) -> tuple[mpf, mpf]:
    """Return weight and working response (w, z) of a row: z = 1/P or -1/(1 - P) within +-z_max, w = u (Y - P) / z."""
    own = mpf(probability) if is_member else 1 - mpf(probability)
    size = 1 / own if own * z_max > 1 else mpf(z_max)
    z = size if is_member else -size
    return row_weight * (int(is_member) - mpf(probability)) / z, z


@precisely()
def explained(x: Numbers, weights: Numbers, responses: Numbers, threshold: float) -> mpf:
    """Return the sum of C^2/W over the branches that have weight."""
    return _explained([_sums(rows, weights, responses) for rows in branches(x, threshold)])


def branches(x: Numbers, threshold: float) -> tuple[list[int], list[int], list[int]]:
    """Return the rows that a stump sends left and right, and the missing ones."""
    left = [row for row, value in enumerate(x) if value <= threshold]
    right = [row for row, value in enumerate(x) if value > threshold]
    return left, right, [row for row, value in enumerate(x) if math.isnan(value)]


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


def _sums(rows: Sequence[int], weights: Numbers, responses: Numbers) -> Branch:
    return mpmath.fsum(weights[row] for row in rows), mpmath.fsum(responses[row] for row in rows)


def _explained(branches: Sequence[Branch]) -> mpf:
    return mpmath.fsum(response**2 / weight for weight, response in branches if weight)


@precisely()
def branch_sums(
    columns: Sequence[Sequence[int]], thresholds: Sequence[Sequence[float]], values: Sequence[Sequence[Sequence[float]]]
) -> Sums:
    """Return the sums of the branches' outputs of equal stumps; columns and thresholds (M, K), values (M, K, 3)."""
    outputs: dict[tuple[int, int, float], list[Sequence[float]]] = defaultdict(list)
    for of_round in zip(columns, thresholds, values, strict=True):
        for k, (column, threshold, branches) in enumerate(zip(*of_round, strict=True)):
            outputs[column, k, threshold].append(branches)
    return {stump: [added(of) for of in zip(*branches, strict=True)] for stump, branches in outputs.items()}


@precisely()
def scores(sums: Sums, n_classes: int, shrinkage: float, row: Mapping[int, float]) -> list[mpf]:
    """Return the part of F (K,) of the stumps on the columns of a row. A step is linear: it is one of all sums."""
    outputs: list[list[mpf]] = [[] for _ in range(n_classes)]
    for (column, k, threshold), (left, right, missing) in sums.items():
        if column in row:
            x = row[column]
            outputs[k].append(missing if math.isnan(x) else left if x <= threshold else right)
    g = [mpmath.fsum(of_class) * shrinkage for of_class in outputs]
    mean = mpmath.fsum(g) / n_classes
    return [(each - mean) * (n_classes - 1) / n_classes for each in g]
