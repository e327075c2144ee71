"""Decision stumps: an ensemble of one per round and class, and the best ones for one round's weights and responses.

Several training sets of as many rows are fitted side by side: on few rows, numpy's calls take longer than its sums.

A stump's residual sum of squares is sum w z^2 less the explained part, sum over branches C_b^2 / W_b with W_b = sum w
and C_b = sum w z. The first term is the same for every stump, so explained parts are compared: sums of positive terms,
which avoid the cancellation in comparing small residuals.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..elementary import Floats, OnGrid, add_exactly, add_up, on_grids
from .binning import Binned, SplitSums

# A branch with less than this share of its class's weight counts as empty. This is at most 2^13 of the 2^50 to 2^51
# units of the class on the grid; with less, its mean would consist of rounding errors. It is a share, not a number of
# units, so that three copies of a set give the same result as one.
EMPTY_SHARE = 2.0**-38
# Elements of the outputs of several rounds that are computed together: 256 KiB of doubles.
_STAGED_ELEMENTS = 1 << 15


@dataclass(frozen=True, slots=True, eq=False)
class Stumps:
    """M rounds of K stumps over inputs (n, n_inputs). A stump sends x <= threshold left, x > threshold right, NaN to
    neither.
    """

    n_inputs: int
    columns: NDArray[np.int32]  # (M, K) which input
    thresholds: Floats  # (M, K)
    values: Floats  # (M, K, 3) outputs left, right, and where the input is missing
    shrinkage: float
    stopped_early: bool = False  # a tolerance ended the training

    @property
    def n_rounds(self) -> int:
        """Number M of rounds."""
        return len(self.columns)

    @property
    def n_classes(self) -> int:
        """Number K of classes."""
        return int(self.columns.shape[1])

    def first(self, rounds: int) -> "Stumps":
        """Return the ensemble of the first rounds: further rounds never change earlier ones."""
        return Stumps(
            self.n_inputs, self.columns[:rounds], self.thresholds[:rounds], self.values[:rounds], self.shrinkage
        )

    def staged_scores(self, X: NDArray[np.generic]) -> Iterator[Floats]:
        """Yield the scores F (n, K) after each round, for inputs (n, n_inputs); every array yielded is a new one."""
        if X.ndim != 2 or X.shape[1] != self.n_inputs:
            raise ValueError(f"inputs have shape {X.shape}, the ensemble expects (n, {self.n_inputs})")
        if not len(self.columns) == len(self.thresholds) == len(self.values):
            raise ValueError("columns, thresholds and values are of different numbers of rounds")
        scores = carry = np.zeros((self.n_classes, len(X)))
        several = max(1, _STAGED_ELEMENTS // max(1, scores.size))
        for start in range(0, self.n_rounds, several):
            rounds = slice(start, start + several)
            inputs = X.T[self.columns[rounds].T].astype(np.float64)
            left, right, missing = self.values[rounds].T[..., np.newaxis]
            outputs = np.where(inputs <= self.thresholds[rounds].T[..., np.newaxis], left, right)
            outputs = np.where(np.isnan(inputs), missing, outputs)
            for contribution in centred(outputs, self.shrinkage).swapaxes(0, 1):
                scores, carry = add_exactly(scores, carry, contribution)
                yield (scores + carry).T

    @property
    def magnitude(self) -> float:
        """The sum of the magnitudes that are added up."""
        return float(2 * self.shrinkage * np.abs(self.values[:, :, :2]).max(axis=(1, 2)).sum())

    def scores(self, *columns: NDArray[np.generic]) -> Floats:
        """Return the scores F (n, K) of inputs (n, n_inputs), or of switches (n, s) and codes (n, j)."""
        X = np.hstack(columns)
        scores = np.zeros((len(X), self.n_classes))
        for stage in self.staged_scores(X):
            scores = stage
        return scores


def centred(outputs: Floats, shrinkage: float) -> Floats:
    """Return the contribution of rounds to F, given their stumps' outputs (K, ...): LogitBoost's symmetric step.

    f_j = (K - 1)/K * (g_j - mean_k g_k) with g = shrinkage * output (Friedman, Hastie, Tibshirani 2000, algorithm 6).
    The mean over classes is zero except for rounding, K + 6 units of 2^-53 of the largest |g|, so M rounds leave a mean
    of at most M (K + 6) 2^-53 z_max: 1.3e-10 after 10,000 rounds of 33 classes, an eighth of TIE.
    """
    k = len(outputs)
    g = outputs * shrinkage
    g -= add_up(g) / k
    g *= k - 1
    g /= k
    return g


def spread(outputs: Floats, n_classes: int, shrinkage: float) -> tuple[Floats, Floats]:
    """Return the result of `centred` for outputs (n,) of one stump each if all other outputs are 0: the contributions
    to the stump's own class and to each other class, both (n,), to the last bit.
    """
    g = outputs * shrinkage
    mean = g / n_classes
    return (g - mean) * (n_classes - 1) / n_classes, (0.0 - mean) * (n_classes - 1) / n_classes


class Targets:
    """Weights w and weighted responses w z of one round (K, n), 1 <= |z| <= z_max, and how to sum them exactly.

    With several training sets, K counts the classes of each, in the order of classes, then sets.
    """

    def __init__(self, weights: Floats, responses: Floats) -> None:
        """Put both on grids: coarse ones to compare stumps, and the remainders on fine ones for branch values."""
        K = len(weights)
        self.both, self._fine = on_grids(np.concatenate([weights, responses]))
        self.weights = OnGrid(self.both.units[:K], self.both.exponents[:K])
        self.responses = OnGrid(self.both.units[K:], self.both.exponents[K:])

    def branch_sums(self, left: Floats, missing: Floats | None) -> tuple[Floats, Floats]:
        """Return sum w and sum w z (3, K) over the rows left, right and missing, in grid units of the weights.

        Each is within two roundings of the exact value on the grids.
        """
        base = np.concatenate([self.weights.exponents] * 2)
        sums = self.both.branch_sums(left, missing, base) + self._fine.branch_sums(left, missing, base)
        return sums[:, : len(left)], sums[:, len(left) :]


@dataclass(frozen=True, slots=True)
class FittedStumps:
    """The stumps of one round, and their outputs on the training rows; K counts classes as in `Targets`."""

    columns: NDArray[np.int32]  # (K,)
    thresholds: Floats  # (K,)
    values: Floats  # (K, 3) left, right, missing
    outputs: Floats  # (K, n)


def fit_stumps(sets: Sequence[Binned], targets: Targets, z_max: float) -> FittedStumps:
    """Fit one stump per class. Ties go to the lowest column, then to the lowest threshold. |value| <= z_max.

    `sets` have as many rows each, and targets of as many classes.
    """
    units, totals, bounds = targets.both.units, targets.both.units.sum(axis=1), _tie_bound(targets, z_max)
    columns, splits = np.empty((2, len(bounds)), dtype=np.intp)
    for number, binned in enumerate(sets):
        its = slice(number, None, len(sets))
        columns[its], splits[its] = _best_splits(binned, units[its], totals[its], bounds[its])
    numbers = zip(columns.tolist(), splits.tolist(), strict=True)
    chosen = [(sets[row % len(sets)].columns[column], split) for row, (column, split) in enumerate(numbers)]
    left = np.empty(targets.weights.units.shape, dtype=np.bool_)
    for row, (column, split) in zip(left, chosen, strict=True):
        np.less_equal(column.bins, split, out=row)
    missing = np.array([column.missing for column, _ in chosen]) if any(column.lacks for column, _ in chosen) else None
    values = _branch_values(targets, left, missing, z_max)
    outputs = np.where(left, values[:, :1], values[:, 1:2])
    if missing is not None:
        outputs = np.where(missing, values[:, 2:], outputs)
    thresholds = np.array([column.edges.item(split) for column, split in chosen])
    return FittedStumps(columns.astype(np.int32), thresholds, values, outputs)


def _tie_bound(targets: Targets, z_max: float) -> Floats:
    """Return, for each class (K,), the largest difference that grid rounding can cause between equal explained parts.

    Rounding n rows by half a unit each changes C_b and W_b by at most n/2 units, and with |C_b / W_b| <= z_max
    |d(C^2/W)| <= 2 z_max |dC| + z_max^2 |dW|, summed over branches; twice that between two stumps. The 64 covers the
    rounding of the squares and quotients themselves. Units are those of `_explained`.
    """
    weights = targets.weights
    # The unit of weights in units of responses. Without weight nothing is explained, and it may be beyond all doubles.
    unit = np.ldexp(1.0, np.where(weights.units.any(axis=1), targets.responses.exponents - weights.exponents, 0))
    bound: Floats = (2.0 * z_max * unit + (z_max * unit) ** 2) * weights.units.shape[1] + 64.0
    return bound


def _best_splits(
    binned: Binned, units: Floats, totals: Floats, tie_bound: Floats
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the column and split (K,) that explain most, for each class; ties go to the lowest.

    `units` (2K, n) are the weights and weighted responses on their grids, `totals` (2K,) their sums.
    """
    n_classes = len(tie_bound)
    by_row = np.ascontiguousarray(units.T)
    # Nothing is explained for a class without weight, where at most some responses have not underflown.
    least = np.where(totals[:n_classes] > 0, totals[:n_classes] * EMPTY_SHARE, np.inf)
    explained = np.full((binned.n_columns, n_classes), -np.inf)
    splits = np.zeros((binned.n_columns, n_classes), dtype=np.intp)
    if len(binned.two.columns):
        left = binned.two.sums(by_row)
        explained[binned.two.columns] = _shares(left, least) + _shares(totals - left, least)
    for sums in binned.many.sums(by_row):
        parts = _explained(sums, totals, least)
        most = parts.max(axis=2)
        explained[sums.columns] = most
        splits[sums.columns] = (parts >= (most - tie_bound)[..., np.newaxis]).argmax(axis=2)
    columns = (explained >= explained.max(axis=0) - tie_bound).argmax(axis=0)
    return columns, splits[columns, np.arange(n_classes)]


