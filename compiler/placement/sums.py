"""Sums and products with the same bits on every machine, whatever the order in which it adds."""

import math

import numpy as np
from numpy.typing import NDArray

from ..elementary import log

Floats = NDArray[np.float64]

_LN_2 = 0.6931471805599453
_SUM_BITS = 52
_SMALLEST_UNIT = -1000
# So many factors in 0.5 .. 1 are multiplied before their exponents are taken out again: 2^-512 is far from underflow.
_FACTORS = 512


def exact_sum(values: Floats) -> float:
    """Return the sum of `values`, any shape, each of which counts to within 2^-52 of their number times the largest,
    and no finer than 2^-1000.

    They are rounded to a grid on which all partial sums are whole, and so exact.
    """
    top = float(np.abs(values).max(initial=0.0))
    if top == 0.0:
        return 0.0
    unit = math.ldexp(1.0, max(math.frexp(top * values.size)[1] - _SUM_BITS, _SMALLEST_UNIT))
    return float(np.rint(values / unit).sum()) * unit


def dot(a: Floats, b: Floats) -> float:
    """Return the sum of a * b, arrays of one shape."""
    return exact_sum(a * b)


def sums_of_logs(factors: Floats) -> Floats:
    """Return the sum over axis 0 of ln `factors` (n, s), all > 0: (s,), as logarithms of products.

    Factors are multiplied in a fixed order, first halves by second halves, with their exponents taken out.
    """
    product, powers = np.frexp(factors)
    exponents = powers.sum(axis=0, dtype=np.int64)
    while len(product) > 1:
        joined = 1
        while len(product) > 1 and joined < _FACTORS:
            product, joined = _halved(product), joined * 2
        product, powers = np.frexp(product)
        exponents += powers.sum(axis=0, dtype=np.int64)
    sums: Floats = log(product[0]) + exponents * _LN_2
    return sums


def _halved(product: Floats) -> Floats:
    half = len(product) // 2
    first = product[: len(product) - half].copy()
    first[:half] *= product[len(product) - half :]
    return first
