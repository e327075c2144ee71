"""The score tables that boosting converges to, fitted jointly: multinomial logistic regression on bits, with a ridge.

Boosted stumps on bits are a row of scores for each bit, added where it is set; boosting approaches them one column a
round and stops early. Here all rows are fitted at once, to the minimum over W (c + 1, K) of

    sum over frames of -ln P(class) + RIDGE / 2 * (sum of squares of the bits' rows),    F = W' [bits; 1]

so the value of a row does not depend on the order of rounds. The fit uses L-BFGS (Nocedal and Wright, Numerical
Optimization, 2nd ed., algorithm 7.4). Rows and residuals are put on grids on which matrix products are exact, so the
fit has the same bits on every machine.
"""

from copy import copy

import numpy as np
from numpy.typing import NDArray

from ..boosting.exactsums import SUM_BITS, dot, exact_sum
from ..elementary import softmax_and_loss
from .exact import Floats

RIDGE = 1.0
_MEMORY = 6
# Rows are multiples of 2^-28, below 2^24 in sum, so every sum of them is exact.
_ROW_BITS = 28
_ENOUGH = 1e-4  # of the slope, for Armijo's rule
_MOST_HALVINGS = 12


class Logistic:
    """A fit to `bits` (c, n) and `labels` (n,) that can be continued, with or without all its columns.

    rows         (c + 1, K) on the grid, the last one the bias
    probability  (K, n) P of every class in every frame, at `rows`
    """

    def __init__(self, bits: NDArray[np.bool_], labels: NDArray[np.intp], n_classes: int) -> None:
        n = bits.shape[1]
        self._inputs = np.concatenate([bits, np.ones((1, n), np.bool_)]).astype(np.float64)
        self._labels = labels
        self._member = (labels == np.arange(n_classes)[:, np.newaxis]).astype(np.float64)
        self._residual_bits = SUM_BITS - n.bit_length()
        self._pairs: list[tuple[Floats, Floats]] = []
        self._stand(np.zeros((len(self._inputs), n_classes)))

    def improve(self, iterations: int) -> None:
        """Take up to `iterations` steps of L-BFGS; stop when no step lowers the loss."""
        for _ in range(iterations):
            if not self._step():
                return

    def without(self, columns: list[int]) -> "Logistic":
        """Return the fit without some columns; the bias absorbs the means of their rows."""
        rest = copy(self)
        rest._inputs = np.delete(self._inputs, columns, axis=0)
        rest._pairs = [(np.delete(s, columns, axis=0), np.delete(y, columns, axis=0)) for s, y in self._pairs]
        rows = np.delete(self.rows, columns, axis=0)
        for column in columns:
            rows[-1] += self.rows[column] * (exact_sum(self._inputs[column]) / self._labels.size)
        rest._stand(_rounded(rows, _ROW_BITS))
        return rest

    def _stand(self, rows: Floats, evaluated: tuple[Floats, float] | None = None) -> None:
        self.rows = rows
        self.probability, self.loss = evaluated or self._evaluate(rows)
        residual = _rounded(self.probability - self._member, self._residual_bits)
        self._gradient = self._inputs @ residual.T
        self._gradient[:-1] += RIDGE * rows[:-1]

    def _evaluate(self, rows: Floats) -> tuple[Floats, float]:
        probability, mean_loss = softmax_and_loss(rows.T @ self._inputs, self._labels, None)
        return probability, mean_loss * self._labels.size + 0.5 * RIDGE * dot(rows[:-1], rows[:-1])

    def _step(self) -> bool:
        direction = self._direction()
        slope = dot(direction, self._gradient)
        length = 1.0 if self._pairs else 1.0 / self._labels.size
        for _ in range(_MOST_HALVINGS):
            rows = _rounded(self.rows + length * direction, _ROW_BITS)
            evaluated = self._evaluate(rows)
            if evaluated[1] < self.loss + _ENOUGH * length * slope:
                self._go_to(rows, evaluated)
                return True
            length *= 0.5
        return False

    def _go_to(self, rows: Floats, evaluated: tuple[Floats, float]) -> None:
        before, slope = self.rows, self._gradient
        self._stand(rows, evaluated)
        moved, turned = self.rows - before, self._gradient - slope
        if dot(moved, turned) > 0:
            self._pairs = [*self._pairs, (moved, turned)][-_MEMORY:]

    def _direction(self) -> Floats:
        """Return minus the gradient times the inverse Hessian estimated from past steps and gradient changes."""
        q = self._gradient.copy()
        pairs = [(s, y, dot(s, y)) for s, y in self._pairs]
        pairs = [pair for pair in pairs if pair[2] > 0]
        weights = []
        for s, y, curvature in reversed(pairs):
            weights.append(dot(s, q) / curvature)
            q -= weights[-1] * y
        if pairs:
            q *= pairs[-1][2] / dot(pairs[-1][1], pairs[-1][1])
        for (s, y, curvature), weight in zip(pairs, reversed(weights), strict=True):
            q += (weight - dot(y, q) / curvature) * s
        return -q


def _rounded(values: Floats, bits: int) -> Floats:
    """Round to the nearest multiples of 2^-bits."""
    rounded: Floats = np.rint(values * 2.0**bits) * 2.0**-bits
    return rounded
