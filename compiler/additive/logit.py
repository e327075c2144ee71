"""The additive multinomial logit: all score tables fitted at once, as the one minimum of a convex function.

A column that takes two values is a row of scores, added at the upper one; any other is a row for each of its bins, and
one for missing values, where there are any. Over the rows W (r, K), the first of which is the bias, this is minimised:

    sum over frames i of u_i (log sum_k exp F_ik - F_iy)  +  1/2 sum over rows j of pull_j |W_j|^2
        + 1/2 smoothness * (sum of |W_j+1 - W_j|^2 over neighbouring bins j and j + 1 of a column),      F = D W

with u the frames' weights and D (n, r) the bits that say which rows count in a frame. As every row has a pull there is
one minimum, and it is finite, also where classes can be parted perfectly, or a class has no frames. Newton's method
finds it: H V = -gradient is solved by conjugate gradients, to a share that falls as the gradient does (Nocedal and
Wright, Numerical Optimization, 2nd ed., algorithm 7.1). What goes into a product with D is rounded to a grid first, on
which all sums are exact: so neither the order of frames nor the machine has a part in the answer.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..boosting.binning import bin_columns
from ..boosting.boost import BoostingError, check_rows
from ..boosting.exactsums import dot, on_one_grid
from ..elementary import add_up, softmax_and_loss
from ..limits import check_memory
from ..tables.collapse import HIGHEST_CODE, Floats, ScoreTables

if TYPE_CHECKING:
    from scipy.sparse import csr_array

BINS = 16
PENALTY, SMOOTHNESS = 1.0, 10.0
# Of the penalty: what pulls each bin, whose neighbours hold it already, and the bias, which must only stay finite.
BIN_SHARE, BIAS_SHARE = 2.0**-4, 2.0**-10
# No derivative of the loss is larger at the answer than this, in the weight of all frames together.
TOLERANCE = 1e-7
# Of Newton's steps, of conjugate gradients in a step, and of halvings of a step: far more than was ever seen.
_MOST_STEPS, _MOST_DIRECTIONS, _MOST_HALVINGS = 500, 2000, 40
_ENOUGH = 1e-4  # of the slope that Armijo's rule wants to see
_ROUNDING = 2.0**-46  # of the loss: a rise by less may be one of rounding
_LOOSEST, _TIGHTEST = 0.5, 0.1  # shares of the gradient, and of the tolerance, that a step may leave unsolved


@dataclass(frozen=True, slots=True, eq=False)
class ColumnTables:
    """F_k(x) = bias_k + sum over columns of rows[column][bin, k], for columns of any numbers, NaN for missing.

    bias   (K,)
    edges  for each column, ascending (B - 1,): the bin of x is the number of edges below it
    rows   for each column (B + 1, K), the last one what a missing value adds
    """

    bias: Floats
    edges: tuple[Floats, ...]
    rows: tuple[Floats, ...]

    def scores(self, X: NDArray[np.generic]) -> Floats:
        """Return F (n, K) of X (n, d)."""
        scores = np.tile(self.bias, (len(X), 1))
        for x, edges, rows in zip(X.T, self.edges, self.rows, strict=True):
            scores += rows[_bins(np.asarray(x, np.float64), edges)]
        return scores

    def score_tables(self, n_switches: int) -> ScoreTables:
        """Return the tables of [switches | joint codes], the first `n_switches` columns being switches."""
        bias, switch_rows = self.bias, np.zeros((n_switches, len(self.bias)))
        for column in range(n_switches):
            opened, closed = self.rows[column][np.searchsorted(self.edges[column], [0.0, 1.0])]
            bias, switch_rows[column] = bias + opened, closed - opened
        thresholds, joint_rows = [], []
        for edges, rows in zip(self.edges[n_switches:], self.rows[n_switches:], strict=True):
            floors = np.unique(np.floor(edges))
            steps = floors[(floors >= 0) & (floors < HIGHEST_CODE)]
            thresholds.append(steps.astype(np.uint16))
            # The smallest code of each bin.
            joint_rows.append(rows[np.searchsorted(edges, np.append(0.0, steps + 1))])
        return ScoreTables(bias, switch_rows, tuple(thresholds), tuple(joint_rows))


def fit_logit(
    X: NDArray[np.generic],
    labels: NDArray[np.intp],
    n_classes: int,
    *,
    penalty: float = PENALTY,
    smoothness: float = SMOOTHNESS,
    max_bins: int | None = BINS,
    weights: Floats | None = None,
    on_step: Callable[[], None] | None = None,
) -> ColumnTables:
    """Fit X (n, d) numbers (NaN: missing), labels (n,) in 0..n_classes-1, weights (n,) >= 0.

    `penalty` pulls rows towards zero, `smoothness` those of neighbouring bins towards each other; columns have at most
    `max_bins` bins (2 or more; None: one for each value), that hold frames as evenly as can be. Raises BoostingError.
    """
    if not (0 < penalty < math.inf and 0 <= smoothness < math.inf):
        raise BoostingError(f"penalty={penalty} must be above 0, and smoothness={smoothness} at least 0, both finite")
    if max_bins is not None and max_bins < 2:
        raise BoostingError(f"max_bins={max_bins} must be at least 2: one bin tells nothing")
    check_rows(X, labels, n_classes, weights)
    check_memory(len(X), n_classes, BoostingError, *X.shape[1:])
    scale = 1.0
    if weights is not None:
        # By a power of two, which changes no answer: now sums of huge weights stay finite, and of tiny ones exact.
        scale = float(np.ldexp(1.0, -np.frexp(weights.max())[1]))
        weights = on_one_grid(weights * scale, len(X))
    columns = _columns(X, max_bins, weights)
    rows = _Fit(columns, labels, n_classes, penalty * scale, smoothness * scale, weights).minimum(on_step)
    held = np.ones(len(X)) if weights is None else weights
    bias, *tables = np.split(rows, np.cumsum([1, *(column.n_rows for column in columns[:-1])])) if columns else [rows]
    tabled = tuple(column.table(own, held) for column, own in zip(columns, tables, strict=True))
    return ColumnTables(bias[0], tuple(column.edges for column in columns), tabled)


@dataclass(frozen=True, slots=True, eq=False)
class _Column:
    """A column of frames: its edges, the bin (n,) of each, the last for missing, and the first bin that has a row."""

    edges: Floats
    bins: NDArray[np.intp]
    first: int

    @property
    def n_rows(self) -> int:
        return int(self.bins.max()) + 1 - self.first

    def table(self, rows: Floats, weights: Floats) -> Floats:
        """Return what each bin adds, and a missing value: where none was seen, the mean of the frames."""
        table = np.vstack([np.zeros((self.first, rows.shape[1])), rows])
        if len(table) < len(self.edges) + 2:
            shares = np.bincount(self.bins, weights) / weights.sum()
            table = np.vstack([table, add_up(shares[:, np.newaxis] * table)])
        return table


def _columns(X: NDArray[np.generic], max_bins: int | None, weights: Floats | None) -> list[_Column]:
    binned = bin_columns(X, max_bins, weights)
    columns = []
    for number, x in enumerate(X.T):
        edges = np.zeros(0)
        if number in binned.home:
            group, position = binned.home[number]
            edges = np.array([group.threshold(position, split) for split in range(group.n_splits(position))])
        bins = _bins(np.asarray(x, np.float64), edges)
        # One bin alone says what the bias does, and one of two what the other does not.
        columns.append(_Column(edges, bins, int(bins.max() < 2)))
    return columns


def _bins(x: Floats, edges: Floats) -> NDArray[np.intp]:
    """Return the bin (n,) of each number: how many edges are below it, and one more than there are for NaN."""
    bins: NDArray[np.intp] = np.searchsorted(edges, x) + np.isnan(x)
    return bins


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """Rows W (r, K), the probabilities (n, K) there, the loss and its gradient (r, K)."""

    rows: Floats
    probability: Floats
    loss: float
    gradient: Floats


class _Fit:
    """The loss of rows W (r, K), and its minimum. Sums over frames are exact, as are those that decide."""

    def __init__(
        self,
        columns: list[_Column],
        labels: NDArray[np.intp],
        n_classes: int,
        penalty: float,
        smoothness: float,
        weights: Floats | None,
    ) -> None:
        n, self._labels, self._weights = len(labels), labels, weights
        self._member = (labels[:, np.newaxis] == np.arange(n_classes)).astype(np.float64)
        self._total = float(n if weights is None else weights.sum())
        frames, rows = [np.arange(n)], [np.zeros(n, np.intp)]
        pull, joined, start = [np.array([BIAS_SHARE])], [], 1
        for column in columns:
            there = np.flatnonzero(column.bins >= column.first)
            frames.append(there)
            rows.append(start - column.first + column.bins[there])
            pull.append(np.full(column.n_rows, BIN_SHARE if column.first == 0 else 1.0))
            if column.first == 0:
                joined.append(np.arange(start, start + len(column.edges)))
            start += column.n_rows
        self._bits = _sparse(np.concatenate(frames), np.concatenate(rows), (n, start))
        self._rows_a_frame = 1 + len(columns)
        self._by_row = self._bits.T.tocsr()
        self._pull = penalty * np.concatenate(pull)[:, np.newaxis]
        self._joint = np.zeros((start - 1, 1))
        self._joint[np.concatenate([np.zeros(0, np.intp), *joined])] = smoothness
        ends = np.pad(self._joint, ((1, 1), (0, 0)))
        self._stiffness = self._pull + ends[1:] + ends[:-1]

    def minimum(self, on_step: Callable[[], None] | None = None) -> Floats:
        """Return the rows at which no derivative is beyond TOLERANCE of the weight of all frames."""
        point = self._at(np.zeros((len(self._pull), self._member.shape[1])))
        wanted, steepest = TOLERANCE * self._total, _largest(point.gradient)
        for _ in range(_MOST_STEPS):
            steep = _largest(point.gradient)
            if steep <= wanted:
                return point.rows
            unsolved = max(steep * min(_LOOSEST, math.sqrt(steep / steepest)), _TIGHTEST * wanted)
            point = self._along(point, self._direction(point, unsolved))
            if on_step is not None:
                on_step()
        raise BoostingError(
            f"no minimum was found in {_MOST_STEPS} steps: the penalty is too small for weights as unlike as these"
        )

    def _at(self, rows: Floats) -> _Point:
        scores = self._bits @ on_one_grid(rows, self._rows_a_frame)
        shares, mean = softmax_and_loss(np.ascontiguousarray(scores.T), self._labels, self._weights)
        probability, held = np.ascontiguousarray(shares.T), self._held(rows)
        gradient = self._over_frames(probability - self._member) + held
        return _Point(rows, probability, mean * self._total + 0.5 * dot(rows, held), gradient)

    def _held(self, rows: Floats) -> Floats:
        """Return what the penalties add to the gradient, (r, K)."""
        held, stepped = self._pull * rows, self._joint * (rows[1:] - rows[:-1])
        held[1:] += stepped
        held[:-1] -= stepped
        return held

    def _over_frames(self, values: Floats) -> Floats:
        """Return the sums (r, K) of `values` (n, K), which are lost, times the weights, over the frames of each row."""
        if self._weights is not None:
            values *= self._weights[:, np.newaxis]
        summed: Floats = self._by_row @ on_one_grid(values, len(values))
        return summed

    def _bent(self, rows: Floats, probability: Floats) -> Floats:
        """Return the Hessian's product (r, K) with rows (r, K), at these probabilities."""
        moved = self._bits @ on_one_grid(rows, self._rows_a_frame)
        moved *= probability
        moved = on_one_grid(moved, moved.shape[1])
        moved -= probability * moved.sum(axis=1, keepdims=True)
        return self._over_frames(moved) + self._held(rows)

    def _direction(self, point: _Point, unsolved: float) -> Floats:
        """Return V with H V = -gradient but for `unsolved`, by conjugate gradients, preconditioned by H's diagonal."""
        p = point.probability
        diagonal = self._over_frames(p * (1.0 - p)) + self._stiffness
        found, rest = np.zeros_like(point.rows), -point.gradient
        near = rest / diagonal
        along, size = near, dot(rest, near)
        for _ in range(_MOST_DIRECTIONS):
            bent = self._bent(along, p)
            length = size / dot(along, bent)
            found += length * along
            rest -= length * bent
            if _largest(rest) <= unsolved:
                break
            near = rest / diagonal
            before, size = size, dot(rest, near)
            along = near + (size / before) * along
        return found

    def _along(self, point: _Point, direction: Floats) -> _Point:
        """Return a point along the direction that is lower by enough: the whole step, or a half, a quarter of it ..."""
        slope, length = dot(direction, point.gradient), 1.0
        for _ in range(_MOST_HALVINGS):
            there = self._at(point.rows + length * direction)
            if there.loss <= point.loss + _ENOUGH * length * slope + _ROUNDING * point.loss:
                break
            length *= 0.5
        return there


def _sparse(frames: NDArray[np.intp], rows: NDArray[np.intp], shape: tuple[int, int]) -> "csr_array":
    # Help of commands lists the trainers, and none of it takes scipy's half a second.
    from scipy.sparse import csr_array

    return csr_array((np.ones(len(frames)), (frames, rows)), shape=shape)


def _largest(values: Floats) -> float:
    return max(float(values.max()), -float(values.min()))
