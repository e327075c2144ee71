"""Collapse any model to the four kinds of terms that boards read, without approximation.

A term of another kind says itself which of them it is made of.

Boosted stumps are additive. A round adds to class k  f_k = (K-1)/K (g_k - mean_j g_j)  with g_j the output of the stump
of class j, which reads one input. So the sum of everything that the rounds add for one input is a function of that
input alone: for a switch a constant, and a row that is added if it is closed; for a joint a row per interval of codes.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.base import HIGHEST_CODE, CoreTerm
from thenar.runtime.model.terms.bins import Bins

from ..elementary import Floats, add_exactly
from ..trainers.base import Model
from ..trainers.stumps import Stumps, spread

# Rows of stump outputs that are expanded at a time: 2 MB with 1000 classes.
_WRITTEN_OUT = 256


def collapse(model: Model, n_switches: int) -> ScoreTables:
    """Return the score tables of a model over [kept switches | joint codes], the first `n_switches` being switches: a
    sum of the four kinds of terms.

    For an ensemble, the scores equal the ensemble's on bits and codes 0..65535 except for rounding of sums (1e-12 of
    the sum of magnitudes), for any number of rounds: contributions to one input are summed with compensation, then
    rounded once.
    """
    if isinstance(model, ScoreTables):
        return _core(model)
    stumps = model
    left, right = _contributions(stumps, 0), _contributions(stumps, 1)
    columns, floors = stumps.columns.ravel(), np.floor(stumps.thresholds.ravel())
    bias = np.zeros(stumps.n_classes)
    switch_rows = np.zeros((n_switches, stumps.n_classes))
    thresholds, joint_rows = [], []
    for column in range(stumps.n_inputs):
        mine = np.flatnonzero(columns == column)
        if column < n_switches:
            opened = _where(floors[mine] >= 0, left[mine], right[mine])
            closed = _where(floors[mine] >= 1, left[mine], right[mine])
            bias += _sums(opened, [len(mine)])[0].sum(axis=0)
            switch_rows[column] = _sums(closed.less(opened), [len(mine)])[0].sum(axis=0)
        else:
            steps, rows = _joint(floors[mine], left[mine], right[mine])
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


@dataclass(frozen=True, slots=True, eq=False)
class _Contributions:
    """The contributions of n stumps to K classes: `own` (n,) to each stump's own class, one of `classes` (n,), and
    `others` (n,) to each other class. As an (n, K) array they would take gigabytes with a thousand classes.
    """

    own: Floats
    others: Floats
    classes: NDArray[np.intp]
    n_classes: int

    def __len__(self) -> int:
        return len(self.own)

    def __getitem__(self, chosen: NDArray[np.intp] | slice) -> "_Contributions":
        return _Contributions(self.own[chosen], self.others[chosen], self.classes[chosen], self.n_classes)

    def less(self, other: "_Contributions") -> "_Contributions":
        """Return these contributions minus those of the same stumps in another branch."""
        return _Contributions(self.own - other.own, self.others - other.others, self.classes, self.n_classes)

    def rows(self) -> Iterator[Floats]:
        """Yield a row (K,) for each stump."""
        for start in range(0, len(self), _WRITTEN_OUT):
            part = self[start : start + _WRITTEN_OUT]
            written = np.repeat(part.others[:, np.newaxis], self.n_classes, axis=1)
            written[np.arange(len(part)), part.classes] = part.own
            yield from written


def _contributions(stumps: Stumps, branch: int) -> _Contributions:
    """Return the contributions of the M K stumps in a branch: centring spreads each output over the classes."""
    own, others = spread(stumps.values[:, :, branch].ravel(), stumps.n_classes, stumps.shrinkage)
    return _Contributions(own, others, np.tile(np.arange(stumps.n_classes), stumps.n_rounds), stumps.n_classes)


def _where(chosen: NDArray[np.bool_], one: _Contributions, other: _Contributions) -> _Contributions:
    own, others = np.where(chosen, one.own, other.own), np.where(chosen, one.others, other.others)
    return _Contributions(own, others, one.classes, one.n_classes)


def _joint(floors: Floats, left: _Contributions, right: _Contributions) -> tuple[NDArray[np.uint16], Floats]:
    """Return (thresholds (T,), rows (T + 1, K)) of one joint's stumps; thresholds beyond the codes need no bin."""
    order = np.argsort(floors, kind="stable")
    steps = np.unique(floors[(floors >= 0) & (floors < HIGHEST_CODE)])
    # The smallest code of each bin represents all of its codes: no threshold lies between them.
    passed = np.searchsorted(floors[order], np.append(0.0, steps + 1)).tolist()
    answer_right = _sums(right[order], passed)
    answer_left = _sums(left[order[::-1]], [len(order) - n for n in reversed(passed)])[::-1]
    high, low = add_exactly(answer_right[:, 0], answer_right[:, 1], answer_left[:, 0])
    return steps.astype(np.uint16), high + (low + answer_left[:, 1])


def _sums(contributions: _Contributions, stops: list[int]) -> Floats:
    """Return the sums of the first n contributions for each n in `stops`, ascending, in two parts: (stops, 2, K)."""
    total = carry = np.zeros(contributions.n_classes)
    sums, done, rows = [], 0, contributions.rows()
    for stop in stops:
        for row in islice(rows, stop - done):
            total, carry = add_exactly(total, carry, row)
        sums.append((total, carry))
        done = stop
    return np.array(sums)
