"""Collapse any model to the four kinds of terms that boards read, without approximation.

A term of another kind says itself which of them it is made of.

Boosted stumps are additive. A round adds to class k  f_k = (K-1)/K (g_k - mean_j g_j)  with g_j the output of the stump
of class j, which reads one input. So the sum of everything that the rounds add for one input is a function of that
input alone: for a switch a constant, and a row that is added if it is closed; for a joint a row per interval of codes.
"""

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.base import HIGHEST_CODE, CoreTerm
from thenar.runtime.model.terms.bins import Bins

from ..elementary import Floats, add_exactly, on_grids
from ..trainers.base import Model
from ..trainers.stumps import Stumps, spread


def collapse(model: Model, n_switches: int) -> ScoreTables:
    """Return the score tables of a model over [kept switches | joint codes], the first `n_switches` being switches: a
    sum of the four kinds of terms.

    For an ensemble, the scores equal the ensemble's on bits and codes 0..65535 except for rounding of sums (1e-12 of
    the sum of magnitudes), for any number of rounds: contributions to one input are summed with compensation, then
    rounded once.
    """
    if isinstance(model, ScoreTables):
        return _core(model)
    stumps, classes = model, np.tile(np.arange(model.n_classes), model.n_rounds)
    left, right = _contributions(stumps, 0), _contributions(stumps, 1)
    columns, floors = stumps.columns.ravel(), np.floor(stumps.thresholds.ravel())
    bias = np.zeros(stumps.n_classes)
    switch_rows = np.zeros((n_switches, stumps.n_classes))
    thresholds, joint_rows = [], []
    for column in range(stumps.n_inputs):
        mine = np.flatnonzero(columns == column)
        if column < n_switches:
            opened, closed = (np.where(floors[mine] >= value, left[:, mine], right[:, mine]) for value in (0, 1))
            bias += _sums(opened, classes[mine], stumps.n_classes, [len(mine)])[0].sum(axis=0)
            switch_rows[column] = _sums(closed - opened, classes[mine], stumps.n_classes, [len(mine)])[0].sum(axis=0)
        else:
            steps, rows = _joint(floors[mine], left[:, mine], right[:, mine], classes[mine], stumps.n_classes)
            thresholds.append(steps)
            joint_rows.append(rows)
    return ScoreTables.of(bias, switch_rows, thresholds, joint_rows)


def _core(tables: ScoreTables) -> ScoreTables:
    """Return tables whose terms of other kinds became terms of the four; more bins of a joint are added to its own."""
    if all(isinstance(term, CoreTerm) for term in tables.terms):
        return tables
    bins, further = list(tables.bins), []
    for term in tables.further:
        for part in term.core():
            if isinstance(part, Bins):
                bins[part.joint] = bins[part.joint].plus(part)
            else:
                further.append(part)
    return ScoreTables(tables.bias, (*tables.bits, *bins, *sorted(further, key=lambda part: part.inputs)))


def _contributions(stumps: Stumps, branch: int) -> Floats:
    """Return the contributions (2, M K) of the M K stumps in a branch: to the stump's own class, and to each other one.

    Centring spreads each output over the classes. For all K classes they would take gigabytes with a thousand classes.
    """
    return np.array(spread(stumps.values[:, :, branch].ravel(), stumps.n_classes, stumps.shrinkage))


def _joint(
    floors: Floats, left: Floats, right: Floats, classes: NDArray[np.intp], n_classes: int
) -> tuple[NDArray[np.uint16], Floats]:
    """Return (thresholds (T,), rows (T + 1, K)) of one joint's stumps; thresholds beyond the codes need no bin."""
    order = np.argsort(floors, kind="stable")
    steps = np.unique(floors[(floors >= 0) & (floors < HIGHEST_CODE)])
    # The smallest code of each bin represents all of its codes: no threshold lies between them.
    stops = np.searchsorted(floors[order], np.append(0.0, steps + 1)).tolist()
    from_right = _sums(right[:, order], classes[order], n_classes, stops)
    back = order[::-1]
    from_left = _sums(left[:, back], classes[back], n_classes, [len(order) - stop for stop in reversed(stops)])[::-1]
    high, low = add_exactly(from_right[:, 0], from_right[:, 1], from_left[:, 0])
    return steps.astype(np.uint16), high + (low + from_left[:, 1])


def _sums(contributions: Floats, classes: NDArray[np.intp], n_classes: int, stops: list[int]) -> Floats:
    """Return the sums of the first n contributions for each n in `stops`, ascending, in two parts: (stops, 2, K).

    Each part is exact: the sum of the contributions on a grid, and of their remainders on a finer one.
    """
    n = stops[-1]
    interval = np.searchsorted(stops, np.arange(n), side="right")
    parts = []
    for grid in on_grids(contributions[:, :n].reshape(1, -1)):
        own, other = grid.units.reshape(2, -1)
        sums = np.tile(np.bincount(interval, other, len(stops))[:, np.newaxis], n_classes)
        np.add.at(sums, (interval, classes[:n]), own - other)
        parts.append(np.ldexp(np.cumsum(sums, axis=0), -grid.exponents[0]))
    return np.stack(parts, axis=1)
