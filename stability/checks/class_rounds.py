"""One round at 60 digits, class by class, the error bounds of its sums, and the growth of errors over rounds.

A class's weights w and responses r = w z are rounded to whole units (compiler/boosting/exactsums.py), with a sum of
magnitudes of 2^50 to 2^52 units; the remainders are rounded to units 52 - log2(2 n) bits finer. All sums of units are
exact.

Every round is computed from the scores before it, so its error excludes earlier ones.

A round maps F to F + step(v(P(F))). With the same stumps and the same clamps, v = C/W of a branch changes with the P of
its rows by dv/dP_i = (-1 - v dw_i/dP_i) / W, and P with F by dP_ik/dF_ij = P_ik (1[k = j] - P_ij). So the error added
in a round is multiplied by the Jacobians of all later rounds.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.boosting.stumps import Stumps
from thenar.compiler.elementary import Floats

from ..finding import Worst
from ..inputs.hard_data import HardSet
from ..reference import boosting as truth
from ..reference.boosting import softmax, target
from ..reference.numbers import precisely
from .roundings import ROUNDING, SMALLEST, share_error

# A branch counts as empty below a share of 2^-38 of the weight; both are known to a few roundings.
SURELY_EMPTY, NEVER_EMPTY = mpf(2) ** -38 * (1 - 4 * ROUNDING), mpf(2) ** -38 * (1 + 4 * ROUNDING)


@dataclass(frozen=True, slots=True)
class Sums:
    """W and C of a branch, and the sums of its class: S = sum w and R = sum |w z| over all its n rows.

    moved and all_moved: the error bounds of the terms of W and C.
    """

    weight: mpf
    response: mpf
    moved: mpf
    all_weight: mpf
    all_response: mpf
    all_moved: mpf
    magnitude: mpf
    rows: int

    @property
    def share(self) -> mpf:
        """W / S."""
        return self.weight / self.all_weight

    @property
    def is_light(self) -> bool:
        """Whether the branch may count as empty."""
        return bool(self.weight < NEVER_EMPTY * self.all_weight or not self.all_weight)

    def outputs(self, z_max: float) -> Iterator[tuple[mpf, mpf]]:
        """Yield the possible outputs of the branch, each with its error bound: its mean, the mean of all, or both."""
        if self.share > SURELY_EMPTY:
            yield self._mean(z_max)
        if self.share < NEVER_EMPTY:
            yield self._mean_of_all(z_max)

    def error(self, got: float, z_max: float) -> float:
        """Return the error of an output, as a share of the rounding bound."""
        with precisely():
            if not self.all_weight:
                return float(got != 0.0)
            return min(float(abs(got - value) / allowed) for value, allowed in self.outputs(z_max))

    def _mean(self, z_max: float) -> tuple[mpf, mpf]:
        # W, C and their quotient round once each. n/2 units of the finer grid are at most n^2 2^-102 of the sum.
        value = self.response / self.weight
        grids = self.rows**2 * mpf(2) ** -102 * (self.magnitude + abs(value) * self.all_weight) / self.weight
        return _clamped(value, z_max), 3 * ROUNDING * abs(value) + grids + (1 + abs(value)) * self.moved / self.weight

    def _mean_of_all(self, z_max: float) -> tuple[mpf, mpf]:
        # The sums of three branches, each rounded, are added with two roundings; those of C may cancel.
        value = self.all_response / self.all_weight
        rounded = ROUNDING * (3 * self.magnitude / self.all_weight + 4 * abs(value))
        return _clamped(value, z_max), rounded + (1 + abs(value)) * self.all_moved / self.all_weight


@precisely()
def sums(rows: Sequence[int], weights: Sequence[mpf], responses: Sequence[mpf], moved: Sequence[mpf]) -> Sums:
    """Return the sums of the branch of `rows`, for a class's weights, responses and their errors (n,)."""
    W, C, E = (mpmath.fsum(numbers[row] for row in rows) for numbers in (weights, responses, moved))
    S, all_C, all_E = (mpmath.fsum(numbers) for numbers in (weights, responses, moved))
    return Sums(W, C, E, S, all_C, all_E, mpmath.fsum(map(abs, responses)), len(weights))


