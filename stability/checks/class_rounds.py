"""One round at 60 digits, class by class, how far its sums may be off, and how errors grow from round to round.

A class's weights w and responses r = w z are rounded to whole units (compiler/boosting/exactsums.py), of which the sum
of magnitudes makes 2^50 to 2^52; what is left is rounded to units 52 - log2(2 n) bits finer. All sums of units are
exact.

Every round is worked out from the scores before it, so that nothing of what went before is in its error.

A round takes F to F + step(v(P(F))). With the same stumps and the same clamps, v = C/W of a branch moves with the P of
its rows by dv/dP_i = (-1 - v dw_i/dP_i) / W, and P with F by dP_ik/dF_ij = P_ik (1[k = j] - P_ij). So what a round adds
to the error is multiplied by the Jacobians of all the rounds after it.
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

# A branch counts as empty below a share of 2^-38 of the weight, of which both are known to a few roundings.
SURELY_EMPTY, NEVER_EMPTY = mpf(2) ** -38 * (1 - 4 * ROUNDING), mpf(2) ** -38 * (1 + 4 * ROUNDING)


@dataclass(frozen=True, slots=True)
class Sums:
    """W and C of a branch, beside those of its class: S = sum w and R = sum |w z| over all of its n rows.

    moved and all_moved: by how much what went into W and C may itself be off.
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

    def answers(self, z_max: float) -> Iterator[tuple[mpf, mpf]]:
        """Yield what the branch may answer, each with a bound of its error: its mean, the mean of all, or either."""
        if self.share > SURELY_EMPTY:
            yield self._mean(z_max)
        if self.share < NEVER_EMPTY:
            yield self._mean_of_all(z_max)

    def error(self, got: float, z_max: float) -> float:
        """Return the error of an answer, as a share of what rounding allows."""
        with precisely():
            if not self.all_weight:
                return float(got != 0.0)
            return min(float(abs(got - value) / allowed) for value, allowed in self.answers(z_max))

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
    """Return the sums of the branch that holds `rows`, of a class's weights, responses and their errors (n,)."""
    W, C, E = (mpmath.fsum(numbers[row] for row in rows) for numbers in (weights, responses, moved))
    S, all_C, all_E = (mpmath.fsum(numbers) for numbers in (weights, responses, moved))
    return Sums(W, C, E, S, all_C, all_E, mpmath.fsum(map(abs, responses)), len(weights))


@precisely()
def choice_error(weights: Sequence[mpf], responses: Sequence[mpf], z_max: float) -> mpf:
    """Bound how much less than the best a chosen stump explains, of a class's weights and responses (n,).

    Rounding n numbers by half a unit u moves what a stump explains by E = n (z u_r + z^2 u_w / 2), u at most 2^-50 of
    the sum. Two stumps are taken for equal within 2 E and 64 units of what is explained, u_r^2 / u_w: of a column's
    splits first, then of columns. With E twice for two stumps that makes 6 E and 128 units. A branch of share s below
    2^-38 of the weight counts for a part s 2^38 of what it explains, z^2 s at most: the loss is largest at half that
    share, z^2 2^-40 S, for each of two branches.
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
    """One class in one round at 60 digits: P, w and w z of its rows (n,), and how far rounding may move w and w z."""

    k: int
    shares: list[mpf]
    weights: list[mpf]
    responses: list[mpf]
    moved: list[mpf]

    def branch(self, rows: Sequence[int]) -> Sums:
        """Return the sums of a branch."""
        return sums(rows, self.weights, self.responses, self.moved)

    def explained(self, X: Inputs, column: int, threshold: float) -> mpf:
        """Return what a stump explains."""
        return truth.explained(X[:, column].tolist(), self.weights, self.responses, threshold)

    def best(self, X: Inputs) -> mpf:
        """Return what the best stump of X (n, d) explains."""
        return truth.best_splits(X.T.tolist(), self.weights, self.responses)[0][0]

    @precisely()
    def doubt(self, z_max: float, coarser: float = 1.0) -> mpf:
        """Bound by how much what two stumps explain differs, of which either may be chosen.

        C^2/W moves by 2 |v| dC + v^2 dW, |v| <= z_max, for each of the two; and training sums on a grid, `coarser`
        times as coarse where its rows are as many times as many.
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
    """Return every class's weights and responses at scores F (n, K), of rows that weigh `row_weights`; None: 1 each.

    |dw| and |d(w z)| are at most u |dP|, first. w = u |Y - P| max(own, 1/z_max) rounds 3 times besides, w z less:
    1 - P, 1/z_max and the product with it. So does the product with a row weight u, below 1 as training sees it; what
    then underflows is off by a smallest double at each of two products.
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
    """Return the rows of inputs x (n,) that a stump sends left and right, and the missing; whole numbers never are."""
    parts = [x <= threshold, x > threshold]
    if x.dtype.kind == "f":
        parts.append(np.isnan(x))
    return [np.flatnonzero(part).tolist() for part in parts]


def see_stump(
    given: ClassRound, X: Inputs, stumps: Stumps, number: int, z_max: float, at: str, chosen: Worst, answers: Worst
) -> None:
    """Hold a class's stump of round `number` against the best one, and its answers against the branches' means."""
    column, threshold = int(stumps.columns[number, given.k]), float(stumps.thresholds[number, given.k])
    with precisely():
        short = given.best(X) - given.explained(X, column, threshold)
        chosen.see(float(short / given.doubt(z_max)), at)
    parts = branches(X[:, column], threshold)
    for value, rows in zip(stumps.values[number, given.k].tolist(), parts, strict=False):
        answers.see(given.branch(rows).error(value, z_max), at)


def see_round(
    hard: HardSet, stumps: Stumps, number: int, before: Floats, z_max: float, chosen: Worst, answers: Worst
) -> None:
    """Hold the stumps of round `number` so, from the scores F (K, n) before it and under the set's row weights."""
    row_weights = hard.scaled_weights.tolist()
    for given in class_rounds(before.T.tolist(), hard.labels.tolist(), z_max, row_weights):
        at = f"{hard.name}, round {number + 1}, class {given.k}"
        see_stump(given, hard.X, stumps, number, z_max, at, chosen, answers)


@dataclass(frozen=True, slots=True)
class Step:
    """One round of n rows and K classes: what it adds to the error of F, and what it makes of the error there was."""

    added: Floats  # (n K,)
    jacobian: Floats  # (n K, n K)

    def on_scores_of(self, largest: float) -> "Step":
        """Return the step with the rounding of F, once, |F| <= largest."""
        return Step(self.added + ROUNDING * largest, self.jacobian)


def step_of(
    rounds: Sequence[ClassRound],
    branches: Sequence[Sequence[Sequence[int]]],
    labels: Sequence[int],
    shrinkage: float,
    z_max: float,
) -> Step:
    """Return the step of a round whose stump of class k parts the rows into `branches[k]`, F itself not rounded yet."""
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
    """Return dw/dP: w = P (1 - P), or where z is clamped |Y - P| / z_max."""
    if (p if is_member else 1 - p) * z_max > 1:
        return 1 - 2 * p
    return -1 / z_max if is_member else 1 / z_max
