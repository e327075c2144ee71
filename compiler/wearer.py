"""A build's score tables, changed to fit a few trials of the person who wears the glove.

The change is the minimum of a penalised loss:

    sum over trials of the mean over their frames of -ln P(type)  +  strength/2 * |change|^2

where |.| is the norm of a space of functions of a frame, one for each grasp type. Its kernel is a sum over terms:

    bias    1
    bit     CLOSED if both frames have the switch closed
    bins    ROUGH * exp(-(distance of the bins / NEAR)^2 / 2), with a joint's bins evenly spread over SPAN; the product
            over both joints for a grid
    lines   STEEP * z (R + IDLE * I)^-1 z' over all lines together, z a code in fifths of its range from the middle, R
            the correlations of the joints in the training rows: people differ least in what joints do together

So a change of a bin spreads to its neighbours, and a change of a line is large where the training rows varied least.
The minimum is a sum of kernels at the person's frames, with a weight for each frame and type: the unknowns are as many
as there are frames, whatever the build. Böhning's bound on the curvature (D. Böhning, Ann. Inst. Stat. Math. 44, 1992)
gives steps that never overshoot; Nesterov's momentum shortens the way. Factors of products lie on grids, so the result
is the same on every machine.

A type without trials is changed as the others are on average, and no change is common to all types. On people left out
that recognised more than rows of such types that stay as they were.

A new type, which the tables do not have, starts as a mean of the others, weighted by their probabilities in its trials:
it looks like what it was taken for so far. Then it is changed as the others are, with a pull of 1/FREE.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import SettingError
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.base import Tabulated
from thenar.runtime.model.terms.grid import Grid
from thenar.runtime.model.terms.line import Line

from .elementary import Floats, add_up, backward, cholesky, dot, exp, forward, softmax

# The strength where no people were left out to choose it, and those to choose from.
STRENGTH, STRENGTHS = 1.0, (0.3, 1.0, 3.0, 10.0)
# By the switches of 60 hands (kamakura) 85.2 % are recognised, with two own trials 86.7, with 1 for CLOSED 86.4; of 20
# (crowd) 88.0, 88.8 and 88.4 %. A weight for each switch, by how people differ, was no better: 86.6 and 88.6 %.
CLOSED = 2.0
# Of the trials of 29 people (r2g), each left out, 84.2 % are recognised by lines, with two and five own trials a type
# 89.3 and 92.0 %, without the correlations 88.1 and 90.8 %; by bins 85.5, 88.4 and 90.0 %.
ROUGH, NEAR, SPAN = 0.3, 0.4, 3.5
STEEP, IDLE, _FIFTHS = 0.35, 0.1, 5.0
# Each type once unknown to the others and taught with three own trials, two of the rest: its trials and the rest are
# recognised at 74 and 88 % (kamakura's switches, before 0 and 88), 75 and 88 (crowd's), 85 and 82 (r2g), 70 and 75
# (AML); its own with the whole pull at 67, 70, 85 and 68 %; compiled with everybody's recordings at 21, 22, 2 and 17 %.
FREE = 3
# Frames of a trial that are used, and of all: more would add little, and take time and memory.
_FRAMES, _MOST = 8, 1000
# What a new type without trials has of each other one, so that it still starts as their mean.
_NOTHING = 1e-6
_BITS = 21  # of a factor: products of up to 2^10 rows are exact
_TOLERANCE, _ROUGHLY, _MOST_STEPS = 1e-5, 1e-3, 500

Labels = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Adaptation:
    """The change of score tables to trials of one person.

    Parameters
    ----------
    tables : ScoreTables
        The tables of everybody, with terms of the four kinds.
    bits : ndarray of bool, shape (n, s)
        The kept switches in the person's frames.
    codes : ndarray of uint16, shape (n, j)
        The codes of the kept joints.
    labels : ndarray of int, shape (n,)
        The class of each frame, among the tables' classes and the new ones.
    trials : ndarray of int, shape (n,)
        The trial of each frame. A trial counts once, however many frames it has.
    strength : float
        The pull towards `tables`; infinity allows no change.
    related : sequence of int
        The correlations of the joints in the training rows, in thousandths: the lower triangle of a matrix without its
        diagonal, row by row. Empty: none are known.
    new : range
        The classes that the tables do not have.

    Raises
    ------
    SettingError
        If there are no trials, or more than a thousand.
    """

    tables: ScoreTables
    bits: NDArray[np.bool_]
    codes: NDArray[np.uint16]
    labels: Labels
    trials: Labels
    strength: float = STRENGTH
    related: Sequence[int] = ()
    new: range = range(0)
    _rows: Labels = field(init=False)

    def __post_init__(self) -> None:
        names, trial = np.unique(self.trials, return_inverse=True)
        if not len(names):
            raise SettingError("there are no trials to adapt to: record some of each type")
        if len(names) > _MOST:
            raise SettingError(f"{len(names)} trials of one person: adapt to at most {_MOST}, or compile a build")
        if not self.strength > 0:
            raise SettingError(f"a strength of {self.strength}: it must be above 0")
        frames = np.bincount(trial)
        place = np.empty(len(trial), np.intp)
        place[np.argsort(trial, kind="stable")] = np.concatenate([np.arange(count) for count in frames])
        most = np.minimum(frames, max(1, min(_FRAMES, _MOST // len(names))))[trial]
        rows = np.flatnonzero((place + 1) * most // frames[trial] > place * most // frames[trial])
        # In an order that depends on the frames alone, so that nothing else depends on that of the recordings.
        keys = np.column_stack([self.codes, self.bits, self.labels, frames[trial]])[rows]
        object.__setattr__(self, "_rows", rows[np.lexsort(keys.T)])

    @property
    def everything(self) -> NDArray[np.bool_]:
        """A mask of all frames that are used."""
        return np.ones(len(self._rows), bool)

    @cached_property
    def adapted(self) -> ScoreTables:
        """The changed tables: the same switches, joints, thresholds and kinds of terms."""
        if math.isinf(self.strength):
            return self._start(self.everything)
        return self._changed(self._weights(self._fitted, self.everything), self.everything)

    @cached_property
    def left_out(self) -> Floats:
        """The scores (n, K) of each frame by tables that are adapted to all other trials."""
        scores = self._start(self.everything).scores(self.bits, self.codes)
        names = np.unique(self.trials)
        for name in names if len(names) > 1 and not math.isinf(self.strength) else ():
            kept, tested = self.trials[self._rows] != name, self.trials == name
            weights = self._weights(self._minimum(kept, self._fitted * kept[:, np.newaxis], _ROUGHLY), kept)
            scores[tested] = self._changed(weights, kept).scores(self.bits[tested], self.codes[tested])
        return scores

    @property
    def contradictions(self) -> dict[tuple[int, ...], set[int]]:
        """The classes of each frame that has several, and the trials with such a frame, counted from 0."""
        frames, trial = np.column_stack([self.bits, self.codes]), np.unique(self.trials, return_inverse=True)[1]
        number = np.unique(frames, axis=0, return_inverse=True)[1].ravel()
        found = dict[tuple[int, ...], set[int]]()
        for frame in np.flatnonzero(np.bincount(number) > 1):
            classes = tuple(np.unique(self.labels[number == frame]).tolist())
            if len(classes) > 1:
                found.setdefault(classes, set()).update(trial[number == frame].tolist())
        return dict(sorted(found.items()))

    def shares(self, kept: NDArray[np.bool_]) -> Floats:
        """Return the mean probabilities of the tables' classes in the `kept` trials of each new one, (k, m)."""
        some = self._rows
        counts = np.equal.outer(self.labels[some], self.new) * self._roots**2 * kept[:, np.newaxis]
        probabilities = softmax(np.ascontiguousarray(self.tables.scores(self.bits[some], self.codes[some]).T))
        shares = _product(probabilities, counts) + _NOTHING
        return shares / add_up(shares)

    def with_new(self, rows: Floats, shares: Floats) -> Floats:
        """Return rows (..., k) of the tables' classes with columns of the new ones, means with these shares."""
        columns = _product(rows.reshape(-1, rows.shape[-1]), shares).reshape(*rows.shape[:-1], len(self.new))
        return np.insert(rows, [self.new.start] * len(self.new), columns, axis=-1)

    def _start(self, kept: NDArray[np.bool_]) -> ScoreTables:
        """Return the tables with the new types, before any change."""
        if not self.new:
            return self.tables
        shares, terms = self.shares(kept), []
        for term in self.tables.core_terms:
            name = "rows" if isinstance(term, Tabulated) else "row"
            rows = self.with_new(getattr(term, name), shares)
            terms.append(replace(term, **{name: rows}))  # type: ignore[type-var]
        return ScoreTables(self.with_new(self.tables.bias, shares), tuple(terms))

    @cached_property
    def _gains(self) -> Floats:
        """The factor (K,) of each type's kernel."""
        gains = np.ones(self.tables.n_classes + len(self.new))
        gains[self.new] = FREE
        return gains

    @cached_property
    def _lines(self) -> tuple[Line, ...]:
        return self.tables.lines

    @cached_property
    def _near(self) -> list[tuple[Tabulated, Floats, Labels]]:
        """The kernel of each tabulated term between its cells and the frames (C, n), and the cell of each frame."""
        found = list[tuple[Tabulated, Floats, Labels]]()
        for term in (*self.tables.bins, *self.tables.grids):
            if term.n_rows > 1:
                near, cells = np.full((1, len(self._rows)), ROUGH), np.zeros(len(self._rows), np.intp)
                for joint, steps in zip(term.inputs, term.steps, strict=True):
                    bins = np.searchsorted(steps, self.codes[self._rows, joint])
                    away = (np.arange(len(steps) + 1)[:, np.newaxis] - bins) * (SPAN / NEAR / max(1, len(steps)))
                    near = (near[:, np.newaxis] * exp(-0.5 * away * away)).reshape(-1, len(bins))
                    cells = cells * (len(steps) + 1) + bins
                found.append((term, _rounded(near), cells))
        return found

    @cached_property
    def _triangle(self) -> Floats:
        """The lower triangular L (l, l) with L L^T the correlations of the lines' joints, plus IDLE."""
        correlations = np.eye(self.tables.n_joints)
        if len(self.related):
            correlations[np.tril_indices(self.tables.n_joints, -1)] = np.array(self.related) / 1000
        joints = [line.joint for line in self._lines]
        return cholesky(correlations[np.ix_(joints, joints)] + IDLE * np.eye(len(joints)))

    @cached_property
    def _steep(self) -> Floats:
        """The features (n, l) of the lines: the dot product of two frames' is their kernel."""
        places = np.zeros((len(self._lines), len(self._rows)))
        for number, line in enumerate(self._lines):
            above = line.parts(self.codes[self._rows, line.joint])[1][:, 0]
            places[number] = (above / (line.high - line.low) - 0.5) * _FIFTHS * math.sqrt(STEEP)
        return forward(self._triangle, places).T

    @cached_property
    def _kernel(self) -> Floats:
        """The kernel (n, n) of the frames."""
        bits = self.bits[self._rows].astype(np.float64)
        kernel = 1.0 + CLOSED * (bits @ bits.T) + _product(self._steep, self._steep.T)
        for _, near, cells in self._near:
            kernel += near[cells]
        return _rounded(kernel)

    @cached_property
    def _roots(self) -> Floats:
        """The square roots (n, 1) of the frames' weights, one divided by the used frames of the trial."""
        _, trial = np.unique(self.trials[self._rows], return_inverse=True)
        roots: Floats = np.sqrt(1.0 / np.bincount(trial))[trial, np.newaxis]
        return roots

    @cached_property
    def _inverse(self) -> Floats:
        """The inverse (n, n) of the bound on the curvature."""
        one = np.eye(len(self._rows))
        lower = cholesky(0.5 * self._gains.max() * self._kernel * self._roots * self._roots.T + self.strength * one)
        return backward(lower, forward(lower, one))

    @cached_property
    def _fitted(self) -> Floats:
        return self._minimum(self.everything, np.zeros((len(self._rows), len(self._gains))), _TOLERANCE)

    def _minimum(self, kept: NDArray[np.bool_], start: Floats, tolerance: float) -> Floats:
        """Return the weights (n, K) at the minimum for the `kept` frames, divided by the roots of the frames' own."""
        rows, roots, counted = self._rows, self._roots, self._roots * kept[:, np.newaxis]
        scores = self._start(kept).scores(self.bits[rows], self.codes[rows])
        truth = np.equal.outer(self.labels[rows], np.arange(len(self._gains))).astype(np.float64)
        kernel, inverse = _rounded(self._kernel), _rounded(self._inverse)  # once, not in each of the products below
        now = ahead = start
        age = 1.0
        for _ in range(_MOST_STEPS):
            shares = softmax(np.ascontiguousarray((scores + kernel @ _rounded(roots * ahead) * self._gains).T)).T
            slope = counted * (shares - truth) + self.strength * ahead
            if np.abs(slope).max() <= tolerance:
                break
            following = ahead - inverse @ _rounded(slope)
            older, age = age, (1 + math.sqrt(1 + 4 * age * age)) / 2
            if dot(ahead - following, following - now) > 0:
                older = age = 1.0  # the momentum leads uphill: start it again
            ahead, now = following + (older - 1) / age * (following - now), following
        return ahead

    def _weights(self, minimum: Floats, kept: NDArray[np.bool_]) -> Floats:
        """Return the weights (n, K) of the kernels in the change of each type's scores."""
        weights = _rounded(minimum * self._roots * kept[:, np.newaxis]) * self._gains
        known = np.setdiff1d(self.labels[self._rows[kept]], self.new)
        if len(known):
            missing = np.setdiff1d(np.arange(len(self._gains)), [*known, *self.new])
            weights[:, missing] = _mean(weights[:, known])[:, np.newaxis]
        return weights - _mean(weights)[:, np.newaxis]

    def _changed(self, weights: Floats, kept: NDArray[np.bool_]) -> ScoreTables:
        """Return the start from the `kept` frames plus a sum of kernels with these weights (n, K)."""
        tables = self._start(kept)
        ones = np.ones((1, len(weights)))
        bias = tables.bias + _product(ones, weights)[0]
        closed = self.bits[self._rows].T.astype(np.float64)
        switch_rows = tables.switch_rows + CLOSED * _product(closed, weights)
        near = {term.inputs: near for term, near, _ in self._near}
        rows = {
            term: term.rows + _product(near[term.inputs], weights).reshape(term.rows.shape)
            for term in (*tables.bins, *tables.grids)
            if term.inputs in near
        }
        slopes = backward(self._triangle, _product(self._steep.T, weights)) * math.sqrt(STEEP) * _FIFTHS
        further = []
        for line, slope in zip(tables.lines, slopes.reshape(-1, tables.n_classes), strict=True):
            bias = bias - slope / 2
            further.append(Line(line.joint, line.low, line.high, line.row + slope / (line.high - line.low)))
        grids = [Grid(grid.joints, grid.thresholds, rows.get(grid, grid.rows)) for grid in tables.grids]
        joint_rows = [rows.get(bins, bins.rows) for bins in tables.bins]
        return tables.changed(bias=bias, switch_rows=switch_rows, joint_rows=joint_rows, further=[*further, *grids])


