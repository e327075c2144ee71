"""The largest magnitude that a sum of integer rows can reach, with the frame and order of summation that reach it."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import HIGHEST_CODE, LOST, IntegerTables

OPEN, CLOSED = 0, 1
_SIGNS = 1, -1


@dataclass(frozen=True, slots=True, eq=False)
class Furthest:
    """A frame, perhaps with inputs missing, whose rows reach the largest partial sum when added in this `order`.

    The first `n_terms` rows bring class `grasp` to the partial sum `total`; the others lead back. order (n,) numbers
    the terms: 0 the bias, then switches, then joints, then slopes or pairs, n in all. bits (s,) and codes (j,) come
    with the masks of missing inputs that the runtime takes; `terms` (n, K) are the rows themselves, by number.
    """

    grasp: int
    total: int
    n_terms: int
    order: NDArray[np.intp]
    terms: NDArray[np.int16]
    bits: NDArray[np.bool_]
    codes: NDArray[np.uint16]
    lost_switches: NDArray[np.bool_]
    lost_joints: NDArray[np.bool_]


def furthest(tables: IntegerTables, *, missing: bool = True) -> Furthest:
    """Return the sum that reaches `tables.bound`; without `missing`, the largest over frames that are read completely.

    A bin that no code can reach, above a threshold of 65535, counts for the bound but for no frame; `collapse` never
    makes one.
    """
    choices = list(_choices(tables, missing))
    onwards = [[np.maximum(sign * terms, 0).sum(axis=0) for _, terms in choices] for sign in _SIGNS]
    reached = np.stack([sum(onward.max(axis=0) for onward in each) for each in onwards])
    way, grasp = map(int, np.unravel_index(reached.argmax(), reached.shape))
    sign = _SIGNS[way]
    picked = [int(np.argmax(onward[:, grasp])) for onward in onwards[way]]
    chosen = [(values[pick], terms[:, pick]) for (values, terms), pick in zip(choices, picked, strict=True)]
    first = 1 + tables.n_switches
    switches, joints = np.array([value for value, _ in chosen[1:first]]), np.zeros(tables.n_joints, np.int64)
    own, more = [term[0] for _, term in chosen[:first]], []
    of_joints = np.zeros((tables.n_joints, tables.n_classes), np.int64)
    for unit, (codes, term) in zip(tables.units, chosen[first:], strict=True):
        joints[list(unit)], of_joints[list(unit)] = codes, term[: len(unit)]
        more += list(term[len(unit) :])
    terms = np.stack([*own, *of_joints, *more])
    onward = sign * terms[:, grasp] > 0
    order = np.concatenate([np.flatnonzero(onward), np.flatnonzero(~onward)])
    return Furthest(
        grasp=grasp,
        total=int(terms[onward, grasp].sum()),
        n_terms=int(np.count_nonzero(onward)),
        order=order,
        terms=terms.astype(np.int16),
        bits=switches == CLOSED,
        codes=np.maximum(joints, 0).astype(np.uint16),
        lost_switches=switches == LOST,
        lost_joints=joints == LOST,
    )


def _choices(tables: IntegerTables, missing: bool) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Yield, for bias, switches and units of joints, the choices, (c,) or (c, joints), and their terms, (t, c, K)."""
    last = slice(None if missing else -1)
    yield np.zeros(1, np.int64), tables.bias[np.newaxis, np.newaxis].astype(np.int64)
    for row, mean in zip(tables.switch_rows, tables.switch_means, strict=True):
        yield np.array([OPEN, CLOSED, LOST])[last], np.stack([0 * row, row, mean])[np.newaxis, last].astype(np.int64)
    for unit in tables.units:
        codes, terms = tables.all_choices(unit)
        there = (codes <= HIGHEST_CODE).all(axis=1) & (missing | (codes != LOST).all(axis=1))
        yield codes[there], terms[:, there]