@precisely()
def choice_error(weights: Sequence[mpf], responses: Sequence[mpf], z_max: float) -> mpf:
    """Bound the difference in explained variation between the best and the chosen stump of a class (n rows).

    Rounding n numbers by half a unit u changes the explained variation by E = n (z u_r + z^2 u_w / 2), with u at most
    2^-50 of the sum. Two stumps count as equal within 2 E and 64 units of explained variation, u_r^2 / u_w: first among
    a column's splits, then among columns. With E twice for two stumps this gives 6 E and 128 units. A branch of share
    s below 2^-38 of the weight counts for a part s 2^38 of its explained variation, at most z^2 s: the loss is largest
    at half that share, z^2 2^-40 S, for each of two branches.
    """
    S, R = mpmath.fsum(weights), mpmath.fsum(map(abs, responses))
    if not S:
        return mpf(0)
    moved = len(weights) * mpf(2) ** -50 * (z_max * R + z_max**2 * S / 2)
    return 6 * moved + mpf(2) ** -41 * R**2 / S + 2 * z_max**2 * mpf(2) ** -40 * S


def _clamped(value: mpf, z_max: float) -> mpf:
    return min(max(value, -mpf(z_max)), mpf(z_max))


Inputs = Floats | NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ClassRound:
    """One class in one round at 60 digits: P, w and w z of its rows (n,), and the rounding bounds of w and w z."""

    k: int
    shares: list[mpf]
    weights: list[mpf]
    responses: list[mpf]
    moved: list[mpf]

    def branch(self, rows: Sequence[int]) -> Sums:
        """Return the sums of a branch."""
        return sums(rows, self.weights, self.responses, self.moved)

    def explained(self, X: Inputs, column: int, threshold: float) -> mpf:
        """Return the variation explained by a stump."""
        return truth.explained(X[:, column].tolist(), self.weights, self.responses, threshold)

    def best(self, X: Inputs) -> mpf:
        """Return the variation explained by the best stump of X (n, d)."""
        return truth.best_splits(X.T.tolist(), self.weights, self.responses)[0][0]

    @precisely()
    def doubt(self, z_max: float, coarser: float = 1.0) -> mpf:
        """Bound the difference in explained variation at which either of two stumps may be chosen.

        C^2/W changes by 2 |v| dC + v^2 dW, |v| <= z_max, for each of the two; and training sums on a grid, which is
        `coarser` times as coarse with as many times the rows.
        """
        moved = (2 * z_max + z_max**2) * mpmath.fsum(self.moved)
        return coarser * choice_error(self.weights, self.responses, z_max) + 2 * moved


@precisely()
def class_rounds(
    F: Sequence[Sequence[float]],
    labels: Sequence[int],
    z_max: float,
    row_weights: Sequence[float] | None = None,
) -> list[ClassRound]:
    """Return every class's weights and responses at scores F (n, K), for rows with `row_weights`; None: 1 each.

    First, |dw| and |d(w z)| are at most u |dP|. In addition w = u |Y - P| max(own, 1/z_max) rounds 3 times, w z less
    often: 1 - P, 1/z_max and the product with it. So does the product with a row weight u, below 1 after scaling; an
    underflow there is off by a smallest double at each of two products.
    """
    by_row = [softmax(row) for row in F]
    us, roundings, lost = ([1.0] * len(labels), 3, mpf(0)) if row_weights is None else (row_weights, 4, 2 * SMALLEST)
    rounds = []
    for k in range(len(by_row[0])):
        shares = [share[k] for share in by_row]
        targets = [target(P, label == k, z_max, u) for P, label, u in zip(shares, labels, us, strict=True)]
        responses = [w * z for w, z in targets]
        errors = (u * share_error(row, k, P) for row, P, u in zip(F, shares, us, strict=True))
        moved = [error + roundings * ROUNDING * abs(r) + lost for error, r in zip(errors, responses, strict=True)]
        rounds.append(ClassRound(k, shares, [w for w, _ in targets], responses, moved))
    return rounds


