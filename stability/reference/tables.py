"""Score tables of an ensemble.

F_k = bias_k + sum of switch_rows[s][k] over the closed switches s + sum over joints of the row of the code's bin, where
a code's bin is the number of thresholds below it.
"""

import math
from collections.abc import Sequence

import mpmath
from mpmath import mpf

from .boosting import output, step
from .numbers import added, precisely

HIGHEST_CODE = 65535

Row = Sequence[float]
Joint = tuple[list[int], list[list[mpf]]]  # thresholds (T,), rows (T + 1, K)


@precisely()
def table_scores(
    bias: Row,
    switch_rows: Sequence[Row],
    thresholds: Sequence[Sequence[int]],
    joint_rows: Sequence[Sequence[Row]],
    bits: Sequence[bool],
    codes: Sequence[int],
) -> list[mpf]:
    """Return F (K,) of one frame: bits (s,) and codes (j,)."""
    rows = [bias, *(row for row, closed in zip(switch_rows, bits, strict=True) if closed)]
    rows += [of[_bin(steps, code)] for steps, of, code in zip(thresholds, joint_rows, codes, strict=True)]
    return _added(rows)


@precisely()
def score_tables(
    columns: Sequence[Sequence[int]],
    thresholds: Sequence[Row],
    values: Sequence[Sequence[Row]],
    shrinkage: float,
    n_inputs: int,
    n_switches: int,
) -> tuple[list[mpf], list[list[mpf]], list[Joint]]:
    """Return (bias, switch rows, joints) of an ensemble over [switches | joint codes 0..65535].

    An input's part of F is a function of that input alone: its values at 0 and 1, or code by code; it can change only
    at a threshold.
    """
    n_classes = len(columns[0])
    stumps: list[list[tuple[int, float, Row]]] = [[] for _ in range(n_inputs)]
    for of_round in zip(columns, thresholds, values, strict=True):
        for k, (column, threshold, branches) in enumerate(zip(*of_round, strict=True)):
            stumps[column].append((k, threshold, branches))
    parts = [_parts(of, n_classes, shrinkage, (0, 1)) for of in stumps[:n_switches]]
    bias = _added([opened for opened, _ in parts]) if parts else [mpf(0)] * n_classes
    switch_rows = [[high - low for low, high in zip(*both, strict=True)] for both in parts]
    joints = []
    for of in stumps[n_switches:]:
        steps = sorted({math.floor(t) for _, t, _ in of if 0 <= t < HIGHEST_CODE})
        joints.append((steps, _parts(of, n_classes, shrinkage, [0, *(code + 1 for code in steps)])))
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
    total = _added([rows[_bin(thresholds, code)] for code in codes])
    return [each / len(codes) for each in total]


@precisely()
def mean_switch(row: Row, bits: Sequence[bool]) -> list[mpf]:
    """Return a switch's `row` (K,) times the share of `bits` (n,) that are 1, the replacement of a missing switch."""
    return [mpf(x) * sum(bits) / len(bits) for x in row]


def _parts(
    stumps: Sequence[tuple[int, float, Row]], n_classes: int, shrinkage: float, inputs: Sequence[int]
) -> list[list[mpf]]:
    """Return the contribution of one input's stumps to F (K,) at each of `inputs`."""
    parts = []
    for x in inputs:
        outputs: list[list[float]] = [[] for _ in range(n_classes)]
        for k, threshold, branches in stumps:
            outputs[k].append(output(x, threshold, branches))
        parts.append(step([added(own) for own in outputs], shrinkage))
    return parts


def _bin(thresholds: Sequence[int], code: int) -> int:
    return sum(threshold < code for threshold in thresholds)


def _added(rows: Sequence[Row]) -> list[mpf]:
    return [mpmath.fsum(column) for column in zip(*rows, strict=True)]
