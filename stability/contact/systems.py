"""The Newton system of a hand and its object, with 26 unknowns, when it is almost singular."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import mpmath
import numpy as np
from mpmath import mpf

from thenar.compiler.elementary import Floats
from thenar.simulator.contact.balance import Balance, Skin, command
from thenar.simulator.contact.settle import solve_arrow, stiffness

from ..checks.roundings import ROUNDING
from ..finding import Finding, Worst
from ..reference.numbers import precisely, solve
from .grasps import case_of, hard

SIZE = 26
# The stiffest skin of a scene: compared with it, the soft hold on the object is negligible.
_STIFFEST = Skin(1000.0, 0.5, 1000.0, 0.8)


class System(NamedTuple):
    """The arguments of `solve_arrow` for one system: (5, 4, 4, 1), (5, 4, 6, 1), (6, 6, 1), (5, 4, 1), (6, 1)."""

    limbs: Floats
    coupling: Floats
    body: Floats
    on_limbs: Floats
    on_body: Floats

    def whole(self) -> Floats:
        """Return the matrix (26, 26), with the coupling on both sides."""
        whole = np.zeros((SIZE, SIZE))
        for limb in range(5):
            own = slice(4 * limb, 4 * limb + 4)
            whole[own, own], whole[own, 20:] = self.limbs[limb, ..., 0], self.coupling[limb, ..., 0]
            whole[20:, own] = self.coupling[limb, ..., 0].T
        whole[20:, 20:] = self.body[..., 0]
        return whole


def findings(full: bool) -> Iterator[Finding]:
    """Compare the elimination with 60 digits.

    x of Cholesky's method solves (A + E) x = b exactly, |E| <= c_79 |L||L^T| element by element, for any order of its
    sums (Higham 2002, Theorem 10.4: c_(3n+1), n = 26, c_k = k u / (1 - k u)); and (|L||L^T|)_ij <= sqrt(a_ii a_jj)
    up to a factor 1 / (1 - c_27), by Cauchy-Schwarz over rows of L. So |b - A x|_i is at most 79 roundings of
    sqrt(a_ii) sum_j sqrt(a_jj) |x_j|. The error of x_i is A^-1 times such a residual, bounded by the absolute values of
    row i of A^-1, which is another solution.
    """
    left = Worst("26 x 26 elimination: residual", "60 digits", 79.0, "x 2^-53")
    off = Worst("26 x 26 elimination: solution", "60 digits", 1.0, "of the bound")
    for name, system in (*_made(20 if full else 4), *_of_grasps(full)):
        residual, error = errors(system)
        left.see(residual, name)
        off.see(error, name)
    yield from (left.finding(), off.finding())


@precisely()
def errors(system: System) -> tuple[float, float]:
    """Return the residual over a rounding of sqrt(a_ii) sum sqrt(a_jj) |x_j|, and the solution's error over its bound,
    for the worst rows. NaN if there is no solution.
    """
    found = solve_arrow(*system)[:, 0].tolist()
    if not np.isfinite(found).all():
        return math.nan, math.nan
    whole, right = system.whole().tolist(), [*system.on_limbs.ravel().tolist(), *system.on_body.ravel().tolist()]
    roots = [mpmath.sqrt(mpf(whole[i][i])) for i in range(SIZE)]
    reach = mpmath.fsum(root * abs(mpf(x)) for root, x in zip(roots, found, strict=True))
    rows = zip(whole, right, strict=True)
    left = [abs(mpf(b) - mpmath.fsum(mpf(a) * mpf(x) for a, x in zip(row, found, strict=True))) for row, b in rows]
    residual = max(part / (ROUNDING * root * reach) for part, root in zip(left, roots, strict=True))
    off = [abs(x - mpf(y)) for x, y in zip(solve(whole, right), found, strict=True)]
    worst = max(range(SIZE), key=lambda i: off[i] * roots[i])
    inverse = solve(whole, [float(i == worst) for i in range(SIZE)])
    bound = 79 * ROUNDING * reach * mpmath.fsum(abs(x) * root for x, root in zip(inverse, roots, strict=True))
    return float(residual), float(off[worst] / bound)


def _made(number: int) -> Iterator[tuple[str, System]]:
    """Yield sums of products of `rank` rows per limb, fewer than its unknowns, with an almost zero diagonal."""
    rng = np.random.default_rng(9)
    for rank in (1, 2, 4):
        for power in (0, -6, -11):
            for _ in range(max(number // 4, 1)):
                yield f"rank {rank}, springs of 1e{power}", near_singular(rng, rank, 10.0**power)


def near_singular(rng: np.random.Generator, rank: int, spring: float) -> System:
    """Return a system of `rank` rows per limb, with sizes from 1e-3 to 1e3, with springs of that share."""
    rows = rng.normal(size=(5, rank, 10)) * 10.0 ** rng.uniform(-3.0, 3.0, (1, 1, 10))
    gram = np.einsum("dri,drj->dij", rows, rows)
    limbs, coupling, body = gram[:, :4, :4], gram[:, :4, 4:], gram[:, 4:, 4:].sum(axis=0)
    limbs[:, np.arange(4), np.arange(4)] *= 1.0 + spring
    body[np.arange(6), np.arange(6)] *= 1.0 + spring
    return System(limbs[..., None], coupling[..., None], body[..., None], *_asked(rng))


def _asked(rng: np.random.Generator) -> tuple[Floats, Floats]:
    return rng.normal(size=(5, 4, 1)), rng.normal(size=(6, 1))


def _of_grasps(full: bool) -> Iterator[tuple[str, System]]:
    """Yield the first systems of the hard grasps, with the stiffest skin and random right-hand sides."""
    rng = np.random.default_rng(10)
    for grasp in list(hard(False))[:: 1 if full else 8]:
        target = command([case_of(grasp.load)])
        balance = Balance(target, _STIFFEST, target.angles, target.pose)
        yield grasp.name, System(*stiffness(balance), *_asked(rng))
