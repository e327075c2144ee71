"""Multinomial logistic regression on inputs of a glove, that can be continued, with or without some of them."""

from copy import copy
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ..elementary import SUM_BITS, Floats, dot, exact_sum, softmax_and_loss

RIDGE = 1.0
# Inputs that are no bits are multiples of 2^-MARK_BITS, of a magnitude of at most 2^REACH_BITS.
MARK_BITS, REACH_BITS = 5, 3
# Steps that L-BFGS remembers: how rows moved, how the gradient turned, and the product of both.
_MEMORY = 6
_Pair = tuple[Floats, Floats, float]
# Rows are multiples of 2^-28, below 2^24 in sum (2^16 if inputs are no bits), so every sum of them is exact.
_ROW_BITS = 28
_ENOUGH = 1e-4  # of the slope, for Armijo's rule
_MOST_HALVINGS = 12


class Logistic:
    """Multinomial logistic regression on `inputs` (c, n), that can be continued, with or without all its columns.

    Inputs are bits (bool), or numbers on the marks of `lines`.

    Boosted stumps on bits are a row of scores for each bit, added where it is set; boosting approaches them one column
    a round and stops early. Here all rows W (c + 1, K) are fitted at once to labels (n,), to the minimum of

        sum over frames of -ln P(class) + ridge / 2 * (sum of squares of the inputs' rows),    F = W' [inputs; 1]

    so the value of a row does not depend on the order of rounds. The fit uses L-BFGS (Nocedal and Wright, Numerical
    Optimization, 2nd ed., algorithm 7.4). Rows and residuals are put on grids on which matrix products are exact, so
    the fit has the same bits on every machine.

    rows         (c + 1, K) on the grid, the last one the bias
    probability  (K, n) P of every class in every frame, at `rows`
    """

    def __init__(
        self, inputs: NDArray[np.bool_] | Floats, labels: NDArray[np.intp], n_classes: int, ridge: float = RIDGE
    ) -> None:
        n = inputs.shape[1]
        self._inputs = np.concatenate([inputs, np.ones((1, n), np.bool_)]).astype(np.float64)
        self._labels, self._ridge = labels, ridge
        self._member = (labels == np.arange(n_classes)[:, np.newaxis]).astype(np.float64)
        self._residual_bits = SUM_BITS - n.bit_length() - (0 if inputs.dtype == bool else MARK_BITS + REACH_BITS)
        self._pairs: list[_Pair] = []
        self._stand(np.zeros((len(self._inputs), n_classes)))

    def improve(self, iterations: int, tolerance: float = 0.0) -> None:
        """Take up to `iterations` steps of L-BFGS, until one lowers the loss by less than this share, or not at all."""
        for _ in range(iterations):
            before = self.loss
            if not self._step() or before - self.loss < tolerance * before:
                return

    def having(self, column: Floats) -> "Logistic":
        """Return the fit with one more column (n,) after the others, whose row is 0."""
        more = copy(self)
        more._inputs = np.insert(self._inputs, -1, column, axis=0)
        more._pairs = []
        more._stand(np.insert(self.rows, -1, 0.0, axis=0))
        return more

    def without(self, columns: list[int]) -> "Logistic":
        """Return the fit without some columns; the bias absorbs the means of their rows."""
        rest = copy(self)
        rest._inputs = np.delete(self._inputs, columns, axis=0)
        pairs = ((np.delete(s, columns, axis=0), np.delete(y, columns, axis=0)) for s, y, _ in self._pairs)
        rest._pairs = [(s, y, dot(s, y)) for s, y in pairs]
        rows = np.delete(self.rows, columns, axis=0)
        for column in columns:
            rows[-1] += self.rows[column] * (exact_sum(self._inputs[column]) / self._labels.size)
        rest._stand(_rounded(rows, _ROW_BITS))
        return rest

    def slopes(self, inputs: Floats) -> Floats:
        """Return the derivatives (m, K) of the loss by the rows of other inputs (m, n), where those are 0."""
        return inputs @ self._residual.T

    def _stand(self, rows: Floats, evaluated: tuple[Floats, float] | None = None) -> None:
        self.rows = rows
        self.probability, self.loss = evaluated or self._evaluate(rows)
        self._residual = _rounded(self.probability - self._member, self._residual_bits)
        self._gradient = self.slopes(self._inputs)
        self._gradient[:-1] += self._ridge * rows[:-1]

    def _evaluate(self, rows: Floats) -> tuple[Floats, float]:
        probability, mean_loss = softmax_and_loss(rows.T @ self._inputs, self._labels, None)
        return probability, mean_loss * self._labels.size + 0.5 * self._ridge * dot(rows[:-1], rows[:-1])

    def _step(self) -> bool:
        direction = self._direction()
        slope = dot(direction, self._gradient)
        length = 1.0 if self._pairs else 1.0 / self._labels.size
        for _ in range(_MOST_HALVINGS):
            rows = _rounded(self.rows + length * direction, _ROW_BITS)
            evaluated = self._evaluate(rows)
            if evaluated[1] < self.loss + _ENOUGH * length * slope:
                before, gradient = self.rows, self._gradient
                self._stand(rows, evaluated)
                moved, turned = self.rows - before, self._gradient - gradient
                if (curvature := dot(moved, turned)) > 0:
                    self._pairs = [*self._pairs, (moved, turned, curvature)][-_MEMORY:]
                return True
            length *= 0.5
        return False

    def _direction(self) -> Floats:
        """Return minus the gradient times the inverse Hessian estimated from past steps and gradient changes."""
        q = self._gradient.copy()
        pairs = [pair for pair in self._pairs if pair[2] > 0]
        weights = []
        for s, y, curvature in reversed(pairs):
            weights.append(dot(s, q) / curvature)
            q -= weights[-1] * y
        if pairs:
            _, y, curvature = pairs[-1]
            q *= curvature / dot(y, y)
        for (s, y, curvature), weight in zip(pairs, reversed(weights), strict=True):
            q += (weight - dot(y, q) / curvature) * s
        return -q


def lines(codes: NDArray[np.uint16]) -> Floats:
    """Return codes (n, j) as inputs (j, n): from their mean, in deviations, rounded to marks; constant ones are 0."""
    n, found = len(codes), np.zeros(codes.shape[::-1])
    for line, column in zip(found, codes.T.astype(np.int64), strict=True):
        total = int(column.sum())
        # Sums of integers are exact.
        if spread := n * int((column * column).sum()) - total * total:
            line[:] = _rounded((n * column - total) / sqrt(spread), MARK_BITS)
    np.clip(found, -(2.0**REACH_BITS), 2.0**REACH_BITS, out=found)
    return found


def _rounded(values: Floats, bits: int) -> Floats:
    """Round to the nearest multiples of 2^-bits."""
    rounded: Floats = np.rint(values * 2.0**bits) * 2.0**-bits
    return rounded
