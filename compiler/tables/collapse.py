"""Collapse an ensemble of decision stumps to score tables, without approximation.

Boosted stumps are additive. A round adds to class k  f_k = (K-1)/K (g_k - mean_j g_j)  with g_j the output of the stump
of class j, which reads one input. So the sum of everything that the rounds add for one input is a function of that
input alone: for a switch a constant, and a row that is added if it is closed; for a joint a row per interval of codes.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import HIGHEST_CODE, Pair

from ..boosting.stumps import Stumps, spread
from ..elementary import add_exactly

# Rows of stump outputs that are expanded at a time: 2 MB with 1000 classes.
_WRITTEN_OUT = 256

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """The contribution of a joint in proportion to its code: row_k * (clamp(code, low, high) - low).

    Parameters
    ----------
    joint : int
        The index of the joint, from 0.
    low, high : int
        The codes between which the contribution changes, low < high: the range in the training rows.
    row : ndarray of float, shape (K,)
        The contribution per code.
    """

    joint: int
    low: int
    high: int
    row: Floats

    def of(self, codes: NDArray[np.uint16]) -> Floats:
        """Return the contribution (n, K) to rows with codes (n, j) of all joints."""
        above = np.clip(codes[:, self.joint].astype(np.int64), self.low, self.high) - self.low
        return above[:, np.newaxis] * self.row


@dataclass(frozen=True, slots=True, eq=False)
class ScoreTables:
    """`F_k = bias_k + sum over s of bits_s * switch_rows[s, k] + sum over joints a of joint_rows[a][bin_a, k]`.

    Linear joints also add their lines, and pairs of joints add a row that depends on both codes.

    Parameters
    ----------
    bias : ndarray of float, shape (K,)
        The scores with every switch open, before any joint is added.
    switch_rows : ndarray of float, shape (s, K)
        The contribution of a closed switch.
    thresholds : tuple of j ndarrays of uint16, shape (T_a,)
        Strictly increasing; bin_a is the number of thresholds below the code, so code <= t goes left of t.
    joint_rows : tuple of j ndarrays of float, shape (T_a + 1, K)
        The contribution of a joint in each bin; a purely linear joint has one row of zeros.
    lines : tuple of Line, optional
        Contributions in proportion to the code, for some joints, at most one each, in the order of the joints.
    pairs : tuple of Pair, optional
        Contributions of two joints together; each joint is in one pair at most, in the order of first joints. Tables
        with pairs have no lines.

    Examples
    --------
    >>> import numpy as np
    >>> from thenar.compiler import ScoreTables
    >>> bins = (np.array([100], np.uint16),)
    >>> tables = ScoreTables(np.zeros(2), np.array([[0.0, 1.0]]), bins, (np.array([[0.5, 0.0], [0.0, 0.5]]),))
    >>> tables.scores(np.array([[True], [False]]), np.array([[100], [101]])).tolist()
    [[0.5, 1.0], [0.0, 0.5]]
    """

    bias: Floats
    switch_rows: Floats
    thresholds: tuple[NDArray[np.uint16], ...]
    joint_rows: tuple[Floats, ...]
    lines: tuple[Line, ...] = ()
    pairs: tuple[Pair, ...] = ()

    @property
    def n_inputs(self) -> int:
        """Number of kept switches and joints."""
        return len(self.switch_rows) + len(self.thresholds)

    @property
    def n_classes(self) -> int:
        """Number K of classes."""
        return len(self.bias)

    def scores(self, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> Floats:
        """Return F (n, K) of the kept switches (n, s) and the joints' codes (n, j)."""
        # Add row by row: the last bits of a matrix product depend on the machine.
        scores = np.tile(self.bias, (len(bits), 1))
        for closed, row in zip(bits.T, self.switch_rows, strict=True):
            scores += np.where(closed[:, np.newaxis], row, 0.0)
        for column, thresholds, rows in zip(codes.T, self.thresholds, self.joint_rows, strict=True):
            scores += rows[np.searchsorted(thresholds, column)]
        for line in self.lines:
            scores += line.of(codes)
        for pair in self.pairs:
            scores += pair.of(codes)
        return scores


def first_codes(*thresholds: NDArray[np.uint16]) -> NDArray[np.int64]:
    """Return the smallest code of each bin of a joint, where bins are intersections of those of several `thresholds`.

    Such a code represents all codes of its bin; a bin beyond the range of codes has none.
    """
    codes = np.unique(np.concatenate([[0], *(each.astype(np.int64) + 1 for each in thresholds)]))
    return codes[codes <= HIGHEST_CODE]


# The models that trainers return: score tables, or an ensemble that collapses to them.
Model = Stumps | ScoreTables


def model_scores(model: Model, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> Floats:
    """Return a model's own scores F (n, K) of the kept switches (n, s) and the joints' codes (n, j)."""
    return model.scores(np.hstack([bits, codes])) if isinstance(model, Stumps) else model.scores(bits, codes)


def collapse(model: Model, n_switches: int) -> ScoreTables:
    """Return the score tables of a model over [kept switches | joint codes], the first `n_switches` being switches.

    For an ensemble, the scores equal the ensemble's on bits and codes 0..65535 except for rounding of sums (1e-12 of
    the sum of magnitudes), for any number of rounds: contributions to one input are summed with compensation, then
    rounded once.
    """
    if isinstance(model, ScoreTables):
        return model
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
    return ScoreTables(bias, switch_rows, tuple(thresholds), tuple(joint_rows))


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
