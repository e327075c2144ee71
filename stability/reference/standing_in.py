"""Replacement rows of the lost inputs of a kind, fitted in whole steps at 60 digits.

Starting from the mean rows, 20 times, each class of each row gains scale * ln(wanted / given) steps, rounded to whole
ones: wanted is the number of rows of the class plus 1/2, given the sum of its probabilities over all rows without the
input, plus 1/2. If a further set of scores gives the rows without all inputs of the kind, their sum gains as much;
what it lacks beyond the sum of the single gains is divided among the inputs and itself. No entry leaves the range
of its input; an input with an empty range stays constant and takes no share.

Doubles compute the same with an error of about 1e-6 steps. So both may round a number differently that lies as close to
a half: one in a million does.
"""

from collections.abc import Sequence
from typing import NamedTuple

import mpmath
from mpmath import mpf

from .numbers import precisely

STEPS = 20
DOUBT = mpf(1) / 2

Row = Sequence[int]


class Kind(NamedTuple):
    """The switches, or the joints, of tables in whole steps, and n training rows.

    without  per input, the scores (n, K) of the rows without the input's row, and optionally, as one more entry, those
             without the rows of all inputs of the kind
    labels   the class of each row, (n,)
    ends     per input, its least (K,) and greatest (K,) row entries
    scale    steps per unit of score
    """

    without: Sequence[Sequence[Row]]
    labels: Sequence[int]
    ends: Sequence[tuple[Row, Row]]
    scale: float


@precisely()
def stand_ins(kind: Kind, means: Sequence[Sequence[float]]) -> list[list[int]]:
    """Return the final row of each input, starting from its mean row (K,) in steps."""
    scale = mpf(kind.scale)
    powers = {score: mpmath.exp(score / scale) for rows in kind.without for row in rows for score in row}
    shares = [[[powers[score] for score in row] for row in rows] for rows in kind.without]
    varies = [list(least) != list(most) for least, most in kind.ends]
    rows = _rounded([[0] * len(row) for row in means], means, kind.ends)
    for _ in range(STEPS):
        sums = [sum(column) for column in zip(*rows, strict=True)]
        gains = [
            _lack(kind, of, row) if counts else [mpf(0)] * len(row)
            for of, row, counts in zip(shares, rows, varies, strict=False)
        ]
        if len(shares) > len(rows):
            both = zip(_lack(kind, shares[-1], sums), *gains, strict=True)
            beyond = [(of_all - mpmath.fsum(single)) / (1 + sum(varies)) for of_all, *single in both]
            gains = [
                [gain + more for gain, more in zip(row, beyond, strict=True)] if counts else row
                for row, counts in zip(gains, varies, strict=True)
            ]
        rows = _rounded(rows, gains, kind.ends)
    return rows


def in_bytes(row: Row, zero: Row, ends: tuple[Row, Row]) -> list[int]:
    """Return the nearest row (K,) that bytes hold: at most 127 equal powers of two from `zero`, within `ends`."""
    unit = 1 << max(0, max(abs(x - of_zero) for x, of_zero in zip(row, zero, strict=True)).bit_length() - 7)
    held = []
    for x, of_zero, low, high in zip(row, zero, *ends, strict=True):
        steps = max(int(mpmath.nint(mpf(x - of_zero) / unit)), -127, -((of_zero - low) // unit))
        held.append(of_zero + unit * min(steps, 127, (high - of_zero) // unit))
    return held


def _lack(kind: Kind, shares: Sequence[Sequence[mpf]], row: Row) -> list[mpf]:
    """Return the steps (K,) that each class lacks if all scores, of powers `shares` (n, K), gain this row."""
    powers = [mpmath.exp(step / mpf(kind.scale)) for step in row]
    inverse = [1 / mpmath.fdot(of, powers) for of in shares]
    given = [power * mpmath.fdot([of[k] for of in shares], inverse) for k, power in enumerate(powers)]
    wanted = map(kind.labels.count, range(len(row)))
    return [mpf(kind.scale) * mpmath.log((DOUBT + w) / (DOUBT + g)) for w, g in zip(wanted, given, strict=True)]


def _rounded(rows: Sequence[Row], gains: Sequence[Sequence[mpf]], ends: Sequence[tuple[Row, Row]]) -> list[list[int]]:
    """Return the rows after their gains in whole steps, half to even."""
    return [
        [min(max(x + int(mpmath.nint(gain)), low), high) for x, gain, low, high in zip(*of, *between, strict=True)]
        for *of, between in zip(rows, gains, ends, strict=True)
    ]