def correlations(codes: NDArray[np.uint16]) -> tuple[int, ...]:
    """Return the correlations of joints, codes (n, j), as `Adaptation` takes them."""
    some = codes[:: max(1, len(codes) >> 20)].astype(np.float64)
    # Differences of codes are integers, and so are sums of their products, below 2^53: exact in any order.
    apart = some - np.rint(np.array([math.fsum(column) for column in some.T]) / len(some))
    sums = apart.T @ apart
    spread = np.sqrt(np.maximum(np.diagonal(sums), 1.0))
    thousandths = np.rint(1000 * (sums / spread) / spread[:, np.newaxis])
    return tuple(thousandths[np.tril_indices(len(sums), -1)].astype(int).tolist())


def _mean(columns: Floats) -> Floats:
    """Return the mean (n,) over the columns (n, k), added in their order."""
    mean: Floats = add_up(columns.T) / columns.shape[1]
    return mean


def _product(one: Floats, other: Floats) -> Floats:
    """Return the product of matrices (m, n) and (n, k), rounded to grids on which every sum is exact."""
    product: Floats = _rounded(one) @ _rounded(other)
    return product


def _rounded(values: Floats) -> Floats:
    """Return values of any shape, rounded to _BITS bits of the largest."""
    grid = 2.0 ** (_BITS - math.frexp(float(np.abs(values).max(initial=0.0)))[1])
    rounded: Floats = np.rint(values * grid) / grid
    return rounded
