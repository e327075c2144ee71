"""Columns of frames as rows of scores, and the minimum of their penalised loss, by Newton's method.

A column of two values is one row of scores, added at the upper value; any other has a row for each of its bins. Over
the rows W (r, K), the first of which is the bias, this is minimised:

    sum over frames i of log sum_k exp F_ik - F_iy  +  1/2 sum over rows j of pull_j |W_j|^2
        + 1/2 smoothness * (sum of |W_j+1 - W_j|^2 over neighbouring bins j and j + 1 of a column),      F = D W

with D (n, r) the bits that say which rows count in a frame. As every row has a pull there is one minimum, and it is
finite, even if classes are perfectly separable or a class has no frames. Newton's method finds it: H V = -gradient is
solved by conjugate gradients to a share of the gradient (Nocedal and Wright, Numerical Optimization, 2nd ed., algorithm
7.1). Factors of products with D are rounded to a grid first, on which all sums are exact, so the result depends neither
on the order of frames nor on the machine. Columns as lines have multiples of a mark in place of bits.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from pickle import dumps
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..elementary import Floats, dot, exact_sum, on_one_grid, softmax_and_loss
from ..samples import TrainingError
from .binning import bin_columns

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# As shares of the penalty: the pull on each bin, which its neighbours hold already, and on the bias, to keep it finite.
BIN_SHARE, BIAS_SHARE = 2.0**-4, 2.0**-10
# No derivative of the loss is larger than this at the solution, relative to the number of frames.
TOLERANCE = 1e-7
# In comparisons this is enough: the accuracies are the same, in half the steps.
DRAFT = {"tolerance": 1e-4}
# Limits of Newton steps, of conjugate gradients per step, and of halvings of a step: far more than were ever needed.
_MOST_STEPS, _MOST_DIRECTIONS, _MOST_HALVINGS = 500, 2000, 40
_ENOUGH = 1e-4  # of the slope, for Armijo's rule
_ROUNDING = 2.0**-50  # of the loss, per entry of the rows: a smaller increase may be a rounding error
_MARKS = 512.0  # marks per unit of a line, whose column spans one or two units
_NO_CHANCE = 800.0  # below all scores: exp is exactly 0 there
_MOST_CELLS = 256  # of several columns together
_UNSOLVED = 0.3  # of the gradient that a step may leave


@dataclass(frozen=True, slots=True, eq=False)
class Ruler:
    """A column measured in units from low, rounded to marks: centre + steps (n,)."""

    low: float
    high: float
    unit: float
    centre: float
    steps: Floats
    variance: float

    @classmethod
    def of(cls, x: Floats) -> "Ruler":
        """Return the ruler for numbers (n,), at least two of which differ."""
        low, high = float(x.min()), float(x.max())
        if not math.isfinite(high - low):
            raise TrainingError(f"a column from {low} to {high} is too wide for a line: scale it")
        # A power of two, so that integers within a range below 1024 lie on marks.
        unit = math.ldexp(1.0, math.frexp(high - low)[1] - 1)
        places = _marked((x - low) / unit)
        centre = float(_marked(np.array(exact_sum(places) / len(x))))
        steps = places - centre
        return cls(low, high, unit, centre, steps, exact_sum(steps * steps) / len(x))


def _marked(units: Floats) -> Floats:
    marked: Floats = np.rint(units * _MARKS) / _MARKS
    return marked


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column of frames: its edges, the bin (n,) of each frame, and the first bin with a row.

    A line has one row instead of its only bin. For two columns together, bins number the `cells` row by row, each with
    a row, and `smoothness` pulls neighbours in both directions. `smoothness` does not pull a `free` line.
    """

    edges: Floats
    bins: NDArray[np.intp]
    first: int
    line: Ruler | None = None
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
        return math.prod(self.cells) if self.cells else len(self.edges) + 1 - self.first

    def pulls(self, penalty: float, smoothness: float) -> Floats:
        """Return the pull (rows,) on each row."""
        pulls = np.full(self.n_rows, penalty if self.first else BIN_SHARE * penalty)
        if self.line is not None:
            pulls[0] = (pulls[0] + (0.0 if self.free else smoothness)) * self.line.variance
        return pulls


