"""From an ensemble of decision stumps to score tables, without approximation.

Boosted stumps are additive. A round adds to class k  f_k = (K-1)/K (g_k - mean_j g_j)  with g_j the answer of the stump
of class j, which looks at one input. So everything that the rounds ever add because of one input is a function of that
input alone: for a switch a constant and a row to be added if it is closed, for a joint a row per interval of its codes.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import HIGHEST_CODE, Pair

from ..boosting.stumps import Stumps, spread
from ..elementary import add_exactly

# Rows of answers that are written out at a time: of 1000 classes, 2 MB.
_WRITTEN_OUT = 256

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """What a joint adds in proportion to its code: row_k * (clamp(code, low, high) - low).

    Parameters
    ----------
    joint : int
        The number of the joint, from 0.
    low, high : int
        The codes between which it rises, low < high: the range that was trained on.
    row : ndarray of float, shape (K,)
        What each code adds.
    """

    joint: int
    low: int
    high: int
    row: Floats

    def of(self, codes: NDArray[np.uint16]) -> Floats:
        """Return what it adds (n, K) for all joints' codes (n, j)."""
        above = np.clip(codes[:, self.joint].astype(np.int64), self.low, self.high) - self.low
        return above[:, np.newaxis] * self.row


@dataclass(frozen=True, slots=True, eq=False)
class ScoreTables:
    """`F_k = bias_k + sum over s of bits_s * switch_rows[s, k] + sum over joints a of joint_rows[a][bin_a, k]`.

    Linear joints add what their lines say besides, pairs of joints a row for both codes.

    Parameters
    ----------
    bias : ndarray of float, shape (K,)
        The scores with every switch open, before any joint.
    switch_rows : ndarray of float, shape (s, K)
        What a closed switch adds.
    thresholds : tuple of j ndarrays of uint16, shape (T_a,)
        Strictly increasing; bin_a is the number of thresholds below the code, so code <= t goes left of t.
    joint_rows : tuple of j ndarrays of float, shape (T_a + 1, K)
        What a joint adds in each bin; of a joint that is nothing but linear one row of zeros.
    lines : tuple of Line, optional
        What some of the joints add in proportion to their codes, at most one a joint, in the order of the joints.
    pairs : tuple of Pair, optional
        What joints add two by two, each joint in one pair at most, in the order of their first joints; and no lines.

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
        """Kept switches and joints together."""
        return len(self.switch_rows) + len(self.thresholds)

    @property
    def n_classes(self) -> int:
        """Number K of classes."""
        return len(self.bias)

    def scores(self, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> Floats:
        """Return F (n, K) of the kept switches (n, s) and the joints' codes (n, j)."""
        # Row after row and not as a matrix product, whose bits depend on the machine.
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
    """Return the smallest code of each bin of a joint, where the bins of several `thresholds` overlap of each part.

    Such a code stands for all codes of its bin; a bin beyond the codes has none.
    """
    codes = np.unique(np.concatenate([[0], *(each.astype(np.int64) + 1 for each in thresholds)]))
    return codes[codes <= HIGHEST_CODE]


def added(one: ScoreTables, other: ScoreTables) -> ScoreTables:
    """Return tables whose scores are the sums of the scores of two, of the same inputs and classes; at most one of them
    has lines or pairs.
    """
    thresholds, joint_rows = [], []
    parts = zip(one.thresholds, one.joint_rows, other.thresholds, other.joint_rows, strict=True)
    for steps, rows, more_steps, more_rows in parts:
        codes = first_codes(steps, more_steps)
        thresholds.append((codes[1:] - 1).astype(np.uint16))
        joint_rows.append(rows[np.searchsorted(steps, codes)] + more_rows[np.searchsorted(more_steps, codes)])
    bias, switch_rows = one.bias + other.bias, one.switch_rows + other.switch_rows
    return ScoreTables(
        bias, switch_rows, tuple(thresholds), tuple(joint_rows), one.lines + other.lines, one.pairs + other.pairs
    )