def branches(x: Inputs, threshold: float) -> list[list[int]]:
    """Return the rows of inputs x (n,) that a stump sends left and right, and the missing ones (never for integers)."""
    parts = [x <= threshold, x > threshold]
    if x.dtype.kind == "f":
        parts.append(np.isnan(x))
    return [np.flatnonzero(part).tolist() for part in parts]


def see_stump(
    given: ClassRound, X: Inputs, stumps: Stumps, number: int, z_max: float, at: str, chosen: Worst, outputs: Worst
) -> None:
    """Compare a class's stump of round `number` with the best one, and its outputs with the branches' means."""
    column, threshold = int(stumps.columns[number, given.k]), float(stumps.thresholds[number, given.k])
    with precisely():
        short = given.best(X) - given.explained(X, column, threshold)
        chosen.see(float(short / given.doubt(z_max)), at)
    parts = branches(X[:, column], threshold)
    for value, rows in zip(stumps.values[number, given.k].tolist(), parts, strict=False):
        outputs.see(given.branch(rows).error(value, z_max), at)


def see_round(
    hard: HardSet, stumps: Stumps, number: int, before: Floats, z_max: float, chosen: Worst, outputs: Worst
) -> None:
    """Compare all stumps of round `number` in this way, given the scores F (K, n) before it and the row weights."""
    row_weights = hard.scaled_weights.tolist()
    for given in class_rounds(before.T.tolist(), hard.labels.tolist(), z_max, row_weights):
        at = f"{hard.name}, round {number + 1}, class {given.k}"
        see_stump(given, hard.X, stumps, number, z_max, at, chosen, outputs)


@dataclass(frozen=True, slots=True)
class Step:
    """One round of n rows and K classes: its new error of F, and its effect on the earlier error."""

    added: Floats  # (n K,)
    jacobian: Floats  # (n K, n K)

    def on_scores_of(self, largest: float) -> "Step":
        """Return the step including one rounding of F, |F| <= largest."""
        return Step(self.added + ROUNDING * largest, self.jacobian)


def step_of(
    rounds: Sequence[ClassRound],
    branches: Sequence[Sequence[Sequence[int]]],
    labels: Sequence[int],
    shrinkage: float,
    z_max: float,
) -> Step:
    """Return the step of a round whose stump of class k splits the rows into `branches[k]`, without rounding of F."""
    K, n = len(rounds), len(labels)
    spread = shrinkage * (K - 1) / K * (np.eye(K) - 1 / K)
    P = np.array([[float(share) for share in each.shares] for each in rounds])
    by_share, errors = np.zeros((K, n, n)), np.zeros((K, n))
    for each, parts in zip(rounds, branches, strict=True):
        slopes = np.array([_slope(p, label == each.k, z_max) for p, label in zip(P[each.k], labels, strict=True)])
        for rows in parts:
            of = each.branch(rows)
            value, allowed = next(iter(of.outputs(z_max)))
            errors[each.k, rows] = float(allowed)
            if abs(value) < z_max:
                by_share[each.k][np.ix_(rows, rows)] = (-1 - float(value) * slopes[rows]) / float(of.weight)
    # dP_ik / dF_ij
    by_score = np.einsum("ki,kj->kij", P, np.eye(K)) - np.einsum("ki,ji->kij", P, P)
    jacobian = np.eye(n * K) + np.einsum("ck,kli,kij->lcij", spread, by_share, by_score).reshape(n * K, n * K)
    # A centred step rounds K + 6 times.
    rounded = ROUNDING * (K + 6) * shrinkage * z_max
    return Step((np.abs(spread) @ errors).T.ravel() + rounded, jacobian)


def grown(steps: Sequence[Step]) -> Floats:
    """Bound the error of F (n K,) after all steps."""
    onwards, total = np.eye(len(steps[0].added)), np.zeros(len(steps[0].added))
    for step in reversed(steps):
        total += np.abs(onwards) @ step.added
        onwards = onwards @ step.jacobian
    return total


def _slope(p: float, is_member: bool, z_max: float) -> float:
    """Return dw/dP: w = P (1 - P), or if z is clamped |Y - P| / z_max."""
    if (p if is_member else 1 - p) * z_max > 1:
        return 1 - 2 * p
    return -1 / z_max if is_member else 1 / z_max
