"""The sign of a sum of whole multiples of logarithms of whole numbers, without doubt."""

from collections.abc import Mapping
from decimal import Context, Decimal
from math import gcd

_FIRST_DIGITS = 40


def sign_of_f_sum(coefficients: Mapping[int, int]) -> int:
    """Return the sign of the sum over n of coefficients[n] * f(n), f(n) = n ln n, f(0) = 0: of sums over counts."""
    return sign_of_log_sum({n: n * times for n, times in coefficients.items() if n})


def sign_of_log_sum(multiples: Mapping[int, int]) -> int:
    """Return the sign, -1, 0 or 1, of the sum over m of multiples[m] * ln m, for whole m >= 1.

    The sum is zero exactly if the product of all m ** multiples[m] is 1, which the exponents over a base of pairwise
    coprime numbers tell. If it is not zero, decimal arithmetic of rising precision comes to an end with its sign.
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
    """Return pairwise coprime numbers > 1, of whose powers each of `numbers` is a product."""
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
    """Return the sum in decimal arithmetic and a bound of its error.

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
