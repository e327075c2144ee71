"""Entropy and information gain of integer counts; exact comparison of two gains.

H(C) = -sum_c p_c lg p_c and I(C; V) = sum_cv p_cv lg (p_cv / (p_c p_v)), in which a term is exactly 0 if class and
value are independent (Shannon 1948).
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import lru_cache

import mpmath
from mpmath import mpf

from .numbers import DIGITS, precisely

Table = Sequence[Sequence[int]]  # rows: classes, columns: values


@precisely()
def entropy_bits(counts: Sequence[int]) -> mpf:
    """Return H, in bits, of the distribution given by `counts`."""
    n = sum(counts)
    return mpmath.fsum(-mpf(m) / n * mpmath.log(mpf(m) / n, 2) for m in counts if m)


@precisely()
def gain_bits(table: Table) -> mpf:
    """Return I(class; value), in bits."""
    n = sum(map(sum, table))
    sizes = [sum(column) for column in zip(*table, strict=True)]
    return mpmath.fsum(
        mpf(m) / n * mpmath.log(mpf(m * n) / (sum(row) * size), 2)
        for row in table
        for m, size in zip(row, sizes, strict=True)
        if m
    )


def conditional_gain_bits(tables: Sequence[Table]) -> mpf:
    """Return I(class; value | given), in bits, of one table for every given value."""
    sizes = [sum(map(sum, table)) for table in tables]
    gains = [(size, gain_bits(table)) for size, table in zip(sizes, tables, strict=True) if size]
    with precisely():
        return mpmath.fsum(size * gain for size, gain in gains) / sum(sizes)


def compare_gains(one: Table, other: Table) -> int:
    """Return the sign of gain(one) - gain(other)."""
    return compare_conditional_gains([one], [other])


def compare_conditional_gains(one: Sequence[Table], other: Sequence[Table]) -> int:
    """Return the sign of the difference of two conditional gains, of one table for every given value.

    With f(m) = m ln m, n I(C; V) is f(n) + sum f(n_cv) - sum f(n_c) - sum f(n_v).
    """
    sizes = [sum(m for table in tables for row in table for m in row) for tables in (one, other)]
    multiples: Counter[int] = Counter()
    for tables, times in ((one, sizes[1]), (other, -sizes[0])):
        for table in tables:
            for m in (sum(map(sum, table)), *(m for row in table for m in row)):
                multiples[m] += times * m
            for m in (*map(sum, table), *map(sum, zip(*table, strict=True))):
                multiples[m] -= times * m
    return sign_of_log_sum(multiples)


def sign_of_log_sum(multiples: Mapping[int, int]) -> int:
    """Return the sign of the sum over m of multiples[m] ln m: 0 if no prime is left, else with sufficient digits."""
    primes: Counter[int] = Counter()
    for m, times in multiples.items():
        for prime, power in factors(m) if m > 1 and times else ():
            primes[prime] += times * power
    if not any(primes.values()):
        return 0
    digits = DIGITS
    while True:
        with mpmath.workdps(digits):
            terms = [times * mpmath.log(prime) for prime, times in primes.items()]
            total, size = mpmath.fsum(terms), mpmath.fsum(map(abs, terms))
            if abs(total) > size * mpf(10) ** (10 - digits):
                return int(mpmath.sign(total))
        digits *= 2


@lru_cache(maxsize=1 << 16)
def factors(number: int) -> tuple[tuple[int, int], ...]:
    """Return the primes of number > 1 and their powers, by trial division."""
    found: Counter[int] = Counter()
    divisor = 2
    while divisor * divisor <= number:
        while number % divisor == 0:
            number //= divisor
            found[divisor] += 1
        divisor += 1 + divisor % 2
    found[number] += number > 1
    return tuple((prime, power) for prime, power in found.items() if power)
