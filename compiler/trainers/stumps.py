"""Decision stumps: an ensemble of one per round and class, and the best ones for one round's weights and responses.

A stump's residual sum of squares is sum w z^2 less the explained part, sum over branches C_b^2 / W_b with W_b = sum w
and C_b = sum w z. The first term is the same for every stump, so explained parts are compared: sums of positive terms,
which avoid the cancellation in comparing small residuals.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..elementary import Floats, add_exactly, add_up, on_grids
from .binning import Binned, ManyValued, SplitSums, TwoValued

Place = tuple[TwoValued | ManyValued, int, int]  # group of columns, position in it, split

# A branch with less than this share of its class's weight counts as empty. This is at most 2^13 of the 2^50 to 2^51
# units of the class on the grid; with less, its mean would consist of rounding errors. It is a share, not a number of
# units, so that three copies of a set give the same result as one.
EMPTY_SHARE = 2.0**-38


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
        scores = carry = np.zeros((self.n_classes, len(X)))
        for columns, thresholds, values in zip(self.columns, self.thresholds, self.values, strict=True):
            inputs = X[:, columns].T.astype(np.float64)
            left, right, missing = values.T[:, :, np.newaxis]
            outputs = np.where(inputs <= thresholds[:, np.newaxis], left, right)
            outputs = np.where(np.isnan(inputs), missing, outputs)
            scores, carry = add_exactly(scores, carry, centred(outputs, self.shrinkage))
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
    """Return the contribution of a round to F (K, n), given its stumps' outputs (K, n): LogitBoost's symmetric step.

    f_j = (K - 1)/K * (g_j - mean_k g_k) with g = shrinkage * output (Friedman, Hastie, Tibshirani 2000, algorithm 6).
    The mean over classes is zero except for rounding, K + 6 units of 2^-53 of the largest |g|, so M rounds leave a mean
    of at most M (K + 6) 2^-53 z_max: 1.3e-10 after 10,000 rounds of 33 classes, an eighth of TIE.
    """
    k = len(outputs)
    g = outputs * shrinkage
    return (g - add_up(g) / k) * (k - 1) / k


def spread(outputs: Floats, n_classes: int, shrinkage: float) -> tuple[Floats, Floats]:
    """Return the result of `centred` for outputs (n,) of one stump each if all other outputs are 0: the contributions
    to the stump's own class and to each other class, both (n,), to the last bit.
    """
    g = outputs * shrinkage
    mean = g / n_classes
    return (g - mean) * (n_classes - 1) / n_classes, (0.0 - mean) * (n_classes - 1) / n_classes


class Targets:
    """Weights w and weighted responses w z of one round (K, n), 1 <= |z| <= z_max, and how to sum them exactly."""

    def __init__(self, weights: Floats, responses: Floats) -> None:
        """Put both on grids: coarse ones to compare stumps, and the remainders on fine ones for branch values."""
        self.weights, self._fine_weights = on_grids(weights)
        self.responses, self._fine_responses = on_grids(responses)

    def branch_sums(self, left: Floats, missing: Floats | None) -> tuple[Floats, Floats]:
        """Return sum w and sum w z (3, K) over the rows left, right and missing, in grid units of the weights.

        Each is within two roundings of the exact value on the grids.
        """
        base = self.weights.exponents
        weight, response = (
            coarse.branch_sums(left, missing, base) + fine.branch_sums(left, missing, base)
            for coarse, fine in ((self.weights, self._fine_weights), (self.responses, self._fine_responses))
        )
        return weight, response


@dataclass(frozen=True, slots=True)
class FittedStumps:
    """The stumps of one round, and their outputs on the training rows."""

    columns: NDArray[np.int32]  # (K,)
    thresholds: Floats  # (K,)
    values: Floats  # (K, 3) left, right, missing
    outputs: Floats  # (K, n)


def fit_stumps(binned: Binned, targets: Targets, z_max: float, used: NDArray[np.int64] | None = None) -> FittedStumps:
    """Fit one stump per class. Ties go to the lowest column, then to the lowest threshold. |value| <= z_max.

    With `used` (d,), the number of stumps on each column, ties go to the least used column; the counts are updated.
    """
    columns, splits = _best_splits(binned, targets, z_max, _tie_bound(targets, z_max), used)
    places = [(*binned.home[int(column)], int(split)) for column, split in zip(columns, splits, strict=True)]
    left = np.array([group.goes_left(position, split) for group, position, split in places])
    missing = _missing(places, left.shape)
    values = _branch_values(targets, left, missing, z_max)
    outputs = np.where(left, values[:, :1], values[:, 1:2])
    if missing is not None:
        outputs = np.where(missing, values[:, 2:], outputs)
    thresholds = np.array([group.threshold(position, split) for group, position, split in places])
    return FittedStumps(columns.astype(np.int32), thresholds, values, outputs)


def _missing(places: Sequence[Place], shape: tuple[int, ...]) -> NDArray[np.bool_] | None:
    """Return (K, n) whether the stump's column is missing in a row; None where no value is missing."""
    absent = [group.is_missing(position) for group, position, _ in places]
    if all(rows is None for rows in absent):
        return None
    return np.array([np.zeros(shape[1], dtype=bool) if rows is None else rows for rows in absent])


def _tie_bound(targets: Targets, z_max: float) -> Floats:
    """Return, for each class (K,), the largest difference that grid rounding can cause between equal explained parts.

    Rounding n rows by half a unit each changes C_b and W_b by at most n/2 units, and with |C_b / W_b| <= z_max
    |d(C^2/W)| <= 2 z_max |dC| + z_max^2 |dW|, summed over branches; twice that between two stumps. The 64 covers the
    rounding of the squares and quotients themselves. Units are those of `_explained`.
    """
    n = targets.weights.units.shape[1]
    unit = _unit(targets)
    bound: Floats = (2.0 * z_max * unit + (z_max * unit) ** 2) * n + 64.0
    return bound


