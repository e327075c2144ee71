"""The additive multinomial logit: all score tables fitted at once, as the unique minimum of a convex function.

A column of two values is one row of scores, added at the upper value; any other has a row for each of its bins, and one
for missing values, if there are any. Over the rows W (r, K), the first of which is the bias, this is minimised:

    sum over frames i of u_i (log sum_k exp F_ik - F_iy)  +  1/2 sum over rows j of pull_j |W_j|^2
        + 1/2 smoothness * (sum of |W_j+1 - W_j|^2 over neighbouring bins j and j + 1 of a column),      F = D W

with u the frames' weights and D (n, r) the bits that say which rows count in a frame. As every row has a pull there is
one minimum, and it is finite, even if classes are perfectly separable or a class has no frames. Newton's method finds
it: H V = -gradient is solved by conjugate gradients to a share of the gradient (Nocedal and Wright, Numerical
Optimization, 2nd ed., algorithm 7.1). Factors of products with D are rounded to a grid first, on which all sums are
exact, so the result depends neither on the order of frames nor on the machine. Columns as lines have multiples of a
mark in place of bits.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.base import HIGHEST_CODE, Floats
from thenar.runtime.model.terms.line import Line

from ..boosting.binning import bin_columns
from ..boosting.boost import BoostingError, check_rows
from ..boosting.exactsums import dot, exact_sum, on_one_grid
from ..elementary import add_up, softmax_and_loss
from ..workers import check_memory

if TYPE_CHECKING:
    from scipy.sparse import csr_array

BINS = 16
PENALTY, SMOOTHNESS = 0.5, 2.0
# As shares of the penalty: the pull on each bin, which its neighbours hold already, and on the bias, to keep it finite.
BIN_SHARE, BIAS_SHARE = 2.0**-4, 2.0**-10
# No derivative of the loss is larger than this at the solution, relative to the total weight of the frames.
TOLERANCE, FINEST = 1e-7, 1e-12
# Limits of Newton steps, of conjugate gradients per step, and of halvings of a step: far more than were ever needed.
_MOST_STEPS, _MOST_DIRECTIONS, _MOST_HALVINGS = 500, 2000, 40
_ENOUGH = 1e-4  # of the slope, for Armijo's rule
_ROUNDING = 2.0**-50  # of the loss, per entry of the rows: a smaller increase may be a rounding error
_MARKS = 512.0  # marks per unit of a line, whose column spans one or two units
_NO_CHANCE = 800.0  # below all scores: exp is exactly 0 there
_UNSOLVED = 0.3  # of the gradient that a step may leave


class Rise(NamedTuple):
    """A column's line: row (K,) times (x - low), x between low and high."""

    low: float
    high: float
    row: Floats


@dataclass(frozen=True, slots=True, eq=False)
class ColumnTables:
    """F_k(x) = bias_k + sum over columns of rows[column][bin, k], for columns of any numbers, NaN for missing.

    bias   (K,)
    edges  for each column, ascending (B - 1,): the bin of x is the number of edges below it
    rows   for each column (B + 1, K), the last one for a missing value
    lines  for some columns, an additional contribution in proportion to x
    """

    bias: Floats
    edges: tuple[Floats, ...]
    rows: tuple[Floats, ...]
    lines: Mapping[int, Rise] = field(default_factory=dict)

    def scores(self, X: NDArray[np.generic]) -> Floats:
        """Return F (n, K) of X (n, d)."""
        scores = np.tile(self.bias, (len(X), 1))
        for column, (edges, rows) in enumerate(zip(self.edges, self.rows, strict=True)):
            x = np.asarray(X[:, column], np.float64)
            scores += rows[_bins(x, edges)]
            if column in self.lines:
                low, high, row = self.lines[column]
                scores += (np.clip(np.nan_to_num(x, nan=low), low, high) - low)[:, np.newaxis] * row
        return scores

    def columns(self, order: Sequence[int]) -> "ColumnTables":
        """Return the tables of the columns in another order."""
        edges, rows = (tuple(part[column] for column in order) for part in (self.edges, self.rows))
        return ColumnTables(
            self.bias, edges, rows, {at: self.lines[c] for at, c in enumerate(order) if c in self.lines}
        )

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
        lines = (Line(column - n_switches, int(low), int(high), row) for column, (low, high, row) in self.lines.items())
        return ScoreTables.of(bias, switch_rows, thresholds, joint_rows, [*lines])


