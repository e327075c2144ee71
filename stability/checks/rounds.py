"""The rounds of a training: each state of it, each round at 60 digits, and the error bounds of its numbers.

One rounding to nearest is off by at most 2^-53 of the number. All bounds are of first order, given as exact numbers:
products of two of them are negligible.

A class's weights w and responses r = w z are rounded to whole units (compiler/elementary.py), with a sum of
magnitudes of 2^50 to 2^52 units; the remainders are rounded to units 52 - log2(2 n) bits finer. All sums of units are
exact.

Every round is computed from the scores before it, so its error excludes earlier ones.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain, islice

import mpmath
import numpy as np
from mpmath import mpf

from thenar.compiler.elementary import Floats, softmax_and_losses
from thenar.compiler.trainers.logitboost import weights_and_responses
from thenar.compiler.trainers.stumps import Stumps

from ..finding import Finding
from ..inputs.hard_data import HardSet
from ..reference.boosting import best_splits, branches, explained, loss, softmax, target
from ..reference.numbers import precisely

ROUNDING = 2.0**-53  # the largest relative error of one rounding
SMALLEST = mpf(2) ** -1074
# exp within 1.06 ulp, each of at most 2^-52 of the number.
EXP_ROUNDINGS = 2.12
# A branch counts as empty below a share of 2^-38 of the weight; both are known to a few roundings.
SURELY_EMPTY, NEVER_EMPTY = mpf(2) ** -38 * (1 - 4 * ROUNDING), mpf(2) ** -38 * (1 + 4 * ROUNDING)
_TOGETHER = 128  # states that are computed at once

Rows = tuple[tuple[float, ...], ...]


@precisely()
def part_of(got: float, truth: mpf, allowed: mpf) -> float:
    """Return |got - truth| as a part of the allowed error; if that is 0, any error is infinite."""
    error = abs(mpf(float(got)) - truth)
    return float(error / allowed) if allowed else math.inf if error else 0.0


@precisely()
def share_error(scores: Sequence[float], k: int, share: mpf) -> mpf:
    """Bound the error of P_k = e^x_k / sum e^x_j, x_j = F_j - max F, of the scores F (K,).

    x is rounded once, by 2^-53 |x|, which e^x turns into a relative error; exp and the quotient round, as do the K - 1
    additions. In the sum an error of x_j counts only with its share, and e^x |x| <= 1/e: K/e altogether; that of exp
    counts 2.12 once. An underflow is off by two of the smallest doubles, one in exp and one in the quotient.
    """
    classes, below = len(scores), max(scores) - mpf(scores[k])
    relative = below + EXP_ROUNDINGS + 1 + (classes - 1) * (1 + 1 / mpmath.e) + EXP_ROUNDINGS
    return relative * ROUNDING * share + 2 * SMALLEST


@precisely()
def loss_error(rows: Sequence[Sequence[float]], labels: Sequence[int], weights: Sequence[float]) -> mpf:
    """Bound the error of the mean of -ln P(label) over rows of scores (n, K), weighted.

    The weight and the mean, a quotient of two correctly rounded sums, round 3 times. A power of two has scaled the
    heaviest weight to [1/2, 1) before: a subnormal weight or product may be off by half of the smallest double, the
    former times its loss. The sum that divides them is at least 1/2, so that each counts once; an error of this size in
    that sum is negligible. The mean itself may be subnormal: 2 is more than enough for that.
    """
    labelled = list(zip(map(tuple, rows), labels, strict=True))
    errors, losses = ([of(*row) for row in labelled] for of in (_row_error, loss))
    parts = (u * (error + 3 * ROUNDING * each) for u, error, each in zip(weights, errors, losses, strict=True))
    return mpmath.fsum(parts) / mpmath.fsum(weights) + (2 + mpmath.fsum(1 + each for each in losses)) * SMALLEST


@lru_cache(maxsize=1 << 12)
@precisely()
def _row_error(row: tuple[float, ...], label: int) -> mpf:
    """Bound the error of the loss of one row.

    For the largest score the loss is ln(1 + s), s = sum of e^x over the others: relative errors of s, and so of the
    logarithm, are |x| of each by its part of s, that of exp and those of K - 2 additions; ln within 2 ulp counts for 4,
    and the last two operations for one each. For another score it is ln t + gap, t = sum of all e^x: a relative error
    of t is an absolute one of its logarithm; in t, x counts as in `share_error`. The gap rounds, and so does the sum.
    """
    classes, gap = len(row), max(row) - mpf(row[label])
    if gap:
        inner = (classes - 1) * (1 + 1 / mpmath.e) + EXP_ROUNDINGS + 4 * math.log(classes)
        return (inner + gap + loss(row, label)) * ROUNDING
    below = {score: mpf(row[label]) - score for score in set(row)}
    powers = {score: mpmath.exp(-x) for score, x in below.items()}
    products = {score: x * powers[score] for score, x in below.items()}
    others = [score for k, score in enumerate(row) if k != label]
    spread = mpmath.fsum(products[score] for score in others) / mpmath.fsum(powers[score] for score in others)
    return (spread + EXP_ROUNDINGS + classes + 4) * ROUNDING * loss(row, label) + classes * SMALLEST


@dataclass(frozen=True, slots=True, eq=False)
class RoundState:
    """The state after a round: scores F and shares P (K, n), weights w and weighted responses w z (K, n) of the next
    round, and the loss.
    """

    scores: Floats
    shares: Floats
    weights: Floats
    responses: Floats
    loss: float


def moments(hard: HardSet, stumps: Stumps, z_max: float = 3.0) -> Iterator[RoundState]:
    """Yield the state before the first round and after every round, equal to the training's to the last bit."""
    (K, n), row_weights = hard.member.shape, hard.scaled_weights
    stages = chain([np.zeros((n, K))], stumps.staged_scores(hard.X))
    while stack := list(islice(stages, _TOGETHER)):
        times = len(stack)
        scores = np.concatenate([stage.T for stage in stack], axis=1)
        shares, losses = softmax_and_losses(scores, np.tile(hard.labels, times))
        weights = np.tile(row_weights, times)
        w, responses = weights_and_responses(shares, np.tile(hard.member, times), z_max, weights)
        for start, total in zip(range(0, n * times, n), (losses * weights).reshape(times, n).tolist(), strict=True):
            F, P, own, r = (part[:, start : start + n] for part in (scores, shares, w, responses))
            yield RoundState(F, P, own, r, math.fsum(total) / math.fsum(row_weights.tolist()))


