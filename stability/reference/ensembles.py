"""LogitBoost on stumps, round by round, and the scores of an ensemble that is there.

A round adds to F_k  f_k = (K-1)/K (g_k - mean_j g_j)  with g_k = shrinkage * answer of class k's stump (Friedman,
Hastie and Tibshirani 2000, algorithm 6, step 2b).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import mpmath
from mpmath import mpf

from .logistic import mean_loss, softmax, target
from .numbers import precisely
from .stumps import EQUAL, Split, best_splits, branch_values

Rows = Sequence[Sequence[float]]


class Round(NamedTuple):
    """One round: each class's splits, best first, what its best stump answers, and F (n, K) and the loss after it."""

    splits: list[list[Split]]
    values: list[tuple[mpf, mpf, mpf]]
    scores: list[list[mpf]]
    loss: mpf

    def leads(self) -> list[mpf]:
        """Return by which share of itself each class's best stump explains more than any unequal one; 1: none."""
        return [_lead(splits) for splits in self.splits]


@precisely()
def step(answers: Sequence[float], shrinkage: float) -> list[mpf]:
    """Return what a round adds to the K scores of a row."""
    g = [mpf(answer) * shrinkage for answer in answers]
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
    answers = [
        [answer(row[column], threshold, branches) for column, threshold, branches in zip(*stumps, strict=True)]
        for stumps in zip(columns, thresholds, values, strict=True)
    ]
    return step([mpmath.fsum(own) for own in zip(*answers, strict=True)], shrinkage)


def answer(x: float, threshold: float, branches: Sequence[float]) -> float:
    """Return what a stump answers to x: its value left, right, or where x is missing."""
    if math.isnan(x):
        return branches[2]
    return branches[0] if x <= threshold else branches[1]


def boost(
    X: Rows,
    labels: Sequence[int],
    n_classes: int,
    rounds: int,
    shrinkage: float = 1,
    z_max: float = 3,
    weights: Sequence[float] | None = None,
) -> tuple[list[mpf], list[list[mpf]]]:
    """Return (the loss before the first and after every round, F (n, K) after the last) of a whole training."""
    training = boost_rounds(X, labels, n_classes, rounds, shrinkage, z_max, weights)
    start = [[mpf(0)] * n_classes for _ in labels]
    first = mean_loss(start, labels, weights)
    return [first, *(each.loss for each in training)], training[-1].scores if training else start


def boost_rounds(
    X: Rows,
    labels: Sequence[int],
    n_classes: int,
    rounds: int,
    shrinkage: float = 1,
    z_max: float = 3,
    weights: Sequence[float] | None = None,
) -> list[Round]:
    """Train on X (n, d) of which at least one column varies; equal stumps: lowest column, lowest threshold."""
    F = [[mpf(0)] * n_classes for _ in labels]
    done: list[Round] = []
    for _ in range(rounds):
        done.append(_round(list(zip(*X, strict=True)), labels, F, shrinkage, z_max, weights))
        F = done[-1].scores
    return done


@precisely()
def _round(
    columns: Rows,
    labels: Sequence[int],
    F: list[list[mpf]],
    shrinkage: float,
    z_max: float,
    weights: Sequence[float] | None,
) -> Round:
    row_weights = [1] * len(labels) if weights is None else weights
    P = [softmax(row) for row in F]
    splits, values, answers = [], [], []
    for k in range(len(F[0])):
        targets = [target(P[i][k], label == k, z_max, row_weights[i]) for i, label in enumerate(labels)]
        w, r = [w for w, _ in targets], [w * z for w, z in targets]
        splits.append(best_splits(columns, w, r))
        _, column, lower, _ = splits[-1][0]
        values.append(branch_values(columns[column], w, r, lower, z_max))
        answers.append([answer(x, lower, values[-1]) for x in columns[column]])
    steps = [step(row, shrinkage) for row in zip(*answers, strict=True)]
    F = [[f + s for f, s in zip(*both, strict=True)] for both in zip(F, steps, strict=True)]
    return Round(splits, values, F, mean_loss(F, labels, weights))


@precisely()
def _lead(splits: list[Split]) -> mpf:
    best = splits[0][0]
    others = [split[0] for split in splits if best - split[0] > EQUAL * best]
    return (best - max(others)) / best if others else mpf(1)
