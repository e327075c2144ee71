"""How an error of the scores grows from round to round of a whole training: to first order, by its Jacobian.

A round takes F to F + step(v(P(F))). With the same stumps and the same clamps, v = C/W of a branch moves with the P of
its rows by dv/dP_i = (-1 - v dw_i/dP_i) / W, and P with F by dP_ik/dF_ij = P_ik (1[k = j] - P_ij). So what a round adds
to the error is multiplied by the Jacobians of all the rounds after it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .class_rounds import ClassRound
from .roundings import ROUNDING

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Step:
    """One round of n rows and K classes: what it adds to the error of F, and what it makes of the error there was."""

    added: Floats  # (n K,)
    jacobian: Floats  # (n K, n K)


def step_of(
    rounds: Sequence[ClassRound],
    branches: Sequence[Sequence[Sequence[int]]],
    labels: Sequence[int],
    shrinkage: float,
    z_max: float,
    largest: float,
) -> Step:
    """Return the step of a round whose stump of class k parts the rows into `branches[k]`; |F| <= largest."""
    K, n = len(rounds), len(labels)
    spread = shrinkage * (K - 1) / K * (np.eye(K) - 1 / K)
    P = np.array([[float(share) for share in each.shares] for each in rounds])
    by_share, errors = np.zeros((K, n, n)), np.zeros((K, n))
    for each, parts in zip(rounds, branches, strict=True):
        slopes = np.array([_slope(p, label == each.k, z_max) for p, label in zip(P[each.k], labels, strict=True)])
        for rows in parts:
            of = each.branch(rows)
            value, allowed = next(iter(of.answers(z_max)))
            errors[each.k, rows] = float(allowed)
            if abs(value) < z_max:
                by_share[each.k][np.ix_(rows, rows)] = (-1 - float(value) * slopes[rows]) / float(of.weight)
    # dP_ik / dF_ij
    by_score = np.einsum("ki,kj->kij", P, np.eye(K)) - np.einsum("ki,ji->kij", P, P)
    jacobian = np.eye(n * K) + np.einsum("ck,kli,kij->lcij", spread, by_share, by_score).reshape(n * K, n * K)
    # A centred step rounds K + 6 times, and F once.
    rounded = ROUNDING * ((K + 6) * shrinkage * z_max + largest)
    return Step((np.abs(spread) @ errors).T.ravel() + rounded, jacobian)


def grown(steps: Sequence[Step]) -> Floats:
    """Bound the error of F (n K,) after all steps."""
    onwards, total = np.eye(len(steps[0].added)), np.zeros(len(steps[0].added))
    for step in reversed(steps):
        total += np.abs(onwards) @ step.added
        onwards = onwards @ step.jacobian
    return total


def _slope(p: float, is_member: bool, z_max: float) -> float:
    """Return dw/dP: w = P (1 - P), or where z is clamped |Y - P| / z_max."""
    if (p if is_member else 1 - p) * z_max > 1:
        return 1 - 2 * p
    return -1 / z_max if is_member else 1 / z_max
