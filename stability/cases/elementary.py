"""exp, log, sine, cosine, softmax and loss at their hardest arguments."""

from collections.abc import Callable, Iterable, Iterator

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats, add_exactly, add_up, exp, log, sincos, softmax, softmax_and_loss

from ..checks.rounds import ROUNDING, loss_error, part_of, share_error
from ..finding import REFERENCE, Finding
from ..inputs.hard_data import hard_scores
from ..reference import boosting as logistic
from ..reference import numbers as linear
from ..reference.numbers import precisely, ulps

Labelled = tuple[Floats, NDArray[np.intp], Floats | None]  # scores (K, n), labels and weights (n,)


def findings(full: bool) -> Iterator[Finding]:
    """Yield the worst error of each function over its hard arguments and random ones."""
    rng, more = np.random.default_rng(1), 10 if full else 1
    yield _worst("exp", EXP_ULPS, exp, logistic.exp, _exp_arguments(rng, 2000 * more))
    yield _worst("exp next to underflow", EXP_ULPS, exp, logistic.exp, rng.uniform(-746, -708, 1000 * more))
    yield _worst("log", LOG_ULPS, log, logistic.log, _log_arguments(rng, 2000 * more))
    # Next to multiples of pi/4, where digits cancel or kernels change, and anywhere.
    quarters = _around(np.arange(1, 1270, 7) * np.pi / 4)
    angles = np.concatenate([quarters, -np.arange(1, 9) * 1e-8, rng.uniform(-1e3, 1e3, 1000 * more)])
    yield _worst("sine", SINCOS_ULPS, lambda x: sincos(x)[0], linear.sin, angles)
    yield _worst("cosine", SINCOS_ULPS, lambda x: sincos(x)[1], linear.cos, angles)
    matrices = list(hard_scores(rng, 20 * more))
    yield shares_of(matrices)
    yield losses_of(_labelled(rng, matrices))
    yield sums_of(
        rng.normal(size=(int(k), 1)) * 10.0 ** rng.uniform(-150, 150) for k in rng.integers(2, 34, 200 * more)
    )
    n = 100_000 if full else 10_000
    yield long_sums_of([("0.1 repeated", np.full(n, 0.1)), ("steps of all signs", rng.normal(3.0, 5.0, n))])


# With r the reduced x, |r| <= 0.35, the result is 1 + (r + r^2 q), then a power of two. In units of 2^-53, one ulp
# of a result in [0.7, 1): 1/2 for the last addition, 1/4 for the one before it (of a number below 1/2), 1/4 * 0.71 for
# the rounding of r itself, 1/8 for r^2 q, whose two products and one sum are below 1/8. Above 1 an ulp is twice that.
# A subnormal result is rounded again, by half of its last place, but then all of the above counts at most half.
EXP_ULPS = 1.06
# f and the exponent are exact. f - s (f - s^2 q) rounds by half an ulp; s, the bracket and the product by
# 2^-53 each of at most f^2/2 = 0.086, half an ulp of a result next to it. The exponent's part adds half an ulp.
LOG_ULPS = 2.0
# Two subtractions of the reduction and two additions of the kernel, half an ulp each.
SINCOS_ULPS = 2.0


def _worst(
    check: str, bound: float, ours: Callable[[Floats], Floats], truth: Callable[[float], mpf], x: Floats
) -> Finding:
    worst = Finding.of(check, REFERENCE, bound, "ulp")
    for argument, got in zip(x.tolist(), ours(x).tolist(), strict=True):
        worst.see(ulps(got, truth(argument)), f"at {argument!r}")
    return worst


def _around(x: Iterable[float], steps: int = 2) -> Floats:
    """Return the numbers and their neighbours up to `steps` doubles away."""
    numbers = np.array(list(x))
    return np.concatenate([numbers + k * np.spacing(numbers) for k in range(-steps, steps + 1)])


def _exp_arguments(rng: np.random.Generator, n: int) -> Floats:
    """Return arguments near 0, at the boundaries of powers of two, and anywhere."""
    halves = (np.arange(-1020, 1021, 8) + 0.5) * np.log(2)
    tiny = np.ldexp(1.0, np.arange(-1074, 0, 40))
    return np.concatenate([_around(halves[halves < 708]), tiny, -tiny, [0.0, -0.0], rng.uniform(-708, 709, n)])