def fit_logit(
    X: NDArray[np.generic],
    labels: NDArray[np.intp],
    n_classes: int,
    *,
    penalty: float = PENALTY,
    smoothness: float = SMOOTHNESS,
    max_bins: int | None = BINS,
    linear: bool = False,
    tolerance: float = TOLERANCE,
    weights: Floats | None = None,
    counted: int = 0,
    held: NDArray[np.bool_] | None = None,
) -> ColumnTables:
    """Fit X (n, d) numbers (NaN: missing), labels (n,) in 0..n_classes-1, weights (n,) >= 0.

    `penalty` pulls rows towards zero, `smoothness` pulls those of neighbouring bins towards each other. Columns have at
    most `max_bins` bins (2 or more; None: one for each value) that hold frames as evenly as possible. With `linear` a
    column of more than two values adds scores in proportion to them, between minimum and maximum, and `smoothness`
    pulls the contribution of one standard deviation. The number of set bits among the first `counted` columns adds
    scores as well, with the weak pull of a bin, so that their common effect is learned at once. Frames in `held` (n,)
    are known not to be of the last class, which learns nothing from them. No derivative of the loss is larger at the
    solution than `tolerance` times the sum of weights. Raises BoostingError.
    """
    if not (0 < penalty < math.inf and 0 <= smoothness < math.inf):
        raise BoostingError(f"penalty={penalty} must be above 0, and smoothness={smoothness} at least 0, both finite")
    if max_bins is not None and max_bins < 2:
        raise BoostingError(f"max_bins={max_bins} must be at least 2: a single bin carries no information")
    if not FINEST <= tolerance < 1:
        raise BoostingError(f"tolerance={tolerance} must be at least {FINEST:g} and below 1")
    check_rows(X, labels, n_classes, weights)
    check_memory(len(X), n_classes, BoostingError, *X.shape[1:])
    scale = 1.0
    if weights is not None:
        # Scale by a power of two, which changes no result: sums of huge weights stay finite, of tiny ones exact.
        scale = float(np.ldexp(1.0, -np.frexp(weights.max())[1]))
        weights = on_one_grid(weights * scale, len(X))
    heavy = np.ones(len(X)) if weights is None else weights
    columns = columns_of(X, max_bins, weights, heavy if linear else None)
    count = count_of(columns[:counted], heavy)
    pulls = penalty * scale, smoothness * scale
    rows = Fit([*columns, *count], labels, n_classes, *pulls, weights, held).minimum(tolerance)
    return tables_of(columns, spread_out(columns, rows, count), heavy)


def count_of(columns: Sequence["Column"], weights: Floats) -> list["Column"]:
    """Return a list with a column that counts the set bits of `columns`; an empty list if the count adds no
    information.

    `weights` (n,) are those of frames.
    """
    bits = [column.bins for column in columns if column.counts]
    number: Floats = np.add.reduce(bits, axis=0).astype(np.float64) if len(bits) > 1 else np.zeros(1)
    if number.min() == number.max():
        return []
    return [Column(np.zeros(0), np.zeros(len(number), np.intp), 0, _Ruler.of(number, weights), free=True)]


def spread_out(columns: Sequence["Column"], rows: Floats, count: Sequence["Column"]) -> Floats:
    """Return rows of `columns` that include the contribution of their count, the last column."""
    if not count or count[0].line is None:
        return rows
    ruler, rows, each = count[0].line, rows[:-1].copy(), rows[-1] / count[0].line.unit
    rows[0] -= (ruler.low + ruler.unit * ruler.centre) * each
    starts = 1 + np.cumsum([0, *(column.n_rows for column in columns[:-1])])
    rows[[start for start, column in zip(starts.tolist(), columns, strict=True) if column.counts]] += each
    return rows


