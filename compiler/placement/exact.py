"""Exact comparisons of information from counts: in floating point where it suffices, in integers otherwise.

Entropy and information of n rows, times n, are sums of f(m) = m ln m over integer counts m, some of them added and some
subtracted. If floating point cannot separate two such sums, they are compared by their signs as integer multiples of
logarithms.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from decimal import Context, Decimal
from math import gcd, log
from typing import Any

import numpy as np
from numpy.typing import NDArray

Counts = NDArray[np.int64]
Floats = NDArray[np.float64]

UNIT: float = 2.0**-53
_FIRST_DIGITS = 40


def n_log_n(counts: NDArray[Any], ln: Callable[[Floats], Floats] = np.log) -> Floats:
    """Return f(m) = m ln m of every count; f(0) = 0."""
    floats = counts.astype(np.float64)
    return np.asarray(floats * ln(np.maximum(floats, 1.0)))


def error_bound(n: int, terms: int, times: int) -> float:
    """Bound the error of a floating-point sum of f over `terms` counts, whose absolute values add up to times * f(n).

    A term f(m) is off by 16 relative units of 2^-53 at most: the logarithm by 4 ulp, which are 8 units, and the product
    by half of one, which is 1 unit. The 7 units left cover a division of the sum by a cost, and the comparison. The sum
    adds at most terms - 1 units of the sum of the absolute values.
    """
    rows = float(max(n, 2))
    return times * rows * log(rows) * (terms + 16) * UNIT


def first_best(plus: Counts, minus: Counts, costs: Counts | None = None) -> int:
    """Return the first candidate of maximum value, compared exactly.

    A candidate's value is the sum of f over its row of `plus` (candidates, p), less that over its row of `minus`
    (candidates, q), divided by its cost: an integer > 0 (None: all cost the same). Values must be at least 0; costs
    that differ must ascend.
    """
    # f(0) = f(1) = 0. Among candidates of the same counts, the first is the cheapest.
    parts = (np.where(part > 1, part, 0) for part in (plus, minus))
    terms = np.concatenate([np.sort(part, axis=1) for part in parts], axis=1)
    prices = [1] * len(terms) if costs is None else costs.tolist()
    best, others = 0, np.arange(len(terms))
    while True:
        others = others[(terms[others] != terms[others[0]]).any(axis=1)]
        if not len(others):
            return best
        other = int(others[0])
        if compare(plus[other], minus[other], plus[best], minus[best], prices[best], prices[other]) > 0:
            best = other


def compare(
    plus: Counts, minus: Counts, other_plus: Counts, other_minus: Counts, times: int = 1, other_times: int = 1
) -> int:
    """Return the exact sign of times * (f(plus) - f(minus)) - other_times * (f(other_plus) - f(other_minus)), where f
    of counts is the sum over them.
    """
    difference: Counter[int] = Counter()
    for counts, factor in ((plus, times), (minus, -times), (other_plus, -other_times), (other_minus, other_times)):
        for count in counts.ravel().tolist():
            difference[count] += factor
    return sign_of_f_sum(difference)


def sign_of_f_sum(coefficients: Mapping[int, int]) -> int:
    """Return the sign of the sum over n of coefficients[n] * f(n), with f(n) = n ln n and f(0) = 0."""
    return sign_of_log_sum({n: n * times for n, times in coefficients.items() if n})


def sign_of_log_sum(multiples: Mapping[int, int]) -> int:
    """Return the sign, -1, 0 or 1, of the sum over m of multiples[m] * ln m, for integers m >= 1.

    The sum is zero exactly if the product of all m ** multiples[m] is 1, which the exponents over a base of pairwise
    coprime numbers decide. Otherwise decimal arithmetic of rising precision finds the sign after finitely many steps.
    """
    terms = {m: times for m, times in multiples.items() if times and m > 1}
    if not terms or _product_is_one(terms):
        return 0
    digits = _FIRST_DIGITS
    while True:
        total, bound = _log_sum(terms, digits)
        if total.copy_abs() > bound:
            return 1 if total > 0 else -1
        digits *= 2


def _product_is_one(terms: Mapping[int, int]) -> bool:
    base = _coprime_base(list(terms))
    return all(sum(times * _multiplicity(m, factor) for m, times in terms.items()) == 0 for factor in base)


def _coprime_base(numbers: list[int]) -> list[int]:
    """Return pairwise coprime numbers > 1 such that each of `numbers` is a product of their powers."""
    base: list[int] = []
    todo = list(numbers)
    while todo:
        number = todo.pop()
        meets = next((factor for factor in base if gcd(factor, number) > 1), None)
        if number == 1 or number in base:
            continue
        if meets is None:
            base.append(number)
        else:
            common = gcd(meets, number)
            base.remove(meets)
            todo += [common, meets // common, number // common]
    return base


def _multiplicity(number: int, factor: int) -> int:
    times = 0
    while number % factor == 0:
        number //= factor
        times += 1
    return times


def _log_sum(terms: Mapping[int, int], digits: int) -> tuple[Decimal, Decimal]:
    """Return the sum in decimal arithmetic and a bound on its error.

    Logarithm, product and each addition are correctly rounded: at most (number of terms + 2) errors of relative size
    10^(1 - digits), each of at most the sum of the terms' absolute values; twice that covers their products.
    """
    context = Context(prec=digits)
    total = size = Decimal(0)
    for m, times in terms.items():
        term = context.multiply(Decimal(times), context.ln(Decimal(m)))
        total = context.add(total, term)
        size = context.add(size, context.abs(term))
    error = context.multiply(size, Decimal(2 * (len(terms) + 2)))
    return total, context.scaleb(error, 1 - digits)
