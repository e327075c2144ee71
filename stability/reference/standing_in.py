"""Replacement rows of the lost inputs of a kind, fitted in whole steps at 60 digits.

Starting from the mean rows, 20 times, each class of each row gains scale * ln(wanted / given) steps, rounded to whole
ones: wanted is the number of rows of the class plus 1/2, given the sum of its probabilities over all rows without the
input, plus 1/2. If a further set of scores gives the rows without all inputs of the kind, their sum gains as much;
what it lacks beyond the sum of the single gains is divided among the inputs and itself. No entry leaves the range
of its input; an input with an empty range stays constant and takes no share.

Doubles compute the same up to the last bit, and an integer number of steps depends on that bit only close to a half.
The error of doubles is computed at every step; if a half lies within it, both integers are followed.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import NamedTuple

import mpmath
from mpmath import mpf

from .numbers import precisely

STEPS = 20
DOUBT = mpf(1) / 2

Row = tuple[int, ...]
Rows = tuple[Row, ...]
_U = mpf(2) ** -53
# Sums of probabilities, of fewer than 2^20 rows, are in integer multiples of this; each is off by at most half of it.
_PART = mpf(2) ** -32


class Kind(NamedTuple):
    """The switches, or the joints, of tables in whole steps, and n training rows.

    without  per input, the scores (n, K) of the rows without the input's row, and optionally, as one more entry, those
             without the rows of all inputs of the kind
    labels   the class of each row, (n,)
    ends     per input, its least (K,) and greatest (K,) row entries
    scale    steps per unit of score
    """

    without: Sequence[Sequence[Sequence[int]]]
    labels: Sequence[int]
    ends: Sequence[tuple[Row, Row]]
    scale: float


@precisely()
def whole(rows: Sequence[Sequence[mpf]], doubt: float, ends: Sequence[tuple[Row, Row]]) -> set[Rows]:
    """Return all integer roundings of `rows`, between the ends, if each entry is off by at most `doubt`."""
    none = [[0] * len(row) for row in rows]
    return set(_rounded(none, rows, [[mpf(doubt)] * len(row) for row in rows], ends))


@precisely()
def stand_ins(kind: Kind, means: Iterable[Rows]) -> set[Rows]:
    """Return the possible final rows of each input, starting from one of the `means`: almost always one."""
    powers: dict[int, mpf] = {}
    for score in {score for rows in kind.without for row in rows for score in row}:
        powers[score] = mpmath.exp(mpf(score) / mpf(kind.scale))
    shares = [[[powers[score] for score in row] for row in rows] for rows in kind.without]
    found = set(means)
    for _ in range(STEPS):
        found = {after for rows in found for after in _step(kind, shares, rows)}
    return found


def _step(kind: Kind, shares: Sequence[Sequence[Sequence[mpf]]], rows: Rows) -> Iterator[Rows]:
    sums = tuple(map(sum, zip(*rows, strict=True)))
    says = [least != most for least, most in kind.ends]
    pairs = zip(kind.without, shares, (*rows, sums), (*says, True), strict=False)
    lacks, doubts = zip(*(_lack(kind, scores, of, row) for scores, of, row, counts in pairs if counts), strict=True)
    n, classes = sum(says), range(len(sums))
    gains = list(lacks[:n])
    if len(lacks) > n:
        beyond = [(lacks[n][k] - mpmath.fsum(lack[k] for lack in gains)) / (1 + n) for k in classes]
        gains = [[lack[k] + beyond[k] for k in classes] for lack in gains]
    # The error of a gain is that of its lack plus a (1 + n)-th of all; n + 4 roundings add and divide them.
    most = [2 * (max(of[k] for of in doubts) + (n + 4) * _U * max(abs(of[k]) for of in lacks)) for k in classes]
    moves = iter(gains)
    all_gains = [next(moves) if counts else [mpf(0)] * len(sums) for counts in says]
    yield from _rounded(rows, all_gains, [most] * len(rows), kind.ends)


def _lack(
    kind: Kind, scores: Sequence[Sequence[int]], shares: Sequence[Sequence[mpf]], row: Row
) -> tuple[list[mpf], list[mpf]]:
    """Return the steps (K,) that each class lacks if all `scores` gain this row, and the error bound of doubles.

    With u = 2^-53 and B the largest of the scores in units: an exponent is off by 4 B u, from two divisions and a
    difference; a power by as much and 2 u; a probability by twice that and K u for the sum and the quotient. Each row's
    term of a sum is off by half of 2^-32, and the sum itself is exact. Adding 1/2, the quotient, the product with the
    scale: 3 u; the logarithm 2 ulp, 4 u of itself, and 2 u more for all products of u.
    """
    scale, powers = mpf(kind.scale), [mpmath.exp(mpf(step) / mpf(kind.scale)) for step in row]
    inverse = [1 / mpmath.fdot(of, powers) for of in shares]
    largest = max(abs(score + step) for of in scores for score, step in zip(of, row, strict=True)) / scale
    lacks, doubts = [], []
    for k, power in enumerate(powers):
        given = DOUBT + power * mpmath.fdot([of[k] for of in shares], inverse)
        lack = mpmath.log((DOUBT + kind.labels.count(k)) / given)
        off = (8 * largest + len(row) + 9) * _U + len(scores) * _PART / 2 / given + 6 * _U * abs(lack)
        lacks.append(scale * lack)
        doubts.append(scale * off)
    return lacks, doubts


def _rounded(
    rows: Sequence[Sequence[int]],
    gains: Sequence[Sequence[mpf]],
    doubts: Sequence[Sequence[mpf]],
    ends: Sequence[tuple[Row, Row]],
) -> Iterator[Rows]:
    """Yield the rows after their gains in whole steps, half to even, for every rounding that the doubt allows."""
    choices = [
        sorted({min(max(x + int(mpmath.nint(gain + off)), low), high) for off in (-doubt, doubt)})
        for row, of, more, (least, most) in zip(rows, gains, doubts, ends, strict=True)
        for x, gain, doubt, low, high in zip(row, of, more, least, most, strict=True)
    ]
    for flat in product(*choices):
        width = len(flat) // max(len(rows), 1)
        yield tuple(flat[row * width : (row + 1) * width] for row in range(len(rows)))