def tables_of(columns: Sequence["Column"], rows: Floats, held: Floats) -> ColumnTables:
    """Return the rows (r, K) of a minimum as tables; `held` (n,) are the frames' weights."""
    bias, *parts = np.split(rows, np.cumsum([1, *(column.n_rows for column in columns[:-1])])) if columns else [rows]
    bias, tables, lines = bias[0], [], {}
    for number, (column, own) in enumerate(zip(columns, parts, strict=True)):
        if column.line is not None:
            bias = bias - column.line.centre * own[0]
            lines[number] = Rise(column.line.low, column.line.high, own[0] / column.line.unit)
        tables.append(column.table(own, held))
    return ColumnTables(bias, tuple(column.edges for column in columns), tuple(tables), lines)


@dataclass(frozen=True, slots=True, eq=False)
class _Ruler:
    """A column measured in units from low, rounded to marks: centre + steps (n,); 0 steps where it is missing."""

    low: float
    high: float
    unit: float
    mean: float
    centre: float
    steps: Floats
    variance: float

    @classmethod
    def of(cls, x: Floats, weights: Floats) -> "_Ruler":
        """Return the ruler for numbers (n,), at least two of which differ, NaN for missing."""
        there = ~np.isnan(x)
        low, high = float(np.min(x[there])), float(np.max(x[there]))
        if not math.isfinite(high - low):
            raise BoostingError(f"a column from {low} to {high} is too wide for a line: scale it")
        # A power of two, so that integers within a range below 1024 lie on marks.
        unit = math.ldexp(1.0, math.frexp(high - low)[1] - 1)
        places = _marked(np.where(there, (x - low) / unit, 0.0))
        heavy = weights * there
        mean = dot(heavy, places) / exact_sum(heavy)
        centre = float(_marked(np.array(mean)))
        steps = np.where(there, places - centre, 0.0)
        return cls(low, high, unit, mean, centre, steps, dot(heavy, steps * steps) / exact_sum(heavy))


def _marked(units: Floats) -> Floats:
    marked: Floats = np.rint(units * _MARKS) / _MARKS
    return marked


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column of frames: its edges, the bin (n,) of each frame, the last for missing, and the first bin with a row.

    A line has one row instead of its only bin. For two columns together, bins number the `cells` row by row, each with
    a row, and `smoothness` pulls neighbours in both directions. `smoothness` does not pull a `free` line.
    """

    edges: Floats
    bins: NDArray[np.intp]
    first: int
    line: _Ruler | None = None
    cells: tuple[int, int] | None = None
    smoothness: float = 0.0
    free: bool = False

    @property
    def counts(self) -> bool:
        """Whether it is a bit that is set in some frames but not in all."""
        return self.first == 1 and len(self.edges) == 1

    @property
    def n_rows(self) -> int:
        """The number of its rows."""
        return math.prod(self.cells) if self.cells else int(self.bins.max()) + 1 - self.first

    def entries(self) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
        """Return the frames, rows and values of the column's entries in the design, each (entries,)."""
        values = (self.bins >= self.first).astype(np.float64)
        if self.line is not None:
            values = np.where(self.bins == 0, self.line.steps, values)
        frames = np.flatnonzero(values)
        return frames, self.bins[frames] - self.first, values[frames]

    def pulls(self, penalty: float, smoothness: float) -> Floats:
        """Return the pull (rows,) on each row."""
        pulls = np.full(self.n_rows, penalty if self.first else BIN_SHARE * penalty)
        if self.line is not None:
            pulls[0] = (pulls[0] + (0.0 if self.free else smoothness)) * self.line.variance
        return pulls

    def table(self, rows: Floats, weights: Floats) -> Floats:
        """Return the contribution of each bin and of a missing value: if none was seen, the mean over the frames."""
        table = np.vstack([np.zeros((self.first, rows.shape[1])), rows])
        if self.line is not None:
            table[0] = 0.0
            table[1:] += self.line.centre * rows[0]
        if len(table) == len(self.edges) + 2:
            return table
        shares = np.bincount(self.bins, weights) / weights.sum()
        mean = add_up(shares[:, np.newaxis] * table) if self.line is None else self.line.mean * rows[0]
        return np.vstack([table, mean])


