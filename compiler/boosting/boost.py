"""The rounds of multi-class LogitBoost on decision stumps (Friedman, Hastie, Tibshirani 2000; Weka 3.6's choices).

Where Weka's result depends on rounding, thenar uses a numerically stable rule instead (docs/project/weka-parity.md):
sums are exact (exactsums), a branch with almost no weight counts as empty, and branch outputs are clipped to +-z_max.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError

from ..elementary import add_exactly, softmax_and_loss
from ..workers import check_memory
from .binning import TwoValued, bin_columns
from .stumpfit import Targets, fit_stumps
from .stumps import Stumps, centred

Floats = NDArray[np.float64]

# Ties are counted on a grid whose units grow with the square of z_max: far above this, all stumps would tie.
LARGEST_Z_MAX = 100.0
# Close to 32 MiB, the largest value that glibc respects.
_LARGE_BYTES = 31 << 20
TIES = ("first", "least-used")
# Far below this, all scores of a hundred rounds would lie within the tolerance of a tie (stumps.TIE).
SMALLEST_SHRINKAGE = 1e-6


class BoostingError(ThenarError, ValueError):
    """An invalid training set, or an invalid option of a fit to it."""


def boost(
    X: NDArray[np.generic],
    labels: NDArray[np.intp],
    n_classes: int,
    *,
    rounds: int = 100,
    shrinkage: float = 1.0,
    z_max: float = 3.0,
    tolerance: float | None = None,
    weights: Floats | None = None,
    max_bins: int | None = None,
    ties: str = "first",
    on_round: Callable[[int, int], None] | None = None,
) -> tuple[Stumps, tuple[float, ...]]:
    """Train `rounds` rounds on X (n, d) numbers (NaN: missing), labels (n,) in 0..n_classes-1, weights (n,) >= 0.

    Stops early where the mean log-likelihood changes by less than `tolerance` in a round (Weka's -L; None: never), or
    where no column varies. With `max_bins` (2 or more) columns have at most that many bins, which hold rows as evenly
    as possible. Between stumps that explain the same, `ties` takes the lowest column ("first", Weka's rule), or the one
    that the fewest stumps have used so far ("least-used"). `on_round(done, rounds)` is called after every round.

    Return the ensemble, and the losses before the first round and after every round: the mean of -ln P(true class).
    Raises BoostingError.
    """
    _check_options(rounds, shrinkage, z_max, tolerance, max_bins, ties)
    check_rows(X, labels, n_classes, weights)
    if weights is not None:
        # Scale by a power of two, which changes no result: sums of huge weights stay finite, of tiny ones exact.
        weights = np.ldexp(weights, -np.frexp(weights.max())[1])
    binned = bin_columns(X, max_bins)
    many = sum(len(group.columns) for group in binned.groups if not isinstance(group, TwoValued))
    check_memory(len(X), n_classes, BoostingError, len(binned.home) - many, many)
    # glibc returns freed memory above twice the largest array ever freed to the system, and faults it in again.
    np.empty(_LARGE_BYTES, dtype=np.uint8)
    member = labels == np.arange(n_classes)[:, np.newaxis]
    scores = carry = np.zeros((n_classes, len(X)))
    probability, loss = softmax_and_loss(scores, labels, weights)
    losses = [loss]
    used = np.zeros(X.shape[1], dtype=np.int64) if ties == "least-used" else None
    fitted: list[tuple[NDArray[np.int32], Floats, Floats]] = []
    stopped = False
    while len(fitted) < rounds and binned.groups and not stopped:
        targets = Targets(*weights_and_responses(probability, member, z_max, weights))
        stumps = fit_stumps(binned, targets, z_max, used)
        # Drop the outputs: with a million rows they would take a hundred megabytes a round.
        fitted.append((stumps.columns, stumps.thresholds, stumps.values))
        scores, carry = add_exactly(scores, carry, centred(stumps.outputs, shrinkage))
        probability, loss = softmax_and_loss(scores + carry, labels, weights)
        losses.append(loss)
        stopped = tolerance is not None and abs(losses[-2] - losses[-1]) < tolerance
        if on_round is not None:
            on_round(len(fitted), rounds)
    return _stack(fitted, X.shape[1], n_classes, shrinkage, stopped), tuple(losses)


def weights_and_responses(
    probability: Floats, member: NDArray[np.bool_], z_max: float, row_weights: Floats | None
) -> tuple[Floats, Floats]:
    """Return w and w z (K, n) for P (K, n): z = 1/P or -1/(1 - P) within +-z_max, w z = Y - P."""
    complement = 1.0 - probability
    own = np.where(member, probability, complement)
    other = np.where(member, complement, probability)  # |Y - P|
    sizes = other if row_weights is None else other * row_weights
    # |z| = min(1/own, z_max), so w = |Y - P| / |z| = |Y - P| * max(own, 1/z_max): no division, hence none by zero.
    return sizes * np.maximum(own, 1.0 / z_max), np.where(member, sizes, -sizes)


def _stack(
    fitted: list[tuple[NDArray[np.int32], Floats, Floats]], n_inputs: int, n_classes: int, shrinkage: float, early: bool
) -> Stumps:
    rounds = len(fitted)
    return Stumps(
        n_inputs,
        np.array([columns for columns, _, _ in fitted], dtype=np.int32).reshape(rounds, n_classes),
        np.array([thresholds for _, thresholds, _ in fitted]).reshape(rounds, n_classes),
        np.array([values for _, _, values in fitted]).reshape(rounds, n_classes, 3),
        shrinkage,
        early,
    )


def _check_options(
    rounds: int, shrinkage: float, z_max: float, tolerance: float | None, max_bins: int | None, ties: str
) -> None:
    if ties not in TIES:
        raise BoostingError(f"ties={ties!r} must be one of {', '.join(TIES)}")
    if rounds < 1:
        raise BoostingError(f"rounds={rounds} must be at least 1")
    if max_bins is not None and max_bins < 2:
        raise BoostingError(f"max_bins={max_bins} must be at least 2: a single bin carries no information")
    if not SMALLEST_SHRINKAGE <= shrinkage <= 1:
        raise BoostingError(f"shrinkage={shrinkage} must be at least {SMALLEST_SHRINKAGE:g} and at most 1")
    if not 1 < z_max <= LARGEST_Z_MAX:
        raise BoostingError(f"z_max={z_max} must be above 1 and at most {LARGEST_Z_MAX:g}")
    if tolerance is not None and not 0 <= tolerance < math.inf:
        raise BoostingError(
            f"tolerance={tolerance} must be a change of the loss of at least 0; leave it out to train all rounds"
        )


def check_rows(X: NDArray[np.generic], labels: NDArray[np.intp], n_classes: int, weights: Floats | None) -> None:
    """Raise BoostingError unless these arguments form a valid training set."""
    if X.ndim != 2 or len(X) == 0 or labels.shape != (len(X),):
        raise BoostingError(f"inputs {X.shape} and labels {labels.shape} must be (n, d) and (n,) with at least one row")
    if labels.min() < 0 or labels.max() >= n_classes:
        raise BoostingError(f"labels run from {labels.min()} to {labels.max()}, classes from 0 to {n_classes - 1}")
    if weights is not None:
        check_weights(weights, len(X))
    if X.dtype.kind == "f" and np.isinf(X).any():
        row, column = np.argwhere(np.isinf(X))[0]
        raise BoostingError(f"row {row}, column {column} is infinite; a joint angle is finite or NaN for missing")


def check_weights(weights: Floats, n: int) -> None:
    """Raise BoostingError unless these are valid weights of n rows."""
    if weights.shape != (n,) or not (np.isfinite(weights).all() and (weights >= 0).all() and weights.any()):
        raise BoostingError("row weights must be (n,) finite, non-negative numbers, not all zero")