def columns_of(X: NDArray[np.generic], max_bins: int | None, *, straight: bool = False) -> list[Column]:
    """Return the columns; if `straight`, those of more than two values as lines."""
    columns, binned, constant = [], bin_columns(X, max_bins).columns, np.zeros(len(X), np.intp)
    for number in range(X.shape[1]):
        column = binned.get(number)
        edges, bins = (np.zeros(0), constant) if column is None else (column.edges, column.bins.astype(np.intp))
        # A single bin is redundant with the bias, and one of two bins with the other.
        if len(edges) < 2:
            columns.append(Column(edges, bins, 1))
        elif not straight:
            columns.append(Column(edges, bins, 0))
        else:
            ruler = Ruler.of(np.asarray(X[:, number], np.float64))
            columns.append(Column(np.zeros(0), constant, 0, ruler))
    return columns


# The last minima, by the digests of their fits: trainers share fits, and rejection repeats those of inner folds.
MINIMA: dict[bytes, Floats] = {}
_MOST_MINIMA = 64


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """Rows W (r, K), with their probabilities (n, K), loss and gradient (r, K)."""

    rows: Floats
    probability: Floats
    loss: float
    gradient: Floats


class Fit:
    """The loss of rows W (r, K), and its minimum. Sums over frames, and all that decide a branch, are exact.

    The rows are the bias, then those of each column. Entries that are not `free` (r, K) stay 0; None: all are free.
    """

    def __init__(
        self,
        columns: Sequence[Column],
        labels: NDArray[np.intp],
        n_classes: int,
        penalty: float,
        smoothness: float,
        held: NDArray[np.bool_] | None = None,
        free: NDArray[np.bool_] | None = None,
    ) -> None:
        n, self._labels, self._known = len(labels), labels, held
        self._member = (labels[:, np.newaxis] == np.arange(n_classes)).astype(np.float64)
        self._free, self._grids = free, list[tuple[int, int, tuple[int, int], float]]()
        pull, joined, start = [np.array([BIAS_SHARE * penalty])], [np.zeros(0, np.intp)], 1
        for column in columns:
            pull.append(column.pulls(penalty, smoothness))
            if column.cells:
                self._grids.append((start, start + column.n_rows, column.cells, column.smoothness))
            elif column.first == 0:
                joined.append(np.arange(start, start + len(column.edges)))
            start += column.n_rows
        self._cells, self._shared = _factors([Column(np.zeros(0), np.zeros(n, np.intp), 0), *columns])
        self._by_cell, self._by_row = self._cells.T.tocsr(), self._shared.T.tocsr()
        self._squares = self._by_cell * self._by_cell
        # Bounds on the sums over a frame's values and over a row's values, in units of which they are multiples.
        marks = _MARKS if any(column.line for column in columns) else 1.0
        self._across = float((abs(self._cells) @ self._shared.sum(axis=1)).max()) * marks
        self._down = float((self._by_row @ abs(self._by_cell).sum(axis=1)).max()) * marks
        self._pull = np.concatenate(pull)[:, np.newaxis]
        self._joint = np.zeros((start - 1, 1))
        self._joint[np.concatenate(joined)] = smoothness
        ends = np.pad(self._joint, ((1, 1), (0, 0)))
        self._stiffness = self._pull + ends[1:] + ends[:-1]
        for first, last, cells, between in self._grids:
            neighbours = [np.minimum(np.arange(count), 1) + np.minimum(np.arange(count)[::-1], 1) for count in cells]
            self._stiffness[first:last] += between * np.add.outer(*neighbours).reshape(-1, 1)

    def minimum(self, tolerance: float, near: Floats | None = None) -> Floats:
        """Return the rows at which no derivative exceeds `tolerance` times the number of frames, read-only.

        near  starting values for the first of the rows
        """
        design = [part for each in (self._cells, self._shared) for part in (each.data, each.indices, each.indptr)]
        targets = self._labels, self._member.shape, self._known
        given = self._pull, self._joint, self._grids, self._free, tolerance, near
        asked = blake2b(dumps((design, targets, given))).digest()
        if asked in MINIMA:
            return MINIMA[asked]
        rows = np.zeros((len(self._pull), self._member.shape[1]))
        if near is not None:
            rows[: len(near)] = near
        point = self._at(rows)
        wanted = tolerance * len(self._labels)
        for _ in range(_MOST_STEPS):
            steep = float(np.abs(point.gradient).max())
            if steep <= wanted:
                point.rows.setflags(write=False)
                MINIMA[asked] = point.rows
                if len(MINIMA) > _MOST_MINIMA:
                    del MINIMA[next(iter(MINIMA))]
                return point.rows
            point = self._along(point, self._direction(point, max(_UNSOLVED * steep, 0.5 * wanted)))
        raise TrainingError(f"no minimum was found in {_MOST_STEPS} steps: the penalty is too small")

    def _at(self, rows: Floats) -> _Point:
        # Put the point on the grid, so that its loss is that of its rows to the last digits.
        rows = on_one_grid(rows, self._across)
        scores = self._cells @ (self._shared @ rows)
        if self._known is not None:
            scores[self._known, -1] = scores.min() - _NO_CHANCE
        shares, mean = softmax_and_loss(np.ascontiguousarray(scores.T), self._labels, None)
        probability, held = np.ascontiguousarray(shares.T), self._held(rows)
        gradient = self._over_frames(probability - self._member) + held
        if self._free is not None:
            gradient *= self._free
        return _Point(rows, probability, mean * len(self._labels) + 0.5 * dot(rows, held), gradient)

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
        """Return the sums (r, K) of `values` (n, K) over the frames of each row."""
        summed: Floats = self._by_row @ (self._by_cell @ on_one_grid(values, self._down))
        return summed

    def _bent(self, rows: Floats, probability: Floats) -> Floats:
        """Return the product (r, K) of the Hessian at these probabilities with rows (r, K)."""
        moved = self._cells @ (self._shared @ on_one_grid(rows, self._across))
        moved *= probability
        moved = on_one_grid(moved, moved.shape[1])
        # Exact, and three times as fast as sum().
        moved -= probability * np.einsum("ij->i", moved)[:, np.newaxis]
        bent = self._over_frames(moved) + self._held(rows)
        if self._free is not None:
            bent *= self._free
        return bent

    def _direction(self, point: _Point, unsolved: float) -> Floats:
        """Return V with H V = -gradient up to `unsolved`, by conjugate gradients preconditioned with H's diagonal."""
        p = point.probability
        spread = on_one_grid(p * (1.0 - p), self._down * _MARKS)
        diagonal = self._by_row @ (self._squares @ spread) + self._stiffness
        found, rest = np.zeros_like(point.rows), -point.gradient
        near = rest / diagonal
        along, size = near, dot(rest, near)
        for _ in range(_MOST_DIRECTIONS):
            bent = self._bent(along, p)
            length = size / dot(along, bent)
            found += length * along
            rest -= length * bent
            if np.abs(rest).max() <= unsolved:
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