def columns_of(
    X: NDArray[np.generic], max_bins: int | None, weights: Floats | None, straight: Floats | None
) -> list[Column]:
    """Return the columns; those of more than two values as lines, if their weights (n,) are given as `straight`."""
    columns = []
    for number, edges in enumerate(column_edges(X, max_bins, weights)):
        x = np.asarray(X[:, number], np.float64)
        bins = _bins(x, edges)
        # A single bin is redundant with the bias, and one of two bins with the other.
        if bins.max() < 2:
            columns.append(Column(edges, bins, 1))
        elif straight is None or not len(edges):
            columns.append(Column(edges, bins, 0))
        else:
            columns.append(Column(np.zeros(0), np.isnan(x).astype(np.intp), 0, _Ruler.of(x, straight)))
    return columns


def column_edges(X: NDArray[np.generic], max_bins: int | None, weights: Floats | None = None) -> list[Floats]:
    """Return the edges of each column's bins; none for a column without splits."""
    binned, found = bin_columns(X, max_bins, weights), []
    for number in range(X.shape[1]):
        group, position = binned.home.get(number, (None, 0))
        splits = range(group.n_splits(position)) if group is not None else ()
        found.append(np.array([group.threshold(position, split) for split in splits if group is not None], np.float64))
    return found


def _bins(x: Floats, edges: Floats) -> NDArray[np.intp]:
    """Return the bin (n,) of each number, the number of edges below it; NaN gets the bin after the last."""
    bins: NDArray[np.intp] = np.searchsorted(edges, x) + np.isnan(x)
    return bins


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """Rows W (r, K), with their probabilities (n, K), loss and gradient (r, K)."""

    rows: Floats
    probability: Floats
    loss: float
    gradient: Floats