# What trainers make: score tables, or an ensemble that collapses to them.
Model = Stumps | ScoreTables


def model_scores(model: Model, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> Floats:
    """Return a model's own scores F (n, K) of the kept switches (n, s) and the joints' codes (n, j)."""
    return model.scores(np.hstack([bits, codes])) if isinstance(model, Stumps) else model.scores(bits, codes)


def collapse(model: Model, n_switches: int) -> ScoreTables:
    """Return the score tables of a model over [kept switches | joint codes], the first `n_switches` being switches.

    Those of an ensemble are equal to its scores on bits and codes 0..65535 up to the rounding of sums (1e-12 of what is
    summed), however many rounds there are: all that an input adds is summed with compensation, and rounded once.
    """
    if isinstance(model, ScoreTables):
        return model
    stumps = model
    left, right = _answers(stumps, 0), _answers(stumps, 1)
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
class _Answers:
    """What n stumps add to K classes: `own` (n,) to the stump's own class, one of `classes` (n,), and `others` (n,) to
    each other class. Written out they would be (n, K), gigabytes of a thousand classes.
    """

    own: Floats
    others: Floats
    classes: NDArray[np.intp]
    n_classes: int

    def __len__(self) -> int:
        return len(self.own)

    def __getitem__(self, chosen: NDArray[np.intp] | slice) -> "_Answers":
        return _Answers(self.own[chosen], self.others[chosen], self.classes[chosen], self.n_classes)

    def less(self, other: "_Answers") -> "_Answers":
        """Return these less the answers of the same stumps in another branch."""
        return _Answers(self.own - other.own, self.others - other.others, self.classes, self.n_classes)

    def rows(self) -> Iterator[Floats]:
        """Yield a row (K,) of each stump."""
        for start in range(0, len(self), _WRITTEN_OUT):
            part = self[start : start + _WRITTEN_OUT]
            written = np.repeat(part.others[:, np.newaxis], self.n_classes, axis=1)
            written[np.arange(len(part)), part.classes] = part.own
            yield from written


def _answers(stumps: Stumps, branch: int) -> _Answers:
    """Return the answers of the M K stumps in a branch: centring spreads it from its own class."""
    own, others = spread(stumps.values[:, :, branch].ravel(), stumps.n_classes, stumps.shrinkage)
    return _Answers(own, others, np.tile(np.arange(stumps.n_classes), stumps.n_rounds), stumps.n_classes)


def _where(chosen: NDArray[np.bool_], one: _Answers, other: _Answers) -> _Answers:
    own, others = np.where(chosen, one.own, other.own), np.where(chosen, one.others, other.others)
    return _Answers(own, others, one.classes, one.n_classes)


def _joint(floors: Floats, left: _Answers, right: _Answers) -> tuple[NDArray[np.uint16], Floats]:
    """Return (thresholds (T,), rows (T + 1, K)) of one joint's stumps; a threshold beyond the codes needs no bin."""
    order = np.argsort(floors, kind="stable")
    steps = np.unique(floors[(floors >= 0) & (floors < HIGHEST_CODE)])
    # The smallest code of each bin stands for all of its codes: no floor lies between them.
    passed = np.searchsorted(floors[order], np.append(0.0, steps + 1)).tolist()
    answer_right = _sums(right[order], passed)
    answer_left = _sums(left[order[::-1]], [len(order) - n for n in reversed(passed)])[::-1]
    high, low = add_exactly(answer_right[:, 0], answer_right[:, 1], answer_left[:, 0])
    return steps.astype(np.uint16), high + (low + answer_left[:, 1])


def _sums(answers: _Answers, stops: list[int]) -> Floats:
    """Return the sums of the first n answers for each n in `stops`, ascending, in two parts: (stops, 2, K)."""
    total = carry = np.zeros(answers.n_classes)
    sums, done, rows = [], 0, answers.rows()
    for stop in stops:
        for row in islice(rows, stop - done):
            total, carry = add_exactly(total, carry, row)
        sums.append((total, carry))
        done = stop
    return np.array(sums)