def _factors(columns: Sequence[Column]) -> tuple["csr_array", "csr_array"]:
    """Return matrices (n, cells) and (cells, r), whose product, the design (n, r), has many more entries.

    Frames with the same bins in several neighbouring columns share a cell of these columns; a line has one cell.
    """
    firsts, starts = np.array([column.first for column in columns]), np.cumsum([0, *(c.n_rows for c in columns)])
    bins = np.array([column.bins for column in columns])
    groups: list[tuple[NDArray[np.intp], list[int]]] = []
    for number, (each, last) in enumerate(zip(columns, bins.max(axis=1).tolist(), strict=True)):
        if groups and each.line is None and columns[groups[-1][1][0]].line is None:
            cell = _numbered(groups[-1][0] * (last + 1) + bins[number])
            if cell.max() < _MOST_CELLS:
                groups[-1] = cell, [*groups[-1][1], number]
                continue
        groups.append((_numbered(bins[number]), [number]))
    places, values, inside, rows, used = [], [], [], [], 0
    for cell, numbers in groups:
        line, frame = columns[numbers[0]].line, np.zeros(int(cell.max()) + 1, np.intp)
        frame[cell] = np.arange(len(cell))
        places.append(used + cell)
        values.append(np.ones(len(cell)) if line is None else line.steps)
        at = bins[numbers][:, frame] - firsts[numbers, np.newaxis]
        column, place = np.nonzero(at >= 0)
        inside.append(used + place)
        rows.append(starts[numbers][column] + at[column, place])
        used += len(frame)
    frames = np.repeat(np.arange(bins.shape[1]), len(groups))
    cells = sparse(np.column_stack(values).ravel(), frames, np.column_stack(places).ravel(), (bins.shape[1], used))
    counted = np.concatenate(inside)
    return cells, sparse(np.ones(len(counted)), counted, np.concatenate(rows), (used, int(starts[-1])))


def _numbered(values: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the number of each of the values (n,) >= 0 among those that occur."""
    occurs = np.zeros(int(values.max()) + 1, np.bool_)
    occurs[values] = True
    return (np.cumsum(occurs) - 1)[values]


def sparse(values: Floats, frames: NDArray[np.intp], rows: NDArray[np.intp], shape: tuple[int, int]) -> "csr_array":
    """Return a sparse matrix with these values at these frames and rows."""
    # Imported late: the help of commands lists the trainers and should not load scipy, which takes half a second.
    from scipy.sparse import csr_array

    return csr_array((values, (frames, rows)), shape=shape)
