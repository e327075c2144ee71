"""One round at 60 digits, class by class, and the error bounds of its sums.

A class's weights w and responses r = w z are rounded to whole units (compiler/elementary.py), with a sum of
magnitudes of 2^50 to 2^52 units; the remainders are rounded to units 52 - log2(2 n) bits finer. All sums of units are
exact.

Every round is computed from the scores before it, so its error excludes earlier ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats
from thenar.compiler.trainers.stumps import Stumps

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
    def is_light(self) -> bool:
        """Whether the branch may count as empty."""
        return bool(self.weight < NEVER_EMPTY * self.all_weight or not self.all_weight)

    def error(self, got: float, z_max: float) -> float:
        """Return the error of an output, as a share of the rounding bound: of its mean, the mean of all, or either."""
        with precisely():
            if not self.all_weight:
                return float(got != 0.0)
            share = self.weight / self.all_weight
            possible = [self._mean(z_max)] if share > SURELY_EMPTY else []
            possible += [self._mean_of_all(z_max)] if share < NEVER_EMPTY else []
            return min(float(abs(got - value) / allowed) for value, allowed in possible)

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


def _clamped(value: mpf, z_max: float) -> mpf:
    return min(max(value, -mpf(z_max)), mpf(z_max))


Inputs = Floats | NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ClassRound:
    """One class in one round at 60 digits: w and w z of its rows (n,), and their rounding bounds."""

    k: int
    weights: list[mpf]
    responses: list[mpf]
    moved: list[mpf]

    @precisely()
    def branch(self, rows: Sequence[int]) -> Sums:
        """Return the sums of a branch."""
        parts = self.weights, self.responses, self.moved
        W, C, E = (mpmath.fsum(numbers[row] for row in rows) for numbers in parts)
        S, all_C, all_E = map(mpmath.fsum, parts)
        return Sums(W, C, E, S, all_C, all_E, mpmath.fsum(map(abs, self.responses)), len(self.weights))

    def explained(self, X: Inputs, column: int, threshold: float) -> mpf:
        """Return the variation explained by a stump."""
        return truth.explained(X[:, column].tolist(), self.weights, self.responses, threshold)

    def best(self, X: Inputs) -> mpf:
        """Return the variation explained by the best stump of X (n, d)."""
        return truth.best_splits(X.T.tolist(), self.weights, self.responses)[0][0]

    @precisely()
    def doubt(self, z_max: float) -> mpf:
        """Bound the difference in explained variation between the best and the chosen stump.

        Rounding n numbers by half a unit u changes the explained variation by E = n (z u_r + z^2 u_w / 2), with u at
        most 2^-50 of the sum. Two stumps count as equal within 2 E and 64 units of explained variation, u_r^2 / u_w:
        first among a column's splits, then among columns. With E twice for two stumps this gives 6 E and 128 units. A
        branch of share s below 2^-38 of the weight counts for a part s 2^38 of its explained variation, at most z^2 s:
        the loss is largest at half that share, z^2 2^-40 S, for each of two branches.

        C^2/W changes by 2 |v| dC + v^2 dW, |v| <= z_max, with the errors of w and w z, for each of the two.
        """
        S, R = mpmath.fsum(self.weights), mpmath.fsum(map(abs, self.responses))
        if not S:
            return mpf(0)
        rounded = len(self.weights) * mpf(2) ** -50 * (z_max * R + z_max**2 * S / 2)
        chosen = 6 * rounded + mpf(2) ** -41 * R**2 / S + 2 * z_max**2 * mpf(2) ** -40 * S
        return chosen + 2 * (2 * z_max + z_max**2) * mpmath.fsum(self.moved)


@precisely()
def class_rounds(
    F: Sequence[Sequence[float]],
    labels: Sequence[int],
    z_max: float,
    row_weights: Sequence[float],
) -> list[ClassRound]:
    """Return every class's weights and responses at scores F (n, K), for rows with `row_weights`.

    First, |dw| and |d(w z)| are at most u |dP|. In addition w = u |Y - P| max(own, 1/z_max) rounds 3 times, w z less
    often: 1 - P, 1/z_max and the product with it. So does the product with a row weight u, below 1 after scaling; an
    underflow there is off by a smallest double at each of two products.
    """
    by_row = [softmax(row) for row in F]
    rounds = []
    for k in range(len(by_row[0])):
        shares = [share[k] for share in by_row]
        targets = [target(P, label == k, z_max, u) for P, label, u in zip(shares, labels, row_weights, strict=True)]
        responses = [w * z for w, z in targets]
        errors = (u * share_error(row, k, P) for row, P, u in zip(F, shares, row_weights, strict=True))
        moved = [error + 4 * ROUNDING * abs(r) + 2 * SMALLEST for error, r in zip(errors, responses, strict=True)]
        rounds.append(ClassRound(k, [w for w, _ in targets], responses, moved))
    return rounds


def branches(x: Inputs, threshold: float) -> list[list[int]]:
    """Return the rows of inputs x (n,) that a stump sends left and right, and the missing ones (never for integers)."""
    parts = [x <= threshold, x > threshold]
    if x.dtype.kind == "f":
        parts.append(np.isnan(x))
    return [np.flatnonzero(part).tolist() for part in parts]


def see_round(
    hard: HardSet, stumps: Stumps, number: int, before: Floats, z_max: float, chosen: Worst, outputs: Worst
) -> None:
    """Compare all stumps of round `number` with the best ones, and their outputs with the branches' means.

    Given are the scores F (K, n) before the round, and the row weights.
    """
    row_weights = hard.scaled_weights.tolist()
    for given in class_rounds(before.T.tolist(), hard.labels.tolist(), z_max, row_weights):
        at = f"{hard.name}, round {number + 1}, class {given.k}"
        column, threshold = int(stumps.columns[number, given.k]), float(stumps.thresholds[number, given.k])
        with precisely():
            short = given.best(hard.X) - given.explained(hard.X, column, threshold)
            chosen.see(float(short / given.doubt(z_max)), at)
        parts = branches(hard.X[:, column], threshold)
        for value, rows in zip(stumps.values[number, given.k].tolist(), parts, strict=False):
            outputs.see(given.branch(rows).error(value, z_max), at)
