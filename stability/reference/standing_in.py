"""What stands in for the lost inputs of a kind, fitted in whole steps at 60 digits.

From the mean rows on, 20 times, each class of each row gains scale * ln(wanted / given) steps, rounded to whole ones:
wanted is the number of rows of the class and 1/2, given the sum of its probabilities over all rows without the input
and 1/2. Where a further set of scores says what the rows have without all inputs of the kind, the sum of their rows
gains as much; what it lacks beyond the sum of the single gains is shared out among the inputs and itself. No entry
leaves the ends of its input; an input whose ends are equal stays as it is and takes no share.

Doubles compute the same up to a last bit, and a whole number of steps hangs on that bit only next to a half. What they
may lose is worked out at every step; where a half lies within, both whole numbers are followed.
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
# Sums of probabilities, of fewer than 2^20 rows, are taken in whole parts of this; each is at most half a part off.
_PART = mpf(2) ** -32


class Kind(NamedTuple):
    """The switches, or the joints, of tables in whole steps, and n rows that were trained on.

    without  per input, the scores (n, K) of the rows but for what the input adds, and perhaps, as one more than there
             are inputs, those but for what all of the kind add
    labels   the class of each row, (n,)
    ends     per input, the least (K,) and the most (K,) that it adds
    scale    steps per unit of score
    """

    without: Sequence[Sequence[Sequence[int]]]
    labels: Sequence[int]
    ends: Sequence[tuple[Row, Row]]
    scale: float


@precisely()
def whole(rows: Sequence[Sequence[mpf]], doubt: float, ends: Sequence[tuple[Row, Row]]) -> set[Rows]:
    """Return all whole numbers, between the ends, that `rows` may be rounded to if each is at most `doubt` off."""
    none = [[0] * len(row) for row in rows]
    return set(_rounded(none, rows, [[mpf(doubt)] * len(row) for row in rows], ends))


@precisely()
def stand_ins(kind: Kind, means: Iterable[Rows]) -> set[Rows]:
    """Return what the rows of each input may be in the end, if they begin as one of the `means`: all but always one."""
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
    # A gain is off by what its own lack is, and by a (1 + n)-th of what all are; n + 4 roundings add and divide them.
    most = [2 * (max(of[k] for of in doubts) + (n + 4) * _U * max(abs(of[k]) for of in lacks)) for k in classes]
    moves = iter(gains)
    all_gains = [next(moves) if counts else [mpf(0)] * len(sums) for counts in says]
    yield from _rounded(rows, all_gains, [most] * len(rows), kind.ends)


def _lack(
    kind: Kind, scores: Sequence[Sequence[int]], shares: Sequence[Sequence[mpf]], row: Row
) -> tuple[list[mpf], list[mpf]]:
    """Return the steps (K,) that each class lacks where all `scores` gain this row, and by how much doubles are off.

    With u = 2^-53 and B the largest of the scores in units: an exponent is off by 4 B u, from two divisions and a
    difference; a power by as much and 2 u; a probability by twice that and K u for the sum and the quotient. A part
    that a row has in a sum is off by half of 2^-32, and the sum itself by nothing. Adding 1/2, the quotient, the
    product with the scale: 3 u; the logarithm 2 ulp, 4 u of itself, and 2 u more for all products of u.
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
    """Yield the rows after their gains in whole steps, half to even, for every way in which doubt may round them."""
    choices = [
        sorted({min(max(x + int(mpmath.nint(gain + off)), low), high) for off in (-doubt, doubt)})
        for row, of, more, (least, most) in zip(rows, gains, doubts, ends, strict=True)
        for x, gain, doubt, low, high in zip(row, of, more, least, most, strict=True)
    ]
    for flat in product(*choices):
        width = len(flat) // max(len(rows), 1)
        yield tuple(flat[row * width : (row + 1) * width] for row in range(len(rows)))
