"""Weights and working responses at every probability, and on the grids used to sum them."""

from collections.abc import Iterable, Iterator

import mpmath
import numpy as np
from mpmath import mpf

from thenar.compiler.elementary import Floats, on_grids, softmax
from thenar.compiler.trainers.logitboost import weights_and_responses

from ..checks.rounds import ROUNDING, SMALLEST, share_error
from ..finding import REFERENCE, Finding
from ..inputs.hard_data import hard_scores
from ..reference import boosting as logistic
from ..reference.numbers import precisely

Z_MAXES = (1.5, 2.0, 3.0, 4.0, 10.0, 100.0)


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of weights and responses, given P and given scores, and errors of grids for numbers of all sizes."""
    rng, more = np.random.default_rng(3), 10 if full else 1
    yield from given_probabilities((z_max, probabilities(rng, 30 * more, z_max)) for z_max in Z_MAXES)
    yield given_scores(hard_scores(rng, 6 * more))
    yield from grids_of(_spread(rng) for _ in range(30 * more))


def probabilities(rng: np.random.Generator, n: int, z_max: float) -> Floats:
    """Return 0, 1, the smallest, those near 1, 1/2, 1/z_max and 1 - 1/z_max, and n of all magnitudes."""
    corners = np.array([0.5, 1 / z_max, 1 - 1 / z_max])
    near = np.concatenate([corners + k * np.spacing(corners) for k in range(-2, 3)])
    ends = np.array([0.0, 1.0, 5e-324, 1e-323, 2.0**-1022, 1e-17, 2.0**-53, 1 - 2.0**-53, 1 - 2.0**-52])
    small = np.ldexp(rng.uniform(0.5, 1, n), rng.integers(-1073, 0, n))
    return np.concatenate([ends, near, small, 1 - small, rng.random(n)])


def given_probabilities(sets: Iterable[tuple[float, Floats]]) -> Iterator[Finding]:
    """Compare w and w z of probabilities, for a z_max, with the reference."""
    # 1 - P rounds once, and 1/z_max, the product with it and that with the row's weight: 4 roundings of w. The response
    # w z = u (Y - P) has two of them.
    weights = Finding.of("weights w, given P", REFERENCE, 4.0, "x 2^-53")
    responses = Finding.of("responses w z, given P", REFERENCE, 2.0, "x 2^-53")
    outside = Finding.of("0 <= w, 1 <= |z| <= z_max", "the rule itself", 0.0, "rows")
    for z_max, p in sets:
        for row_weight in (1.0, 3.0, 2.0**-300 / 3, 1e300):
            for is_member in (True, False):
                for probability, got in zip(p.tolist(), _ours(p, is_member, z_max, row_weight), strict=True):
                    at = f"P = {probability!r}, member {is_member}, z_max {z_max:g}, u {row_weight:.3g}"
                    with precisely():
                        w, z = logistic.target(probability, is_member, z_max, row_weight)
                        response = w * z
                        # |z| is in its range but for the 6 roundings of w and w z, or half a subnormal each.
                        weight, size = got[0], abs(got[1])
                        room = 6 * ROUNDING * size + (z_max + 1) * SMALLEST
                        is_outside = weight < 0 or size > z_max * weight + room or size < weight - room
                    weights.see(_roundings(got[0], w), at)
                    responses.see(_roundings(got[1], response), at)
                    outside.see(float(is_outside), at)
    yield from (weights, responses, outside)


def _ours(p: Floats, is_member: bool, z_max: float, row_weight: float) -> Iterator[tuple[mpf, mpf]]:
    """Yield w and w z of a row of each probability (n,)."""
    p = p[np.newaxis]
    pairs = weights_and_responses(p, np.full(p.shape, is_member), z_max, np.full(p.size, row_weight))
    yield from zip(*(map(mpf, numbers[0].tolist()) for numbers in pairs), strict=True)


@precisely()
def _roundings(got: mpf, truth: mpf) -> float:
    """Return |got - truth| in roundings of the truth. A subnormal product may lose half of the smallest double more."""
    doubt = max(abs(got - truth) - (2 * SMALLEST if abs(truth) < 2**-1020 else 0), mpf(0))
    return float(doubt / (ROUNDING * abs(truth))) if truth else float(doubt > 0)


def given_scores(matrices: Iterable[Floats]) -> Finding:
    """Compare w and w z of scores (K, n) with the reference."""
    # |d(w z)/dP| = 1 and |dw/dP| <= 1 if z is not clamped, 1/z_max if it is: the error of P, plus 4 roundings. So near
    # P = 1 the bound is a multiple of 2^-53, not of the weight.
    worst = Finding.of("weights and responses, given scores", REFERENCE, 1.0, "x rounding")
    for scores in matrices:
        shares = softmax(scores)
        for column in range(scores.shape[1]):
            row = scores[:, column].tolist()
            for is_member in (True, False):
                ours = _ours(shares[:, column], is_member, 3.0, 1.0)
                for k, (share, got) in enumerate(zip(logistic.softmax(tuple(row)), ours, strict=True)):
                    w, z = logistic.target(share, is_member, 3.0)
                    with precisely():
                        allowed = share_error(row, k, share) + 4 * ROUNDING * abs(w * z)
                        error = max(abs(got[0] - w), abs(got[1] - w * z))
                        worst.see(float(error / allowed), f"P = {float(share)!r} of {len(row)} classes")
    return worst


def grids_of(sets: Iterable[Floats]) -> Iterator[Finding]:
    """Check the units of rows of numbers (K, n), and the loss of both grids together."""
    overfull = Finding.of("any sum of a row is a whole number below 2^53", "whole numbers", 0.0, "rows")
    # A unit is at most 2^-50 of the row's sum; the second grid is 52 - log2(2 n) bits finer, and rounds by half a unit.
    lost = Finding.of("loss of a number on two grids", "60 digits", 1.0, "x rounding")
    for values in sets:
        coarse, fine = on_grids(values)
        for k, row in enumerate(values.tolist()):
            at = f"{len(row)} numbers"
            whole = [int(unit) for grid in (coarse, fine) for unit in grid.units[k].tolist()]
            parts = whole[: len(row)], whole[len(row) :]
            is_whole = all((grid.units[k] == np.rint(grid.units[k])).all() for grid in (coarse, fine))
            overfull.see(float(not is_whole or max(sum(map(abs, part)) for part in parts) > 2**52), at)
            with precisely():
                total = mpmath.fsum(map(abs, row))
                allowed = total * len(row) * mpf(2) ** -102
                for value, unit, rest in zip(row, *parts, strict=True):
                    held = mpmath.ldexp(unit, -int(coarse.exponents[k])) + mpmath.ldexp(rest, -int(fine.exponents[k]))
                    lost.see(float(abs(value - held) / allowed) if total else float(held != 0), at)
    yield from (overfull, lost)


def _spread(rng: np.random.Generator) -> Floats:
    """Return 3 rows of 1 to 200 numbers: of one size, of sizes 300 decades apart, and subnormal."""
    n = int(rng.choice([1, 2, 3, 63, 64, 65, 200]))
    values = rng.choice([-1.0, 1.0], (3, n)) * rng.uniform(0.5, 1, (3, n))
    values[1] *= 10.0 ** rng.uniform(-300, 0, n)
    values[2] *= 5e-324 * rng.integers(0, 100, n)
    return values
