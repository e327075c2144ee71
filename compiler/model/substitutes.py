"""Substitutes for lost inputs: for each input, the constant row with which the others explain the recordings best.

A mean row is an input's average contribution. But the other inputs are often correlated with it, and their rows were
learned with the input present: without it, some grasp types become too probable on the whole and others not enough. So
each input is left out of the training rows, and its substitute changes until the summed probability of every type
equals its frequency: that is the maximum of the likelihood for a constant row. A step adds ln(frequency / sum of the
probabilities) to each type, which never lowers the likelihood (J. N. Darroch and D. Ratcliff, Ann. Math. Stat. 43,
1972).

Where a build has switches and joints, all inputs of one kind may be lost at once, and the sum of their substitutes is
used. Steps for single inputs leave a residual in that sum; least squares over both kinds of residuals say how to share
a step. Inputs whose contribution is constant take no part: another silent joint changes nothing for the others.

An entry stays between the input's smallest and largest contribution to its type, so no sum can leave its bounds. There
are few steps, because later ones overfit the training rows, above all where several inputs are lost.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.integers import IntegerTables

from ..elementary import log, softmax

# Steps from the mean rows; the number of distinct rows used.
STEPS, ROWS = 20, 1000
# A type without rows, or with probability zero, is neither impossible nor certain.
_DOUBT = 0.5
Steps = NDArray[np.int64]
Floats = NDArray[np.float64]


def fit_lost(
    tables: IntegerTables, bits: NDArray[np.bool_], codes: NDArray[np.uint16], labels: NDArray[np.intp]
) -> IntegerTables:
    """Return the tables with the substitutes for each lost switch and joint fitted to the training rows.

    Parameters
    ----------
    tables : IntegerTables
        Their mean rows are the starting point of the fit.
    bits : array of bool, shape (n, s)
        The kept switches.
    codes : array of uint16, shape (n, j)
        The codes of the kept joints.
    labels : array of int, shape (n,)
        The number of each row's class.
    """
    rows, often = _distinct(bits, codes, labels)
    bits, codes, labels = bits[rows], codes[rows], labels[rows]
    wanted = np.asarray(np.bincount(labels, often, tables.n_classes) + _DOUBT, np.float64)
    switch_rows = tables.switch_rows.astype(np.int64)
    closed, joints = bits.astype(np.int64) @ switch_rows, tables.joint_sums(codes).astype(np.int64)
    whole = closed + joints
    added = [tables.choices(joint)[1] for joint in range(tables.n_joints)]
    ends = np.minimum(switch_rows, 0), np.maximum(switch_rows, 0)
    spans = tuple(np.array([end(rows, axis=0) for rows in added]).reshape(-1, len(wanted)) for end in (np.min, np.max))
    # For each varying input, and then for all of its kind if the other kind varies: the scores without it.
    of_switches, of_joints = (np.flatnonzero((least != most).any(axis=1)) for least, most in (ends, spans))
    switches = [whole - bits[:, switch, np.newaxis] * switch_rows[switch] for switch in of_switches]
    each = [whole - joints + _without(tables, codes, [joint]) for joint in of_joints.tolist()]
    if switches and (joints != joints[0]).any():
        switches.append(joints)
    if each and (closed != closed[0]).any():
        each.append(closed + _without(tables, codes, range(tables.n_joints)))

    def fitted(
        means: NDArray[np.int16], chosen: NDArray[np.intp], others: Sequence[Steps], ends: tuple[Steps, ...]
    ) -> NDArray[np.int16]:
        found, before, lacks = means.astype(np.int64), list[Steps](), list[Floats]()
        for _ in range(STEPS if len(chosen) else 0):
            rows = [*found[chosen], found.sum(axis=0)][: len(others)]
            # A row that has not moved keeps its residual.
            lacks = [
                lacks[number]
                if before and np.array_equal(before[number], row)
                else _lack(others[number] + row, often, wanted, tables.scale)
                for number, row in enumerate(rows)
            ]
            before, steps = rows, np.array(lacks[: len(chosen)])
            if len(lacks) > len(chosen):
                steps += (lacks[-1] - steps.sum(axis=0)) / (1 + len(chosen))
            found[chosen] += np.rint(steps).astype(np.int64)
            found = np.clip(found, *ends)
        return found.astype(np.int16)

    return replace(
        tables,
        switch_means=fitted(tables.switch_means, of_switches, switches, ends),
        joint_means=fitted(tables.joint_means, of_joints, each, spans),
    )


def _distinct(
    bits: NDArray[np.bool_], codes: NDArray[np.uint16], labels: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Floats]:
    """Return the indices of distinct rows, at most ROWS, and how often each occurs: the same rows for any row order."""
    held = np.column_stack([labels, np.packbits(bits, axis=1), codes])
    _, rows, often = np.unique(held, axis=0, return_index=True, return_counts=True)
    number = min(len(rows), ROWS)
    some = np.arange(number) * len(rows) // max(number, 1)
    return rows[some], often[some].astype(np.float64)


def _without(tables: IntegerTables, codes: NDArray[np.uint16], joints: Sequence[int]) -> Steps:
    """Return bias plus joints without the given `joints`, (n, K): a lost joint of a grid reads as code 0."""
    left = codes.copy()
    left[:, list(joints)] = 0
    own = [tables.binned(joint).rows[0].astype(np.int64) for joint in joints]
    found: Steps = tables.joint_sums(left).astype(np.int64) - np.sum(own, axis=0)
    return found


def _lack(scores: Steps, often: Floats, wanted: Floats, scale: float) -> Floats:
    """Return the steps of score (K,) that each type lacks to reach its `wanted` probability."""
    shares = softmax(np.ascontiguousarray(scores.T / scale))
    # Summed in integer parts, few enough for an exact double: the order does not matter.
    parts = 2.0 ** min(32, 52 - int(wanted.sum()).bit_length())
    given = np.rint(shares * often * parts).sum(axis=1) / parts + _DOUBT
    return scale * log(wanted / given)