def _unit(targets: Targets) -> Floats:
    """Return (K,) the unit of weights, in units of responses."""
    # Without weight nothing is explained, and this unit may exceed the range of doubles.
    apart = np.where(targets.weights.units.any(axis=1), targets.responses.exponents - targets.weights.exponents, 0)
    return np.ldexp(1.0, apart)


def _best_splits(
    binned: Binned, targets: Targets, z_max: float, tie_bound: Floats, used: NDArray[np.int64] | None
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the column and split (K,) that explain most, for each class; ties go to the lowest."""
    n_classes, n = targets.weights.units.shape
    by_row = np.empty((n, 2 * n_classes))
    by_row[:, :n_classes], by_row[:, n_classes:] = targets.weights.units.T, targets.responses.units.T
    totals = by_row.sum(axis=0)
    # Nothing is explained for a class without weight, where at most some responses have not underflown.
    least = np.where(totals[:n_classes] > 0, totals[:n_classes] * EMPTY_SHARE, np.inf)
    explained = np.full((binned.n_columns, n_classes), -np.inf)
    splits = np.zeros((binned.n_columns, n_classes), dtype=np.intp)
    slack = _slack(targets, z_max, least) + tie_bound
    for group in binned.groups:
        if isinstance(group, TwoValued):
            left = group.sums(by_row)
            explained[group.columns] = _shares(left, least) + _shares(totals - left, least)
            continue
        for sums in group.sums(by_row):
            most, base = _roughly_explained(sums, totals, least)
            most += base
            floor = np.maximum(explained.max(axis=0), most.max(axis=0)) - slack
            places, classes = np.nonzero(most >= floor - slack)
            parts = _explained(sums, totals, least, places, classes)
            columns, most = sums.columns[places], parts.max(axis=1)
            explained[columns, classes] = most
            splits[columns, classes] = (parts >= (most - tie_bound[classes])[:, np.newaxis]).argmax(axis=1)
    tied = explained >= explained.max(axis=0) - tie_bound
    columns = tied.argmax(axis=0) if used is None else _least_used(tied, used, len(binned.home))
    return columns, splits[columns, np.arange(n_classes)]


def _least_used(tied: NDArray[np.bool_], used: NDArray[np.int64], varying: int) -> NDArray[np.intp]:
    """Return the least used of the `tied` columns (d, K) for each class, (K,), and count its use."""
    columns: NDArray[np.intp] = tied.argmax(axis=0)
    for k, among in enumerate(tied.T):
        candidates = np.flatnonzero(among)
        # Where all columns tie, none is informative: do not spread thresholds over others because of that.
        if len(candidates) < varying:
            columns[k] = candidates[used[candidates].argmin()]
        used[columns[k]] += 1
    return columns


def _roughly_explained(sums: SplitSums, totals: Floats, least: Floats) -> tuple[Floats, Floats]:
    """Return (c, K) an estimate of the most that a split of each column explains, less a constant, and that constant.

    C_L^2 / W_L + C_R^2 / W_R - C^2 / W = (W C_L - C W_L)^2 / (W W_L W_R) needs one division. It is below the result of
    `_explained` by `_slack` at most.
    """
    K = least.size
    present = totals - sums.missing
    base = _shares(present, least) + _shares(sums.missing, least)
    weight, response = sums.left[:, :K], sums.left[:, K:]
    all_weight, all_response = present[:, :K, np.newaxis], present[:, K:, np.newaxis]
    part = response * all_weight
    other = weight * all_response
    part -= other
    part *= part
    lightest = least[:, np.newaxis]
    np.subtract(all_weight, weight, out=other)
    np.maximum(other, lightest, out=other)
    other *= np.maximum(weight, lightest)
    other *= np.maximum(all_weight, lightest)
    part /= other
    return part.max(axis=2), base


def _slack(targets: Targets, z_max: float, least: Floats) -> Floats:
    """Return (K,) how far the rough estimate may be below `_explained`, in its units.

    With |C_b| <= ratio W_b + r, where r is n rows' half units of both grids (and of the smallest doubles, to which
    products with weights are rounded), a branch below the least weight explains less than ratio^2 least, or at most
    (11 r)^2 / least below W_b = 10 r / ratio. This also covers a branch that only one of the two computations takes as
    empty. The rest is the rounding of doubles: 2^-53 of ratio^2 W some hundred times, where least is 2^-38 W.
    """
    n, exponents = targets.weights.units.shape[1], targets.responses.exponents
    ratio = z_max * _unit(targets)
    rounding = n * (0.5 + 0.5 * ratio + np.ldexp(z_max, exponents - 1074))
    slack: Floats = 32.0 * ratio**2 * least + 4.0 * (11.0 * rounding) ** 2 / least
    return slack


def _explained(
    sums: SplitSums, totals: Floats, least: Floats, places: NDArray[np.intp], classes: NDArray[np.intp]
) -> Floats:
    """Return (S, B) what the splits of some columns explain, for one class each; -inf where there is no split."""
    K = least.size
    pair = np.array([classes, K + classes])
    left = sums.left[places, pair]
    missing = sums.missing[places, pair][..., np.newaxis]
    right = totals[pair][..., np.newaxis] - left
    right -= missing
    lightest = least[classes, np.newaxis]
    parts = _share(left[0], left[1], lightest)
    parts += _share(right[0], right[1], lightest)
    parts += _share(missing[0], missing[1], lightest)
    parts[~sums.is_split[places]] = -np.inf
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
