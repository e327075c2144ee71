"""One round at 60 digits, class by class: what its stumps are fitted to, and how near they come to the best.

Every round is worked out from the scores before it, so that nothing of what went before is in its error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.boosting.stumps import Stumps

from ..finding import Worst
from ..inputs.hard_data import Floats, HardSet
from ..reference import stumps as truth
from ..reference.logistic import softmax, target
from ..reference.numbers import precisely
from .branches import Sums, choice_error, sums
from .roundings import ROUNDING, SMALLEST, share_error

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