def rise_rounding(n_classes: int, before: RoundState, after: RoundState, z_max: float = 3.0) -> float:
    """Return the largest rise of the computed loss in a round that does not raise the exact loss.

    Both losses are rounded. Scores are rounded to doubles, which changes a loss L by at most 2 |F| L: |dL/dF| is at
    most 2 (1 - P), and 1 - P <= L. Also, a row whose P rounds to 1 has no weight for its own class's stump, though
    1 - P is up to (K - 1) 2^-53: one class of K changes its score blindly, which can multiply this gap by e^z_max.
    """
    rounded = loss_rounding(n_classes, before.loss) + loss_rounding(n_classes, after.loss)
    largest = max(float(np.abs(moment.scores).max()) for moment in (before, after))
    held = ROUNDING * 2 * largest * (before.loss + after.loss)
    blind = ROUNDING * (n_classes - 1) / n_classes * math.expm1(z_max)
    return rounded + held + blind


def loss_rounding(n_classes: int, loss: float) -> float:
    """Return the largest error of the computed loss of K classes, given the scores.

    For a row, in units of 2^-53, with d the distances of the scores to their largest: exp is within 2 of e^-d, rounding
    of d adds sum p d <= ln K to their sum, K - 1 additions as many again; ln is within 2 ulp, at most 4 of ln K; the
    difference of the largest and the label's score, and its addition, 2 of the loss; the weight, the two sums and their
    quotient 4 of the loss.
    """
    return ROUNDING * (2 + math.log(n_classes) + (n_classes - 1) + 4 * math.log(n_classes) + 6 * loss)


