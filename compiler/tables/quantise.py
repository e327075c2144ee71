"""From score tables to integer tables: one scale for all, fine, yet such that no sum can overflow.

Rounding every row to whole steps moves a score by at most (inputs + 1)/2 steps, half a step for the bias and for each
input's row. Two scores can therefore approach each other by at most inputs + 1 steps, and a frame whose best score
leads by more than that keeps its grasp type. This holds of every scale: a coarser one only makes a step worth more.
"""

import math

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import IntegerTables

from .balance import balance
from .collapse import Floats, ScoreTables
from .scales import finest_scale, kindest_scale

Integers = NDArray[np.int16]


def quantise(
    tables: ScoreTables,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    width: int = 16,
    entry_bits: int = 16,
) -> IntegerTables:
    """Return integer tables whose sums fit `width` bits (4 to 16), rounded half to even.

    bits (n, s) and codes (n, j) are the rows trained on; their mean contributions stand in for missing inputs. No
    look-up, a joint or up to GROUP_SIZE consecutive switches, spans more than 2^entry_bits - 1 steps in any class. With
    16 that is no limit, as sums of 16 bits span no more, and the scale is the finest; with fewer it is the kindest.
    """
    balanced = balance(tables)
    scale = finest_scale(balanced, 2 ** (width - 1) - 1, 2**entry_bits - 1)
    if entry_bits < 16:
        scale = kindest_scale(balanced, scale, bits, codes)
    switch_rows = _rounded(balanced.switch_rows, scale)
    switch_means = _rounded(balanced.switch_rows * _mean(bits.astype(np.int64))[:, np.newaxis], scale)
    thresholds, joint_rows, joint_means = [], [], []
    for column, steps, rows in zip(codes.T, balanced.thresholds, balanced.joint_rows, strict=True):
        merged_steps, merged_rows = _merged(steps, _rounded(rows, scale))
        thresholds.append(merged_steps)
        joint_rows.append(merged_rows)
        # A mean computed in floating point may round to just outside of what it is the mean of, and so of int16.
        mean = np.rint(_mean(rows[np.searchsorted(steps, column)]) * scale)
        joint_means.append(np.clip(mean, merged_rows.min(axis=0), merged_rows.max(axis=0)))
    return IntegerTables(
        bias=_rounded(balanced.bias, scale),
        switch_rows=switch_rows,
        thresholds=tuple(thresholds),
        joint_rows=tuple(joint_rows),
        switch_means=switch_means,
        joint_means=np.array(joint_means, np.int16).reshape(len(joint_means), len(tables.bias)),
        scale=scale,
    )


def _rounded(rows: Floats, scale: float) -> Integers:
    return np.rint(rows * scale).astype(np.int16)


def _merged(thresholds: NDArray[np.uint16], rows: Integers) -> tuple[NDArray[np.uint16], Integers]:
    """Return the joint's thresholds and rows without the thresholds that rounding has made meaningless."""
    kept = (rows[1:] != rows[:-1]).any(axis=1)
    return thresholds[kept], rows[np.concatenate([[True], kept])]


def _mean(rows: NDArray[np.int64] | Floats) -> Floats:
    """Return the mean (K,) of rows (n, K), summed exactly, so that it has the same bits on every machine."""
    return np.array([math.fsum(column) / len(rows) for column in rows.T])
