"""How far the sums of a stump's branches may be off, and so what it explains and what it answers.

A class's weights w and responses r = w z are rounded to whole units (compiler/boosting/exactsums.py), of which the sum
of magnitudes makes 2^50 to 2^52; what is left is rounded to units 52 - log2(2 n) bits finer. All sums of units are
exact.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mpmath
from mpmath import mpf

from ..reference.numbers import precisely
from .roundings import ROUNDING

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