def _log_arguments(rng: np.random.Generator, n: int) -> Floats:
    """Return arguments near 1, at the boundaries of powers of two, subnormal, largest, and of all magnitudes."""
    powers = np.ldexp(1.0, np.arange(-1020, 1020, 30))
    around_one = 1.0 + np.ldexp(np.concatenate([np.arange(1.0, 9.0), -np.arange(1.0, 9.0)]), -53)
    extremes = [5e-324, 1e-323, 2.0**-1022, np.finfo(float).max]
    many = np.ldexp(rng.uniform(0.5, 1, n), rng.integers(-1073, 1024, n))
    near = rng.uniform(0.7, 1.42, n)
    return np.concatenate([_around(powers), _around(powers * np.sqrt(0.5)), around_one, extremes, many, near])


def _labelled(rng: np.random.Generator, matrices: Iterable[Floats]) -> Iterator[Labelled]:
    """Yield scores with random labels, and with the largest as label: its loss is tiny, but keeps all its bits."""
    for scores in matrices:
        n = scores.shape[1]
        for labels in (rng.integers(0, len(scores), (n,)), scores.argmax(axis=0)):
            yield scores, labels, None
            yield scores, labels, np.ldexp(1.0, rng.integers(-900, 900, n))


def shares_of(matrices: Iterable[Floats]) -> Finding:
    """Compare softmax of scores (K, n) with the reference."""
    worst = Finding.of("shares of classes", REFERENCE, 1.0, "x rounding")
    for scores in matrices:
        for row, got in zip(scores.T.tolist(), softmax(scores).T.tolist(), strict=True):
            for k, (ours, share) in enumerate(zip(got, logistic.softmax(tuple(row)), strict=True)):
                error = part_of(ours, share, share_error(row, k, share))
                worst.see(error, f"{len(row)} classes, {max(row) - row[k]:.3g} below")
    return worst


def losses_of(sets: Iterable[Labelled]) -> Finding:
    """Compare mean losses with the reference."""
    worst = Finding.of("mean loss, weighted and not", REFERENCE, 1.0, "x rounding")
    for scores, labels, weights in sets:
        got = softmax_and_loss(scores, labels, weights)[1]
        shares = [1.0] * labels.size if weights is None else weights.tolist()
        rows = scores.T.tolist()
        truth, allowed = (of(rows, labels.tolist(), shares) for of in (logistic.mean_loss, loss_error))
        worst.see(part_of(got, truth, allowed), f"{len(scores)} classes, loss {got:.3g}")
    return worst


def sums_of(columns: Iterable[Floats]) -> Finding:
    """Compare sums over classes, of columns (K, 1), with the reference."""
    # K - 1 additions, each within 2^-53 of a partial sum, which the sum of magnitudes bounds.
    worst = Finding.of("sums over classes", REFERENCE, 1.0, "x rounding")
    for rows in columns:
        terms = rows[:, 0].tolist()
        with precisely():
            allowed = (len(terms) - 1) * ROUNDING * mpmath.fsum(map(abs, terms))
            worst.see(part_of(add_up(rows)[0], mpmath.fsum(terms), allowed), f"{len(rows)} terms")
    return worst


def long_sums_of(series: Iterable[tuple[str, Floats]]) -> Finding:
    """Compare sums over rounds, of terms (M,), with the reference."""
    # total + carry is rounded once, to half an ulp; the carry's own loss is n^2 2^-106 of the magnitudes, which for 1e5
    # terms is 1e-22 of them: without cancellation, less than 0.01 ulp of their sum.
    worst = Finding.of("sums over rounds, compensated", REFERENCE, 0.51, "ulp")
    for name, terms in series:
        total = carry = np.zeros(1)
        for term in terms[:, np.newaxis]:
            total, carry = add_exactly(total, carry, term)
        with precisely():
            worst.see(ulps(float((total + carry)[0]), mpmath.fsum(terms.tolist())), f"{len(terms)} times: {name}")
    return worst
