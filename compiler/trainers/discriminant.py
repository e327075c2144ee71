"""Linear discriminants: the most probable class if all have normal inputs with one covariance, which is shrunk.

Inputs are the bits of switches, the codes of joints, and for each joint, if so asked, the bits "the code is above this
edge" of a few edges. Codes are measured in their deviation within a class. Bits keep their unit, so that one which is
rarely set gets a small weight. Those of edges have a larger unit: they only bend what the codes say. The covariance
within classes is shrunk towards independent inputs of equal variance, as far as its uncertainty asks for: O. Ledoit and
M. Wolf, J. Multivariate Anal. 88 (2004). Trials are the pieces of evidence, not frames. So there is neither a penalty
nor a search.

The posterior probabilities of a discriminant are overconfident, the more so the fewer the rows. All scores are
therefore multiplied by one factor: the one with the least log-loss in folds that leave out trials.

All sums are exact, and the equations are solved in one order of operations: equal rows give equal bytes.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.tables import ScoreTables

from ..elementary import Floats, backward, cholesky, exact_sum, forward, log, on_one_grid, softmax_and_loss
from ..samples import TrainingError
from ..workers import check_memory
from .base import MAX_BINS, Report, Setting, Trainer, check_rows
from .logit import ColumnTables, tables_of
from .newton import Column, columns_of

if TYPE_CHECKING:
    from ..samples import Samples

BINS, MOST_BINS = 16, 64  # more take minutes, and are no better
FOLDS = 4
# Factors of the scores: octaves, since half octaves change the log-loss by a percent; one for a single trial.
_FACTORS, _UNKNOWN = tuple(2.0**exponent for exponent in range(-9, 2)), 0.25
# The units of bits, which deviate no further, and of edges; the least one of lines, of which a column spans one or two.
_BIT, _EDGE, _LEAST_DEVIATION = 0.5, 2.0, 2.0**-6
_LEAST_SHARE = 2.0**-13  # of a shrunk covariance: equal inputs share a weight
_MARKS = 1024.0  # no input is more than two, in marks of 1/512


def fit_discriminant(
    X: NDArray[np.generic],
    labels: NDArray[np.intp],
    trials: NDArray[np.intp],
    n_classes: int,
    *,
    max_bins: int | None = None,
    calibrated: bool = True,
) -> ColumnTables:
    """Fit X (n, d) bits and integer codes, labels (n,) in 0..n_classes-1 and trials (n,).

    Columns of more than two values add scores in proportion to them, between minimum and maximum, and rows of at most
    `max_bins` bins that hold rows as evenly as possible; None: no rows. Unless `calibrated`, scores keep the size that
    normal inputs would give them. Raises TrainingError.
    """
    check_rows(X, labels, n_classes, None)
    check_memory(len(X), n_classes, TrainingError, X.shape[1] * (max_bins or 1))
    columns = columns_of(X, None, straight=True)
    bins = columns_of(X, max_bins) if max_bins else columns
    bent = [number for number, column in enumerate(columns) if max_bins and column.line is not None]
    parts = [*map(_inputs, columns), *(_inputs(bins[number]) for number in bent)]
    widths = [part.shape[1] for part in parts]
    inputs = np.hstack([np.empty((len(X), 0)), *parts])
    # The unit of a line is still unknown.
    units = [0.0 if column.line is not None else _BIT for column in columns] + [_EDGE] * (len(parts) - len(columns))
    unit = np.repeat(units, widths)
    bias, weights = _discriminant(inputs, unit, labels, trials, n_classes)
    factor = _factor(inputs, unit, labels, trials, n_classes) if calibrated else 1.0
    shares = np.split(factor * weights, np.cumsum(widths)[:-1])
    tables = tables_of(columns, np.vstack([factor * bias, *shares[: len(columns)]]))
    edges, rows = [*tables.edges], [*tables.rows]
    for number, own in zip(bent, shares[len(columns) :], strict=True):
        # The row of a bin is the sum of the weights of all edges below it.
        edges[number], rows[number] = bins[number].edges, np.cumsum(np.pad(own, ((1, 0), (0, 0))), axis=0)
    return ColumnTables(tables.bias, tuple(edges), tuple(rows), tables.lines)


def _inputs(column: Column) -> Floats:
    """Return the inputs (n, width) of a column: its distance along a line, or whether it is above each edge."""
    if column.line is not None:
        return column.line.steps[:, np.newaxis]
    return (column.bins[:, np.newaxis] > np.arange(len(column.edges))).astype(np.float64)


def _discriminant(
    inputs: Floats, unit: Floats, labels: NDArray[np.intp], trials: NDArray[np.intp], n_classes: int
) -> tuple[Floats, Floats]:
    """Return the bias (K,) and weights (d, K) of the log-probabilities of classes, but for what all have in common."""
    n, counts = len(labels), np.bincount(labels, minlength=n_classes).astype(np.float64)
    seen = counts > 0
    # Sums and products of marks are exact.
    sums, products = (labels == np.arange(n_classes)[:, np.newaxis]).astype(np.float64) @ inputs, inputs.T @ inputs
    for total, count in zip(sums[seen], counts[seen].tolist(), strict=True):
        products -= total[:, np.newaxis] * (total / count)
    centre, means = inputs.sum(axis=0) / n, sums / np.maximum(counts, 1.0)[:, np.newaxis]
    deviations = np.sqrt(np.maximum(products.diagonal(), 0.0) / n)
    unit = np.where(unit > 0, unit, np.maximum(deviations, _LEAST_DEVIATION))
    covariance = products / n / (unit[:, np.newaxis] * unit)
    shrunk = _shrunk(covariance, (inputs - means[labels]) / unit, len(np.unique(trials)))
    moved = np.where(seen[:, np.newaxis], (means - centre) / unit, 0.0)
    lower = cholesky(shrunk)
    weights = backward(lower, forward(lower, moved.T))
    bias = log(np.maximum(counts, 1.0) / n) - 0.5 * _sums(weights.T * moved)
    # Nowhere is a class without rows the most probable: the scores' mean over all rows' classes is no less than this.
    bias[~seen] = bias[seen].min() - 1.0
    weights /= unit[:, np.newaxis]
    bias -= _sums(weights.T * centre)
    # What all classes have in common is no score.
    return bias - _sums(bias[np.newaxis]) / n_classes, weights - _sums(weights)[:, np.newaxis] / n_classes


def _shrunk(covariance: Floats, rest: Floats, n_trials: int) -> Floats:
    """Return a covariance (d, d), estimated from deviations from means (n, d), shrunk towards a multiple of 1."""
    d = len(covariance)
    size = exact_sum(covariance.diagonal()) / max(d, 1)
    if size == 0:
        return np.eye(d)
    squared = exact_sum(covariance * covariance)
    lengths = _sums(rest * rest)
    doubt = (exact_sum(lengths * lengths) / len(rest) - squared) / n_trials
    away = squared - d * size * size
    share = min(1.0, max(_LEAST_SHARE, doubt / away)) if away > 0 else 1.0
    shrunk: Floats = (1.0 - share) * covariance
    shrunk[np.diag_indices(d)] += share * size
    return shrunk


def _sums(values: Floats) -> Floats:
    """Return the sum of each row of `values` (m, d), the same on every machine."""
    total: Floats = on_one_grid(values, values.shape[1]).sum(axis=1)
    return total


def _factor(inputs: Floats, unit: Floats, labels: NDArray[np.intp], trials: NDArray[np.intp], n_classes: int) -> float:
    """Return the factor of the scores with the least log-loss of trials that are left out."""
    _, first, number = np.unique(trials, return_index=True, return_inverse=True)
    if len(first) == 1:
        return _UNKNOWN
    # The trials of a class take turns.
    part = np.argsort(np.argsort(labels[first], kind="stable"))[number] % FOLDS
    scores = np.empty((n_classes, len(labels)))
    for fold in np.unique(part).tolist():
        learnt, left = part != fold, part == fold
        bias, weights = _discriminant(inputs[learnt], unit, labels[learnt], trials[learnt], n_classes)
        # The products of marks with numbers on a grid are exact as well.
        weights = on_one_grid(weights, _MARKS * len(weights))
        scores[:, left] = (inputs[left] @ weights + bias).T
    share = 1.0 / np.bincount(trials)[trials]
    losses = [softmax_and_loss(factor * scores, labels, share)[1] for factor in _FACTORS]
    return _FACTORS[int(np.argmin(losses))]


class Discriminant(Trainer):
    """Linear discriminants of inputs with one shrunk covariance: the most accurate where trials are few."""

    name = "discriminant"
    what = "linear discriminants, for few trials"
    rank = 1
    settings = (Setting("max_bins", MAX_BINS, int, None, 2),)
    drafting = MappingProxyType({"calibrated": False})
    tried = ({"max_bins": None}, {"max_bins": BINS})

    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> ScoreTables:
        """Return the tables. Raises TrainingError for settings that make no sense."""
        given = {**settings, "max_bins": settings["max_bins"] and min(settings["max_bins"], MOST_BINS)}
        tables = fit_discriminant(samples.inputs, samples.labels, samples.movements, samples.n_classes, **given)
        return tables.score_tables(samples.n_switches)


MEMBER = Discriminant()
