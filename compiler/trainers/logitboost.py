"""LogitBoost on decision stumps, the paper's trainer (Friedman, Hastie, Tibshirani 2000; Weka 3.6's choices).

Where Weka's result depends on rounding, thenar uses a numerically stable rule instead (docs/project/weka-parity.md):
sums are exact (elementary), a branch with almost no weight counts as empty, and branch outputs are clipped to +-z_max.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..elementary import Floats, add_exactly, softmax, softmax_and_loss
from ..samples import TrainingError
from ..workers import check_memory
from .base import MAX_BINS, Number, Report, Setting, Trainer, check_rows
from .binning import Binned, bin_columns
from .stumps import Stumps, Targets, centred, fit_stumps

if TYPE_CHECKING:
    from ..samples import Samples

# Columns, thresholds and values of a round's stumps.
_Round = tuple[NDArray[np.int32], Floats, Floats]

# Ties are counted on a grid whose units grow with the square of z_max: far above this, all stumps would tie.
LARGEST_Z_MAX = 100.0
# Far below this, all scores of a hundred rounds would lie within the tolerance of a tie (tables.TIE).
SMALLEST_SHRINKAGE = 1e-6


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
    on_round: Callable[[int, int], None] | None = None,
    with_losses: bool = True,
) -> tuple[Stumps, tuple[float, ...]]:
    """Train `rounds` rounds on X (n, d) numbers (NaN: missing), labels (n,) in 0..n_classes-1, weights (n,) >= 0.

    Stops early where the mean log-likelihood changes by less than `tolerance` in a round (Weka's -L; None: never), or
    where no column varies. With `max_bins` (2 or more) columns have at most that many bins, which hold rows as evenly
    as possible. `on_round(done, rounds)` is called after every round.

    Return the ensemble, and the losses before the first round and after every round: the mean of -ln P(true class).
    They take a sixth of the time; without `with_losses`, they are computed for a tolerance only. Raises TrainingError.
    """
    _check_options(rounds, shrinkage, z_max, tolerance, max_bins)
    check_rows(X, labels, n_classes, weights)
    if weights is not None:
        # Scale by a power of two, which changes no result: sums of huge weights stay finite, of tiny ones exact.
        weights = np.ldexp(weights, -np.frexp(weights.max())[1])
    binned = bin_columns(X, max_bins)
    check_memory(len(X), n_classes, TrainingError, len(binned.two.columns), len(binned.many.columns))
    losses: list[float] = []

    def shares(scores: Floats) -> Floats:
        if not with_losses and tolerance is None:
            return softmax(scores)
        probability, loss = softmax_and_loss(scores, labels, weights)
        losses.append(loss)
        return probability

    fitted: list[_Round] = []
    stopped = False
    member = labels == np.arange(n_classes)[:, np.newaxis]
    for stumps in _rounds([binned], member, rounds if binned.columns else 0, shrinkage, z_max, weights, shares):
        fitted.append(stumps)
        stopped = tolerance is not None and abs(losses[-2] - losses[-1]) < tolerance
        if on_round is not None:
            on_round(len(fitted), rounds)
        if stopped:
            break
    return _stack(fitted, [binned], n_classes, shrinkage, stopped)[0], tuple(losses)


def boost_together(
    sets: Sequence[tuple[NDArray[np.generic], NDArray[np.intp]]],
    n_classes: int,
    *,
    rounds: int = 100,
    shrinkage: float = 1.0,
    z_max: float = 3.0,
    max_bins: int | None = None,
) -> list[Stumps]:
    """Return the ensembles that `boost` returns for each X (n, d) and its labels (n,), to the last bit.

    All sets have n rows. With few rows, this takes less than half the time.
    """
    _check_options(rounds, shrinkage, z_max, None, max_bins)
    for X, labels in sets:
        check_rows(X, labels, n_classes, None)
    check_memory(sum(len(X) for X, _ in sets), n_classes, TrainingError)
    binned = [bin_columns(X, max_bins) for X, _ in sets]
    member = np.concatenate([labels for _, labels in sets]) == np.arange(n_classes)[:, np.newaxis]
    return _stack([*_rounds(binned, member, rounds, shrinkage, z_max, None, softmax)], binned, n_classes, shrinkage)


def _rounds(
    sets: Sequence[Binned],
    member: NDArray[np.bool_],
    rounds: int,
    shrinkage: float,
    z_max: float,
    weights: Floats | None,
    shares: Callable[[Floats], Floats],
) -> Iterator[_Round]:
    """Yield the columns, thresholds and values of each round of stumps: K classes of F sets of n rows, side by side.

    member  (K, F n): the classes of rows; weights: (F n,), None for 1
    shares  returns the probabilities (K, F n) for scores (K, F n), before the first round and after every one
    """
    scores = carry = np.zeros(member.shape)
    probability = shares(scores)
    by_set = len(member) * len(sets), -1
    for _ in range(rounds):
        wanted = weights_and_responses(probability, member, z_max, weights)
        stumps = fit_stumps(sets, Targets(*(values.reshape(by_set) for values in wanted)), z_max)
        scores, carry = add_exactly(scores, carry, centred(stumps.outputs.reshape(member.shape), shrinkage))
        probability = shares(scores + carry)
        # Without the outputs: with a million rows they would take a hundred megabytes a round.
        yield stumps.columns, stumps.thresholds, stumps.values


def weights_and_responses(
    probability: Floats, member: NDArray[np.bool_], z_max: float, row_weights: Floats | None
) -> tuple[Floats, Floats]:
    """Return w and w z (K, n) for P (K, n): z = 1/P or -1/(1 - P) within +-z_max, w z = Y - P."""
    complement = 1.0 - probability
    responses = np.where(member, complement, -probability)
    if row_weights is not None:
        responses *= row_weights
    # |z| = min(1/own, z_max), so w = |Y - P| / |z| = |Y - P| * max(own, 1/z_max): no division, hence none by zero.
    weights = np.maximum(np.where(member, probability, complement), 1.0 / z_max)
    weights *= np.abs(responses)
    return weights, responses


def _stack(
    fitted: Sequence[_Round], sets: Sequence[Binned], n_classes: int, shrinkage: float, early: bool = False
) -> list[Stumps]:
    """Return the ensemble of each set."""
    shape = len(fitted), n_classes, len(sets)
    columns = np.array([columns for columns, _, _ in fitted], dtype=np.int32).reshape(shape)
    thresholds = np.array([thresholds for _, thresholds, _ in fitted]).reshape(shape)
    values = np.array([values for _, _, values in fitted]).reshape(*shape, 3)
    return [
        Stumps(binned.n_columns, columns[..., at], thresholds[..., at], values[:, :, at], shrinkage, early)
        for at, binned in enumerate(sets)
    ]


def _check_options(rounds: int, shrinkage: float, z_max: float, tolerance: float | None, max_bins: int | None) -> None:
    if rounds < 1:
        raise TrainingError(f"rounds={rounds} must be at least 1")
    if max_bins is not None and max_bins < 2:
        raise TrainingError(f"max_bins={max_bins} must be at least 2: a single bin carries no information")
    if not SMALLEST_SHRINKAGE <= shrinkage <= 1:
        raise TrainingError(f"shrinkage={shrinkage} must be at least {SMALLEST_SHRINKAGE:g} and at most 1")
    if not 1 < z_max <= LARGEST_Z_MAX:
        raise TrainingError(f"z_max={z_max} must be above 1 and at most {LARGEST_Z_MAX:g}")
    if tolerance is not None and not 0 <= tolerance < math.inf:
        raise TrainingError(
            f"tolerance={tolerance} must be a change of the loss of at least 0; leave it out to train all rounds"
        )


class LogitBoost(Trainer):
    """Rounds of one stump per class, as Weka 3.6 computes them, with exact sums."""

    name = "logitboost"
    what = "LogitBoost on decision stumps, as in the paper"
    rank = -1
    automatic = False  # it is better than the others in none of our sets
    staged = True
    tried = (
        {"rounds": 30, "max_bins": 16},
        {"rounds": 100, "max_bins": 16},
    )
    settings = (
        Setting("rounds", "Rounds of LogitBoost.", int, 100, 1),
        Setting("shrinkage", "Factor on the contribution of each round.", float, 1.0, SMALLEST_SHRINKAGE, 1.0),
        Setting("tolerance", "Stop after a round that changes the mean loss by less than this.", float, None, 0),
        Setting("max_bins", MAX_BINS, int, None, 2),
    )

    def candidates(self, given: Mapping[str, Number]) -> tuple[dict[str, Number], ...]:
        """Return the candidates to compare; given rounds mean the paper's recipe, which leaves nothing else open."""
        recipe = {"shrinkage": 1.0, "max_bins": None} if "rounds" in given else {}
        return super().candidates({**recipe, **given})

    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> Stumps:
        """Return the ensemble. Raises TrainingError for settings that make no sense."""
        given = {**settings, "on_round": report, "with_losses": False}
        return boost(samples.inputs, samples.labels, samples.n_classes, **given)[0]

    def drafts(self, several: "Sequence[Samples]", settings: Mapping[str, Any]) -> list[Stumps]:
        """Return the ensembles of several sets: those of as many rows are trained together."""
        sizes = {(len(samples.labels), samples.n_classes) for samples in several}
        if len(several) == 1 or len(sizes) != 1 or settings.get("tolerance") is not None:
            return [self.train(samples, settings) for samples in several]
        given = {name: value for name, value in settings.items() if name != "tolerance"}
        return boost_together([(samples.inputs, samples.labels) for samples in several], several[0].n_classes, **given)

    def stages(self, samples: "Samples", settings: Mapping[str, Any], rounds: Sequence[int]) -> tuple[Stumps, ...]:
        """Return the ensembles of the first rounds, cut from the longest training."""
        longest = self.train(samples, {**settings, "rounds": max(rounds)})
        return tuple(longest.first(each) for each in rounds)


MEMBER = LogitBoost()