@dataclass(frozen=True)
class ClassRound:
    """One class in one round at 60 digits: input columns, w and w z of its rows (n,), and their rounding bounds."""

    columns: Sequence[Sequence[float]]
    weights: Sequence[mpf]
    responses: Sequence[mpf]
    moved: Sequence[mpf]
    z_max: float

    @cached_property
    @precisely()
    def sums(self) -> tuple[mpf, mpf, mpf, mpf]:
        """S = sum w, C = sum w z, the sum of their bounds, and R = sum |w z|, over all rows."""
        parts = self.weights, self.responses, self.moved
        return *map(mpmath.fsum, parts), mpmath.fsum(map(abs, self.responses))

    @cached_property
    def best(self) -> mpf:
        """The variation explained by the best stump."""
        return best_splits(self.columns, self.weights, self.responses)[0][0]

    @cached_property
    @precisely()
    def doubt(self) -> mpf:
        """The largest difference in explained variation between the best and the chosen stump.

        Rounding n numbers by half a unit u changes the explained variation by E = n (z u_r + z^2 u_w / 2), with u at
        most 2^-50 of the sum. Two stumps count as equal within 2 E and 64 units of explained variation, u_r^2 / u_w:
        first among a column's splits, then among columns. With E twice for two stumps this gives 6 E and 128 units. A
        branch of share s below 2^-38 of the weight counts for a part s 2^38 of its explained variation, at most z^2 s:
        the loss is largest at half that share, z^2 2^-40 S, for each of two branches.

        C^2/W changes by 2 |v| dC + v^2 dW, |v| <= z_max, with the errors of w and w z, for each of the two.
        """
        (S, _, moved, R), z_max = self.sums, self.z_max
        if not S:
            return mpf(0)
        rounded = len(self.weights) * mpf(2) ** -50 * (z_max * R + z_max**2 * S / 2)
        chosen = 6 * rounded + mpf(2) ** -41 * R**2 / S + 2 * z_max**2 * mpf(2) ** -40 * S
        return chosen + 2 * (2 * z_max + z_max**2) * moved

    @precisely()
    def lost(self, column: int, threshold: float) -> float:
        """Return how much less variation a stump explains than the best one, as a part of `doubt`."""
        short = self.best - explained(self.columns[column], self.weights, self.responses, threshold)
        return float(short / self.doubt) if self.doubt else math.inf if short else 0.0

    @precisely()
    def errors(self, column: int, threshold: float, values: Sequence[float]) -> list[tuple[float, bool]]:
        """Return the error of the output of each branch, and whether the branch may count as empty.

        The error is a part of the rounding bound: that of the branch's mean, of the mean of all, or of either.
        """
        rows = branches(self.columns[column], threshold)
        return [self._error(value, of) for value, of in zip(values, rows, strict=False)]

    def _error(self, got: float, rows: Sequence[int]) -> tuple[float, bool]:
        S, C_of_all, moved_of_all, R = self.sums
        W, C, moved = (mpmath.fsum(of[row] for row in rows) for of in (self.weights, self.responses, self.moved))
        if not S:
            return float(got != 0.0), True
        possible = []
        if W / S > SURELY_EMPTY:
            # W, C and their quotient round once each. n/2 units of the finer grid are at most n^2 2^-102 of the sum.
            value = C / W
            grids = len(self.weights) ** 2 * mpf(2) ** -102 * (R + abs(value) * S) / W
            possible.append((value, 3 * ROUNDING * abs(value) + grids + (1 + abs(value)) * moved / W))
        if W / S < NEVER_EMPTY:
            # The sums of three branches, each rounded, are added with two roundings; those of C may cancel.
            value = C_of_all / S
            rounded = ROUNDING * (3 * R / S + 4 * abs(value))
            possible.append((value, rounded + (1 + abs(value)) * moved_of_all / S))
        z_max = mpf(self.z_max)
        errors = (part_of(got, min(max(value, -z_max), z_max), allowed) for value, allowed in possible)
        return min(errors), bool(W < NEVER_EMPTY * S)


@lru_cache(maxsize=256)
def _class_rounds(
    X: Rows, F: Rows, labels: tuple[int, ...], z_max: float, row_weights: tuple[float, ...]
) -> list[ClassRound]:
    """Return every class's weights and responses at scores F (n, K), for rows X (n, d) with `row_weights`."""
    by_row = [_targets(*row, z_max) for row in zip(F, labels, row_weights, strict=True)]
    columns, rounds = tuple(zip(*X, strict=True)), []
    for of_class in zip(*by_row, strict=True):
        weights, responses, moved = zip(*of_class, strict=True)
        rounds.append(ClassRound(columns, weights, responses, moved, z_max))
    return rounds


@lru_cache(maxsize=1 << 12)
@precisely()
def _targets(scores: tuple[float, ...], label: int, row_weight: float, z_max: float) -> list[tuple[mpf, mpf, mpf]]:
    """Return w, w z and the bound of their errors for each class of one row.

    First, |dw| and |d(w z)| are at most u |dP|. In addition w = u |Y - P| max(own, 1/z_max) rounds 3 times, w z less
    often: 1 - P, 1/z_max and the product with it. So does the product with a row weight u, below 1 after scaling; an
    underflow there is off by a smallest double at each of two products.
    """
    parts = []
    for k, share in enumerate(softmax(scores)):
        w, z = target(share, k == label, z_max, row_weight)
        moved = row_weight * share_error(scores, k, share) + 4 * ROUNDING * abs(w * z) + 2 * SMALLEST
        parts.append((w, w * z, moved))
    return parts


def see_round(
    hard: HardSet, stumps: Stumps, number: int, before: Floats, z_max: float, chosen: Finding, outputs: Finding
) -> None:
    """Compare all stumps of round `number` with the best ones, and their outputs with the branches' means.

    Given are the scores F (K, n) before the round, and the row weights.
    """
    X, F = (tuple(map(tuple, rows.tolist())) for rows in (hard.X, before.T))
    rounds = _class_rounds(X, F, tuple(hard.labels.tolist()), z_max, tuple(hard.scaled_weights.tolist()))
    for k, given in enumerate(rounds):
        at = f"{hard.name}, round {number + 1}, class {k}"
        stump = int(stumps.columns[number, k]), float(stumps.thresholds[number, k])
        chosen.see(given.lost(*stump), at)
        # No input is missing.
        for error, _ in given.errors(*stump, stumps.values[number, k, :2].tolist()):
            outputs.see(error, at)