class Fit:
    """The loss of rows W (r, K), and its minimum. Sums over frames, and all that decide a branch, are exact.

    The rows are the bias, then those of each column.
    """

    def __init__(
        self,
        columns: Sequence[Column],
        labels: NDArray[np.intp],
        n_classes: int,
        penalty: float,
        smoothness: float,
        weights: Floats | None,
        held: NDArray[np.bool_] | None = None,
    ) -> None:
        n, self._labels, self._weights, self._known = len(labels), labels, weights, held
        self._member = (labels[:, np.newaxis] == np.arange(n_classes)).astype(np.float64)
        self._total = float(n if weights is None else weights.sum())
        self._grids: list[tuple[int, int, tuple[int, int], float]] = []
        frames, rows, values = [np.arange(n)], [np.zeros(n, np.intp)], [np.ones(n)]
        pull, joined, start = [np.array([BIAS_SHARE * penalty])], [np.zeros(0, np.intp)], 1
        for column in columns:
            own_frames, own_rows, own_values = column.entries()
            frames.append(own_frames)
            rows.append(start + own_rows)
            values.append(own_values)
            pull.append(column.pulls(penalty, smoothness))
            if column.cells:
                self._grids.append((start, start + column.n_rows, column.cells, column.smoothness))
            elif column.first == 0:
                joined.append(np.arange(start, start + len(column.edges)))
            start += column.n_rows
        self._design = sparse(np.concatenate(values), np.concatenate(frames), np.concatenate(rows), (n, start))
        self._by_row = self._design.T.tocsr()
        self._squares = self._by_row * self._by_row
        # Bounds on the sums over a frame's values and over a row's values, in units of which they are multiples.
        marks = _MARKS if any(column.line for column in columns) else 1.0
        self._across, self._down = (float(abs(each).sum(axis=1).max()) * marks for each in (self._design, self._by_row))
        self._pull = np.concatenate(pull)[:, np.newaxis]
        self._joint = np.zeros((start - 1, 1))
        self._joint[np.concatenate(joined)] = smoothness
        ends = np.pad(self._joint, ((1, 1), (0, 0)))
        self._stiffness = self._pull + ends[1:] + ends[:-1]
        for first, last, cells, between in self._grids:
            neighbours = [np.minimum(np.arange(count), 1) + np.minimum(np.arange(count)[::-1], 1) for count in cells]
            self._stiffness[first:last] += between * np.add.outer(*neighbours).reshape(-1, 1)

    def minimum(self, tolerance: float, near: Floats | None = None) -> Floats:
        """Return the rows at which no derivative exceeds `tolerance` times the total weight of the frames.

        near  starting values for the first of the rows
        """
        rows = np.zeros((len(self._pull), self._member.shape[1]))
        if near is not None:
            rows[: len(near)] = near
        point = self._at(rows)
        wanted = tolerance * self._total
        for _ in range(_MOST_STEPS):
            steep = _largest(point.gradient)
            if steep <= wanted:
                return point.rows
            point = self._along(point, self._direction(point, max(_UNSOLVED * steep, 0.5 * wanted)))
        raise BoostingError(
            f"no minimum was found in {_MOST_STEPS} steps: the penalty is too small for such unequal weights"
        )

    def _at(self, rows: Floats) -> _Point:
        # Put the point on the grid, so that its loss is that of its rows to the last digits.
        rows = on_one_grid(rows, self._across)
        scores = self._design @ rows
        if self._known is not None:
            scores[self._known, -1] = scores.min() - _NO_CHANCE
        shares, mean = softmax_and_loss(np.ascontiguousarray(scores.T), self._labels, self._weights)
        probability, held = np.ascontiguousarray(shares.T), self._held(rows)
        gradient = self._over_frames(probability - self._member) + held
        return _Point(rows, probability, mean * self._total + 0.5 * dot(rows, held), gradient)

    def _held(self, rows: Floats) -> Floats:
        """Return the gradient of the penalties, (r, K)."""
        held, stepped = self._pull * rows, self._joint * (rows[1:] - rows[:-1])
        held[1:] += stepped
        held[:-1] -= stepped
        for first, last, cells, between in self._grids:
            block, more = (part[first:last].reshape(*cells, -1) for part in (rows, held))
            down, across = between * (block[1:] - block[:-1]), between * (block[:, 1:] - block[:, :-1])
            more[1:] += down
            more[:-1] -= down
            more[:, 1:] += across
            more[:, :-1] -= across
        return held

    def residuals(self, rows: Floats) -> tuple[Floats, Floats]:
        """Return the excess of the probabilities at these rows over the labels, (n, K), and their variance."""
        p = self._at(rows).probability
        return p - self._member, p * (1.0 - p)

    def _over_frames(self, values: Floats) -> Floats:
        """Return the weighted sums (r, K) of `values` (n, K), which are overwritten, over the frames of each row."""
        if self._weights is not None:
            values *= self._weights[:, np.newaxis]
        summed: Floats = self._by_row @ on_one_grid(values, self._down)
        return summed

    def _bent(self, rows: Floats, probability: Floats) -> Floats:
        """Return the product (r, K) of the Hessian at these probabilities with rows (r, K)."""
        moved = self._design @ on_one_grid(rows, self._across)
        moved *= probability
        moved = on_one_grid(moved, moved.shape[1])
        moved -= probability * moved.sum(axis=1, keepdims=True)
        return self._over_frames(moved) + self._held(rows)

    def _direction(self, point: _Point, unsolved: float) -> Floats:
        """Return V with H V = -gradient up to `unsolved`, by conjugate gradients preconditioned with H's diagonal."""
        p = point.probability
        spread = p * (1.0 - p) if self._weights is None else p * (1.0 - p) * self._weights[:, np.newaxis]
        diagonal = self._squares @ on_one_grid(spread, self._down * _MARKS) + self._stiffness
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
        """Return a point along the direction with sufficient decrease: the whole step, a half, a quarter ..."""
        slope, length = dot(direction, point.gradient), 1.0
        noise = _ROUNDING * direction.size * point.loss
        for _ in range(_MOST_HALVINGS):
            there = self._at(point.rows + length * direction)
            if there.loss <= point.loss + _ENOUGH * length * slope + noise:
                break
            length *= 0.5
        return there


def sparse(values: Floats, frames: NDArray[np.intp], rows: NDArray[np.intp], shape: tuple[int, int]) -> "csr_array":
    """Return a sparse matrix with these values at these frames and rows."""
    # Imported late: the help of commands lists the trainers and should not load scipy, which takes half a second.
    from scipy.sparse import csr_array

    return csr_array((values, (frames, rows)), shape=shape)


def _largest(values: Floats) -> float:
    return max(float(values.max()), -float(values.min()))
