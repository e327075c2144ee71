"""Intervals at rates 0 and 1, of repeats, and over clusters."""

from collections.abc import Iterator
from itertools import product

import numpy as np
from mpmath import mpf

from thenar.compiler.evaluation.rates import ALIKE, UNITS, WEIGHT, Rate, clustered
from thenar.runtime.manifest import Unit

from ..checks.rounds import ROUNDING
from ..finding import REFERENCE, Finding
from ..reference.intervals import Interval, student, student_quantile, wilson, wilson_of
from ..reference.numbers import distance, precisely

# Wilson's ends are (centre -+ reach) / shrink, where neither centre nor reach exceeds shrink, so that their errors
# count no more than an error of the end. Relative roundings of 2^-53: centre 5 (the rate, z^2 twice, quotient, sum),
# reach 9 (those of two terms under a root that halves them, the root, the product), shrink 4, difference, quotient.
WILSON_BOUND = (5 + 9 + 4 + 2) * ROUNDING
# Student's reach is t s / sqrt n: scipy's t is off by 4 ulp for up to 3 degrees of freedom (8 roundings; checked by a
# test of the rates), the rest by 4.
STUDENT_ROUNDINGS = 8 + 4
_TOTALS = (1, 2, 3, 5, 12, 33, 100, 999, 65536, 10**6, 10**9, 10**12)


def findings(full: bool) -> Iterator[Finding]:
    """Compare intervals with 60 digits."""
    yield from _wilson(range(1, 150) if full else range(1, 40))
    yield from _repeated(4 if full else 3)
    yield from _clusters(3000 if full else 300)


def _wilson(totals: range) -> Iterator[Finding]:
    """One repeat: every count of small totals, and counts near both ends of large ones."""
    off = Finding.of("ends of Wilson's interval", REFERENCE, WILSON_BOUND, "rate")
    odd = Finding.of(
        "rates of 0 and 1 whose interval does not end there or has no width", "the rule itself", 0, "rates"
    )
    counts = [(correct, total) for total in totals for correct in range(total + 1)]
    counts += [(correct, n) for n in _TOTALS for correct in {0, 1, n // 2, n - 1, n}]
    for correct, total in counts:
        rate = Rate.counted((correct,), total, of="pooled")
        off.see(_apart((rate.low, rate.high), wilson(correct, total)), f"{correct} of {total}")
        if correct in (0, total):
            ends = rate.low == 0 if correct == 0 else rate.high == 1
            odd.see(not (ends and rate.low < rate.high), f"{correct} of {total}")
    yield from (off, odd)


def _repeated(repeats: int) -> Iterator[Finding]:
    """Several repeats: the smallest interval around Wilson's and Student's, clipped to 0 and 1.

    The rounding of a rate changes the deviations by 2^-53 each, so the reach by t sqrt(n / (n - 1)) / sqrt n of that.
    """
    worst_t = float(student_quantile(1, mpf("0.975")))
    bound = WILSON_BOUND + (STUDENT_ROUNDINGS * worst_t + 2 * worst_t) * ROUNDING
    off = Finding.of("ends of the interval of repeats", REFERENCE, bound, "rate")
    outside = Finding.of("intervals that leave 0 to 1 or exclude their mean", "the rule itself", 0, "rates")
    for n in range(2, repeats + 1):
        for total in (1, 2, 7, 1000):
            for correct in product(sorted({0, 1, total // 2, total - 1, total}), repeat=n):
                rate = Rate.counted(correct, total, of="pooled")
                with precisely():
                    both = wilson(mpf(sum(correct)) / n, total), student([mpf(count) / total for count in correct])
                    hull = max(min(low for low, _ in both), mpf(0)), min(max(high for _, high in both), mpf(1))
                off.see(_apart((rate.low, rate.high), hull), f"{correct} of {total}")
                outside.see(not 0 <= rate.low <= rate.mean <= rate.high <= 1, f"{correct} of {total}")
    yield from (off, outside)


def _apart(found: tuple[float, float], truth: Interval) -> float:
    return max(distance(end, true) for end, true in zip(found, truth, strict=True))


def _clusters(draws: int) -> Iterator[Finding]:
    """Units in clusters, many of which are recognised either wholly or not at all.

    Relative roundings of 2^-53: the design effect, in which counts are exact, has 4 of the prior, 2 of the quotient, 2
    of the weight, 7 of the average of both, and one more of n; scipy's t is off by up to 64 (checked by a test of the
    rates). They change an end by no more than their size, since it lies within 0 to 1; Wilson's roundings add up.
    """
    off = Finding.of(
        "ends of the interval over clusters", REFERENCE, WILSON_BOUND + (4 + 2 + 2 + 7 + 1 + 64) * ROUNDING, "rate"
    )
    outside = Finding.of(
        "intervals over clusters that leave 0 to 1 or exclude their mean", "the rule itself", 0, "rates"
    )
    random = np.random.default_rng(10)
    for number in range(draws):
        sizes = random.integers(1, [3, 13, 500][number % 3], random.integers(2, 40))
        recognised = random.binomial(sizes, random.beta(0.3, [0.02, 0.3, 5.0][number // 3 % 3], len(sizes)))
        counts, unit = (recognised.tolist(), sizes.tolist()), UNITS[number % 2]
        found, truth = clustered(*counts, unit), _over_clusters(*counts, unit)
        what = f"{recognised.tolist()} of {sizes.tolist()}"
        off.see(_apart(found, truth), what)
        mean = recognised.sum() / sizes.sum()
        outside.see(not (-WILSON_BOUND <= found[0] <= mean + WILSON_BOUND), what)
        outside.see(not (mean - WILSON_BOUND <= found[1] <= 1 + WILSON_BOUND), what)
    yield from (off, outside)


@precisely()
def _over_clusters(recognised: list[int], sizes: list[int], unit: Unit) -> Interval:
    """Return Wilson's interval for the effective number of units; the variance by its definition."""
    k, total = len(sizes), sum(sizes)
    if k == total:
        return wilson(sum(recognised), total)
    p, alike, misses = mpf(sum(recognised)) / total, mpf(ALIKE[unit]), mpf(WEIGHT)
    effect = 1 + (mpf(total) / k - 1) * alike
    if 0 < p < 1:
        residuals = sum((own - p * size) ** 2 for own, size in zip(recognised, sizes, strict=True))
        found = max(mpf(1), k * residuals / (k - 1) / total / (p * (1 - p)))
        weight = total * min(p, 1 - p) / found
        effect = (weight * found + misses * max(effect, found)) / (weight + misses)
    n, z = total / effect, student_quantile(k - 1, mpf("0.975"))
    return wilson_of(p, z**2 / n)
