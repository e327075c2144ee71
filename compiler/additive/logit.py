"""Multinomial logistic regression on score tables: a row for each switch, and one for each bin of each joint.

minimise  sum over rows i of w_i (log sum_k exp F_k(x_i) - F_y(x_i))
          + penalty/2 sum of all squared entries + smoothness/2 sum of squared steps between neighbouring bins
"""

import numpy as np
from numpy.typing import NDArray

from ..boosting.binning import bin_columns
from ..elementary import softmax_and_loss
from ..tables.collapse import Floats, ScoreTables


def fit_logit(
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    labels: NDArray[np.intp],
    n_classes: int,
    *,
    penalty: float = 1.0,
    smoothness: float = 1.0,
    max_bins: int | None = 16,
    tolerance: float = 1e-5,
) -> ScoreTables:
    """Return the score tables of switches `bits` (n, s) and joint `codes` (n, j) that minimise the penalised loss."""
    from scipy.optimize import minimize

    binned = bin_columns(codes, max_bins)
    steps = [np.empty(0, np.uint16)] * codes.shape[1]
    for group in binned.groups:
        for position, column in enumerate(group.columns.tolist()):
            splits = [group.threshold(position, split) for split in range(group.n_splits(position))]
            steps[column] = np.unique(np.floor(splits)).astype(np.uint16)
    blocks = [
        np.searchsorted(edges, column)[:, None] == np.arange(len(edges) + 1)
        for edges, column in zip(steps, codes.T, strict=True)
    ]
    design = np.hstack([np.ones((len(bits), 1)), bits, *blocks]).astype(np.float64)
    starts = 1 + bits.shape[1] + np.concatenate([[0], np.cumsum([len(edges) + 1 for edges in steps])]).astype(int)
    inside = np.ones(len(design.T), bool)
    inside[: starts[0]] = inside[starts[1:] - 1] = False
    pairs = np.flatnonzero(inside)  # each with its neighbour above
    member = (labels == np.arange(n_classes)[:, None]).T

    def loss(flat: Floats) -> tuple[float, Floats]:
        rows = flat.reshape(-1, n_classes)
        probability, mean = softmax_and_loss(np.ascontiguousarray((design @ rows).T), labels, None)
        moved = rows[pairs + 1] - rows[pairs]
        pull = penalty * rows
        pull[0] = 0.0
        value = mean * len(labels) + 0.5 * (pull * rows).sum() + 0.5 * smoothness * (moved**2).sum()
        np.add.at(pull, pairs + 1, smoothness * moved)
        np.add.at(pull, pairs, -smoothness * moved)
        return float(value), (design.T @ (probability.T - member) + pull).ravel()

    found = minimize(
        loss,
        np.zeros(design.shape[1] * n_classes),
        jac=True,
        method="L-BFGS-B",
        options={"gtol": tolerance, "ftol": 1e-12, "maxiter": 2000},
    )
    rows = found.x.reshape(-1, n_classes)
    return ScoreTables(
        rows[0],
        rows[1 : 1 + bits.shape[1]],
        tuple(steps),
        tuple(np.split(rows[starts[0] :], starts[1:-1] - starts[0])) if steps else (),
    )
