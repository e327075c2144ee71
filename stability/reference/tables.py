"""Score tables of an ensemble.

F_k = bias_k + sum of switch_rows[s][k] over the closed switches s + sum over joints of the row of the code's bin, where
a code's bin is the number of thresholds below it.
"""

import math
from collections.abc import Sequence

import mpmath
from mpmath import mpf

from .boosting import Sums, scores
from .numbers import precisely

HIGHEST_CODE = 65535

Row = Sequence[float]
Joint = tuple[list[int], list[list[mpf]]]  # thresholds (T,), rows (T + 1, K)


def rows_of_frame(
    bias: Row,
    switch_rows: Sequence[Row],
    thresholds: Sequence[Sequence[int]],
    joint_rows: Sequence[Sequence[Row]],
    bits: Sequence[bool],
    codes: Sequence[int],
) -> list[Row]:
    """Return the rows (K,) whose sum is F of one frame: bits (s,) and codes (j,)."""
    rows = [bias, *(row for row, closed in zip(switch_rows, bits, strict=True) if closed)]
    return rows + [of[_bin(steps, code)] for steps, of, code in zip(thresholds, joint_rows, codes, strict=True)]


@precisely()
def score_tables(
    sums: Sums, n_classes: int, shrinkage: float, n_inputs: int, n_switches: int
) -> tuple[list[mpf], list[list[mpf]], list[Joint]]:
    """Return (bias, switch rows, joints) of an ensemble over [switches | joint codes 0..65535].

    An input's part of F is a function of that input alone: its values at 0 and 1, or code by code; it can change only
    at a threshold.
    """

    def parts(column: int, inputs: Sequence[int]) -> list[list[mpf]]:
        return [scores(sums, n_classes, shrinkage, {column: x}) for x in inputs]

    switches = [parts(column, (0, 1)) for column in range(n_switches)]
    switch_rows = [[high - low for low, high in zip(*both, strict=True)] for both in switches]
    joints = []
    for column in range(n_switches, n_inputs):
        steps = sorted({math.floor(t) for of, _, t in sums if of == column and 0 <= t < HIGHEST_CODE})
        joints.append((steps, parts(column, [0, *(code + 1 for code in steps)])))
    bias = added_rows([[mpf(0)] * n_classes, *(opened for opened, _ in switches)])
    return bias, switch_rows, joints


@precisely()
def balanced(bias: Row, joint_rows: Sequence[Sequence[Row]]) -> tuple[list[mpf], list[list[list[mpf]]]]:
    """Return bias and joint rows after subtracting from every joint its lowest row and a share, 0 to 1, of its span.

    The share is common to all joints of a class, and minimises the bias.
    """
    bias, joints = [mpf(b) for b in bias], [[[mpf(x) for x in row] for row in rows] for rows in joint_rows]
    for k in range(len(bias)) if joints else ():
        lowest = [min(row[k] for row in rows) for rows in joints]
        spans = [max(row[k] for row in rows) - low for rows, low in zip(joints, lowest, strict=True)]
        left = bias[k] + mpmath.fsum(lowest)
        room = mpmath.fsum(spans)
        share = min(max(-left / room, mpf(0)), mpf(1)) if room else mpf(0)
        for rows, low, span in zip(joints, lowest, spans, strict=True):
            bias[k] += low + share * span
            for row in rows:
                row[k] -= low + share * span
    return bias, joints


@precisely()
def mean_row(thresholds: Sequence[int], rows: Sequence[Row], codes: Sequence[int]) -> list[mpf]:
    """Return the mean (K,) of the rows selected by a joint's `codes` (n,), the replacement of a missing joint."""
    total = added_rows([rows[_bin(thresholds, code)] for code in codes])
    return [each / len(codes) for each in total]


def _bin(thresholds: Sequence[int], code: int) -> int:
    return sum(threshold < code for threshold in thresholds)


@precisely()
def added_rows(rows: Sequence[Row]) -> list[mpf]:
    """Return the sum (K,) of rows."""
    return [mpmath.fsum(column) for column in zip(*rows, strict=True)]
