"""exp, log, sine, cosine, softmax and sums with the same bits on every machine.

numpy and the C library pick an exp by processor, and their last bits differ. These are made of single IEEE operations
(add, multiply, divide, round, scale by a power of two) in one fixed order, which every machine rounds alike. Errors
stay below 1 ulp for exp, and 2 ulp for log, sine and cosine (tests compare them with mpmath).

Sums of any order are exact on a grid. A double holds every integer up to 2^53. So numbers rounded to multiples of 2^-e,
with e chosen such that the sum of their magnitudes stays below 2^52 multiples, can be added and subtracted in any
order, by any BLAS, on any number of threads, with the same integer result. Rounding costs at most half a multiple per
number, n * 2^-51 of the total in the worst case: four times the possible loss of an ordinary floating-point sum of n
numbers. The remainder of the rounding can be put on a second, finer grid, where a sum needs more accuracy than that.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LN_2 = 0.6931471805599453
_INVERSE_LN2 = 1.4426950408889634
# ln 2 in two parts (Cody and Waite): the high one ends in 21 zero bits, so k * _LN2_HIGH is exact for |k| < 2^21.
_LN2_HIGH = 0.6931471803691238
_LN2_LOW = 1.9082149292705877e-10
_EXP_UNDERFLOW = -746.0
# Elements that are processed in one block: 256 KiB of doubles fit a processor's cache.
_CACHED = 1 << 15
# glibc gives memory back to the system if more is free than twice the largest array ever freed. To fault it in again
# takes longer than the arithmetic. So an array close to 32 MiB, the largest that counts, is freed here, untouched.
np.empty(31 << 20, np.uint8)
_EXP_TERMS = tuple(1.0 / math.factorial(n) for n in range(13, 1, -1))
_LOG_TERMS = tuple(2.0 / n for n in range(23, 1, -2))
_SQRT_HALF = 0.7071067811865476
_TWO_OVER_PI = 0.6366197723675814
# pi/2 in three parts, of 33 bits each: products with a small integer are exact.
_HALF_PI_HIGH = 1.5707963267341256
_HALF_PI_MIDDLE = 6.077100506303966e-11
_HALF_PI_LOW = 2.0222662487959506e-21
_SIN_TERMS = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
_COS_TERMS = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)
SUM_BITS = 52
_LARGEST_POWER = 1023
_FINEST = 1000


def exp(x: Floats) -> Floats:
    """Return e^x for x <= 709, any shape; below -746 the result is exactly 0."""
    rest = np.maximum(x, _EXP_UNDERFLOW)
    power = rest * _INVERSE_LN2
    np.rint(power, out=power)
    series = power * _LN2_HIGH
    rest -= series
    rest -= np.multiply(power, _LN2_LOW, out=series)
    np.multiply(rest, _EXP_TERMS[0], out=series)
    series += _EXP_TERMS[1]
    for term in _EXP_TERMS[2:]:
        series *= rest
        series += term
    series *= rest
    series *= rest
    series += rest
    series += 1.0
    return np.ldexp(series, power.astype(np.int32))


def log(x: Floats) -> Floats:
    """Return ln x for finite x > 0, any shape."""
    mantissa, power = np.frexp(x)
    low = mantissa < _SQRT_HALF
    mantissa = np.where(low, mantissa + mantissa, mantissa)
    exponent = (power - low).astype(np.float64)
    f = mantissa - 1.0
    s = f / (mantissa + 1.0)
    square = s * s
    series = np.full_like(s, _LOG_TERMS[0])
    for term in _LOG_TERMS[1:]:
        series *= square
        series += term
    # ln m = 2s + s^3 * series = f - s * (f - s^2 * series): f is exact, so small logarithms keep all their bits.
    return (f - s * (f - square * series)) + exponent * _LN2_LOW + exponent * _LN2_HIGH


def add_up(rows: Floats) -> Floats:
    """Return the sum over axis 0 of (K, n), added strictly in order of the rows."""
    total: Floats = rows[0].copy()
    for row in rows[1:]:
        total += row
    return total


def add_exactly(total: Floats, carry: Floats, term: Floats) -> tuple[Floats, Floats]:
    """Add `term` to a sum held in two parts, any shape, and return both: `carry` collects `total`'s rounding errors.

    The rounding error of an addition is itself a double, which six operations find (Knuth, TAOCP 2, 4.2.2, theorem B).
    So total + carry is within one rounding of the true sum, and n^2 * 2^-106 of the magnitudes: 10,000 terms drift no
    further than ten do.
    """
    longer = total + term
    added = longer - total
    return longer, carry + ((total - (longer - added)) + (term - added))


def softmax(scores: Floats) -> Floats:
    """Return P (K, n), each column summing to 1 within K roundings, for scores (K, n)."""
    shares = np.empty(scores.shape)
    step = max(64, _CACHED // len(scores))
    for start in range(0, scores.shape[1], step):
        block = scores[:, start : start + step]
        block = exp(block - block.max(axis=0))
        np.divide(block, add_up(block), out=shares[:, start : start + step])
    return shares


def softmax_and_loss(scores: Floats, labels: NDArray[np.intp], weights: Floats | None) -> tuple[Floats, float]:
    """Return P (K, n) and the weighted mean of -ln P(label) for scores (K, n), labels and weights (n,); None: all 1.

    Its sums are correctly rounded (fsum), and it is computed from the scores, not from P: the loss of an almost certain
    class is ln(1 + the others' odds), which keeps its bits however small it is.
    """
    shares, losses = np.empty(scores.shape), np.empty(labels.size)
    step = max(64, _CACHED // len(scores))
    for start in range(0, labels.size, step):
        rows = slice(start, start + step)
        shares[:, rows], losses[rows] = softmax_and_losses(scores[:, rows], labels[rows])
    if weights is None:
        return shares, math.fsum(losses.tolist()) / labels.size
    # Scale the largest weight to about 1 by a power of two, which is exact: small losses of light rows keep their bits.
    near_one = np.ldexp(weights, -int(np.frexp(weights.max())[1]))
    return shares, math.fsum((losses * near_one).tolist()) / math.fsum(near_one.tolist())


def softmax_and_losses(scores: Floats, labels: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Return P (K, n) and -ln P(label) (n,) for scores (K, n) and labels (n,)."""
    own, top = (labels, np.arange(labels.size)), scores.max(axis=0)
    odds = exp(scores - top)
    total = add_up(odds)
    shares = odds / total
    gap, odds[own] = top - scores[own], 0.0
    # Of the likeliest class, the loss is ln(1 + the others' odds), corrected by the exact rounding error of that sum.
    others, likeliest = add_up(odds), gap == 0.0
    total = np.where(likeliest, 1.0 + others, total)
    return shares, log(total) + np.where(likeliest, (others - (total - 1.0)) / total, gap)


def sincos(x: Floats) -> tuple[Floats, Floats]:
    """Return sin x and cos x for |x| <= 1000, any shape (minimax polynomials of fdlibm's kernels)."""
    quarter = np.rint(x * _TWO_OVER_PI)
    rest = ((x - quarter * _HALF_PI_HIGH) - quarter * _HALF_PI_MIDDLE) - quarter * _HALF_PI_LOW
    square = rest * rest
    sine = rest + rest * square * polynomial(square, _SIN_TERMS)
    cosine = (1.0 - 0.5 * square) + square * square * polynomial(square, _COS_TERMS)
    turn = quarter.astype(np.int64)
    swapped = (turn & 1).astype(bool)
    first, second = np.where(swapped, cosine, sine), np.where(swapped, sine, cosine)
    return np.where(turn & 2, -first, first), np.where((turn + 1) & 2, -second, second)


def polynomial(x: Floats, terms: tuple[float, ...]) -> Floats:
    """Return the sum of terms[k] x^k, any shape, from the last term on."""
    total = np.full_like(x, terms[-1])
    for term in terms[-2::-1]:
        total *= x
        total += term
    return total


@dataclass(frozen=True, slots=True)
class OnGrid:
    """Numbers (K, n) as integer units: row k is units[k] * 2^-exponents[k], and any sum of units is exact."""

    units: Floats  # (K, n) integers whose magnitudes sum to at most 2^52 a row and, unless all are 0, to 2^50 at least
    exponents: NDArray[np.int32]  # (K,)

    def branch_sums(self, left: Floats, missing: Floats | None, base: NDArray[np.int32]) -> Floats:
        """Return the sums (3, K) over the rows left of, right of and missing in a split; members are 0 or 1, (K, n).

        Sums are in units of 2^-base, base (K,), of the class's own grid, so that numbers near the smallest doubles keep
        their bits. The right sum is a difference, and still exact: all three are integer units. With numbers of several
        kinds, (R K, n), the members are the same for each, and so (3, R K) and base (R K,).
        """
        units, total = self.units.reshape(-1, *left.shape), self.units.sum(axis=1)
        in_left = np.einsum("rkn,kn->rk", units, left).ravel()
        in_missing = np.zeros_like(total) if missing is None else np.einsum("rkn,kn->rk", units, missing).ravel()
        sums: Floats = np.ldexp(np.array([in_left, total - in_left - in_missing, in_missing]), base - self.exponents)
        return sums


def on_grids(values: Floats) -> tuple[OnGrid, OnGrid]:
    """Round each row of `values` (K, n) to the finest grid with exact sums, and the remainder to a finer one."""
    n = values.shape[1]
    sizes = np.abs(values)
    # First from the largest magnitude, which no order of summation can change, then from the exact sum on that grid.
    # frexp gives the smallest b with a magnitude below 2^b.
    rough = SUM_BITS - np.frexp(sizes.max(axis=1, initial=0.0) * n)[1]
    total = np.rint(_scaled(sizes, rough)).sum(axis=1)
    # One bit is left as room for n/2 units of rounding, which is enough as long as n < 2^50.
    exponents = (rough + np.where(total > 0, SUM_BITS - 1 - np.frexp(total)[1], 0)).astype(np.int32)
    scaled = _scaled(values, exponents)
    units = np.rint(scaled)
    # The remainder is at most half a unit per number, n/2 per row, which determines its grid.
    finer = SUM_BITS - n.bit_length()
    scaled -= units
    scaled *= 2.0**finer
    rest = np.rint(scaled, out=scaled)
    return OnGrid(units, exponents), OnGrid(rest, exponents + np.int32(finer))


def on_one_grid(values: Floats, terms: float) -> Floats:
    """Round all `values`, any shape, to the finest grid on which every sum of `terms` values is exact.

    The error of each is at most 2^-52 of `terms` times the largest, or 2^-1001. Sums of products with bits are exact
    too.
    """
    top = max(float(values.max(initial=0.0)), -float(values.min(initial=0.0)))
    exponent = min(SUM_BITS - math.frexp(top * terms)[1], _FINEST) if top else 0
    rounded: Floats = np.rint(values * 2.0**exponent)
    rounded *= 2.0**-exponent
    return rounded


def exact_sum(values: Floats) -> float:
    """Return the sum of `values`, any shape, rounded as by `on_one_grid`."""
    return float(on_one_grid(values, values.size).sum())


def dot(a: Floats, b: Floats) -> float:
    """Return the sum of a * b, arrays of the same shape; see `exact_sum`."""
    return exact_sum(a * b)


def cholesky(matrix: Floats) -> Floats:
    """Return the lower triangular L with L L^T = matrix (n, n), which is positive definite; see `forward`."""
    left, lower = matrix.copy(), np.zeros_like(matrix)
    for column in range(len(matrix)):
        below = left[column:, column] / math.sqrt(left[column, column])
        lower[column:, column] = below
        left[column:, column:] -= below[:, np.newaxis] * below
    return lower


def forward(lower: Floats, right: Floats) -> Floats:
    """Return x (n, k) with L x = right, for a lower triangular L (n, n).

    Like `cholesky` and `backward` it takes one order of operations, not that of a machine's LAPACK.
    """
    solved = right.copy()
    for row in range(len(lower)):
        solved[row] /= lower[row, row]
        solved[row + 1 :] -= lower[row + 1 :, row, np.newaxis] * solved[row]
    return solved


def backward(lower: Floats, right: Floats) -> Floats:
    """Return x (n, k) with L^T x = right, for a lower triangular L (n, n); see `forward`."""
    solved = right.copy()
    for row in reversed(range(len(lower))):
        solved[row] /= lower[row, row]
        solved[:row] -= lower[row, :row, np.newaxis] * solved[row]
    return solved


def _scaled(values: Floats, exponents: NDArray[np.int32]) -> Floats:
    """Return each row of `values` (K, n) times a power of two, several times faster than ldexp."""
    if exponents.max(initial=0) > _LARGEST_POWER:
        return np.ldexp(values, exponents[:, np.newaxis])
    return values * np.ldexp(1.0, exponents)[:, np.newaxis]