def _explained(sums: SplitSums, totals: Floats, least: Floats) -> Floats:
    """Return (c, K, B) what the splits of some columns explain; -inf where there is no split."""
    K = least.size
    right = totals[:, np.newaxis] - sums.left
    if sums.missing is not None:
        right -= sums.missing[..., np.newaxis]
    lightest = least[:, np.newaxis]
    parts = _share(sums.left[:, :K], sums.left[:, K:], lightest)
    parts += _share(right[:, :K], right[:, K:], lightest)
    if sums.missing is not None:
        parts += _shares(sums.missing, least)[..., np.newaxis]
    np.copyto(parts, -np.inf, where=~sums.is_split[:, np.newaxis])
    return parts


def _shares(sums: Floats, least: Floats) -> Floats:
    return _share(sums[..., : least.size], sums[..., least.size :], least)


def _share(weight: Floats, response: Floats, least: Floats) -> Floats:
    # Below the least weight that counts, this is smaller than what the branch explains, and close to zero.
    part: Floats = response * response
    part /= np.maximum(weight, least)
    return part


def _branch_values(
    targets: Targets, left: NDArray[np.bool_], missing: NDArray[np.bool_] | None, z_max: float
) -> Floats:
    """Return (K, 3): the weighted mean response of every branch; an empty one gets the mean of all rows."""
    absent = None if missing is None else missing.astype(np.float64)
    weight, response = targets.branch_sums(left.astype(np.float64), absent)
    total = weight.sum(axis=0)
    empty = weight < total * EMPTY_SHARE
    weight = np.where(empty, total, weight)
    response = np.where(empty, response.sum(axis=0), response)
    values = np.divide(response, weight, out=np.zeros_like(response), where=weight > 0)
    clamped: Floats = np.clip(values, -z_max, z_max).T
    return clamped
