"""From an ensemble of decision stumps to score tables, without approximation.

Boosted stumps are additive. A round adds to class k  f_k = (K-1)/K (g_k - mean_j g_j)  with g_j the answer of the stump
of class j, which looks at one input. So everything that the rounds ever add because of one input is a function of that
input alone: for a switch a constant and a row to be added if it is closed, for a joint a row per interval of its codes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..boosting.stumps import Stumps, centred
from ..elementary import add_exactly

HIGHEST_CODE = 65535

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ScoreTables:
    """F_k = bias_k + sum over switches s of bits_s * switch_rows[s, k] + sum over joints a of joint_rows[a][bin_a, k].

    bias (K,), switch_rows (s, K), thresholds: j arrays (T_a,) uint16, strictly increasing, joint_rows: j arrays
    (T_a + 1, K); bin_a is the number of thresholds below the code, so code <= t goes left of t.
    """

    bias: Floats
    switch_rows: Floats
    thresholds: tuple[NDArray[np.uint16], ...]
    joint_rows: tuple[Floats, ...]

    @property
    def n_inputs(self) -> int:
        """Kept switches and joints together."""
        return len(self.switch_rows) + len(self.thresholds)

    def scores(self, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> Floats:
        """Return F (n, K) of the kept switches (n, s) and the joints' codes (n, j)."""
        # Row after row and not as a matrix product, whose bits depend on the machine.
        scores = np.tile(self.bias, (len(bits), 1))
        for closed, row in zip(bits.T, self.switch_rows, strict=True):
            scores += np.where(closed[:, np.newaxis], row, 0.0)
        for column, thresholds, rows in zip(codes.T, self.thresholds, self.joint_rows, strict=True):
            scores += rows[np.searchsorted(thresholds, column)]
        return scores


def collapse(stumps: Stumps, n_switches: int) -> ScoreTables:
    """Return the score tables of an ensemble over [kept switches | joint codes], the first `n_switches` being switches.

    Equal to `stumps.scores` on bits and codes 0..65535 up to the rounding of sums (1e-12 of what is summed), however
    many rounds there are: all that an input adds is summed with compensation, and rounded once.
    """
    left, right = _answers(stumps, 0), _answers(stumps, 1)
    columns, floors = stumps.columns.ravel(), np.floor(stumps.thresholds.ravel())
    bias = np.zeros(stumps.n_classes)
    switch_rows = np.zeros((n_switches, stumps.n_classes))
    thresholds, joint_rows = [], []
    for column in range(stumps.n_inputs):
        mine = np.flatnonzero(columns == column)
        if column < n_switches:
            opened = np.where(floors[mine, np.newaxis] >= 0, left[mine], right[mine])
            closed = np.where(floors[mine, np.newaxis] >= 1, left[mine], right[mine])
            bias += _sums(opened, [len(mine)])[0].sum(axis=0)
            switch_rows[column] = _sums(closed - opened, [len(mine)])[0].sum(axis=0)
        else:
            steps, rows = _joint(floors[mine], left[mine], right[mine])
            thresholds.append(steps)
            joint_rows.append(rows)
    return ScoreTables(bias, switch_rows, tuple(thresholds), tuple(joint_rows))


def _answers(stumps: Stumps, branch: int) -> Floats:
    """Return what each stump adds to every class in a branch, (M K, K): centring spreads it from its own class."""
    own = np.einsum("mk,kc->mkc", stumps.values[:, :, branch], np.eye(stumps.n_classes))
    spread = centred(own.reshape(-1, stumps.n_classes).T, stumps.shrinkage)
    return np.ascontiguousarray(spread.T)


def _joint(floors: Floats, left: Floats, right: Floats) -> tuple[NDArray[np.uint16], Floats]:
    """Return (thresholds (T,), rows (T + 1, K)) of one joint's stumps; a threshold beyond the codes needs no bin."""
    order = np.argsort(floors, kind="stable")
    steps = np.unique(floors[(floors >= 0) & (floors < HIGHEST_CODE)])
    # The smallest code of each bin stands for all of its codes: no floor lies between them.
    passed = np.searchsorted(floors[order], np.append(0.0, steps + 1)).tolist()
    answer_right = _sums(right[order], passed)
    answer_left = _sums(left[order[::-1]], [len(order) - n for n in reversed(passed)])[::-1]
    high, low = add_exactly(answer_right[:, 0], answer_right[:, 1], answer_left[:, 0])
    return steps.astype(np.uint16), high + (low + answer_left[:, 1])


def _sums(rows: Floats, stops: list[int]) -> Floats:
    """Return the sums of the first n of rows (N, K) for each n in `stops`, ascending, in two parts: (stops, 2, K)."""
    total = carry = np.zeros(rows.shape[1])
    sums, done = [], 0
    for stop in stops:
        for row in rows[done:stop]:
            total, carry = add_exactly(total, carry, row)
        sums.append((total, carry))
        done = stop
    return np.array(sums)
