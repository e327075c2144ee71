"""Many small symmetric systems at once, each solved alone: Cholesky by elementary operations in one fixed order."""

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import add_up

Floats = NDArray[np.float64]


def cholesky(matrix: Floats) -> Floats:
    """Return the lower factors (k, k, ...) of positive definite matrices (k, k, ...)."""
    size = len(matrix)
    lower = np.zeros_like(matrix)
    for j in range(size):
        rest = matrix[j:, j].copy()
        for k in range(j):
            rest -= lower[j:, k] * lower[j, k]
        lower[j, j] = np.sqrt(rest[0])
        lower[j + 1 :, j] = rest[1:] / lower[j, j]
    return lower


def forward(lower: Floats, right: Floats) -> Floats:
    """Solve L y = right for (k, r, ...) right-hand sides."""
    solved = right.copy()
    for j in range(len(lower)):
        solved[j] /= lower[j, j]
        for i in range(j + 1, len(lower)):
            solved[i] -= lower[i, j] * solved[j]
    return solved


def backward(lower: Floats, right: Floats) -> Floats:
    """Solve L^T x = right for (k, r, ...) right-hand sides."""
    solved = right.copy()
    for j in range(len(lower) - 1, -1, -1):
        solved[j] /= lower[j, j]
        for i in range(j):
            solved[i] -= lower[j, i] * solved[j]
    return solved


def solve_arrow(limbs: Floats, coupling: Floats, body: Floats, on_limbs: Floats, on_body: Floats) -> Floats:
    """Solve systems of d limbs that meet only in one body, by eliminating the limbs (Schur's complement).

    limbs (d, 4, 4, n), coupling (d, 4, 6, n), body (6, 6, n); right sides on_limbs (d, 4, n), on_body (6, n).
    Returns (4 d + 6, n).
    """
    lower = cholesky(limbs.transpose(1, 2, 0, 3))
    sides = np.concatenate([coupling.transpose(1, 2, 0, 3), on_limbs.swapaxes(0, 1)[:, None]], axis=1)
    half = forward(lower[:, :, None], sides)
    wide, last = half[:, :6], half[:, 6]
    reduced, right = body.copy(), on_body.copy()
    for joint in range(4):
        reduced -= add_up((wide[joint, :, None] * wide[joint, None, :]).transpose(2, 0, 1, 3))
        right -= add_up((wide[joint] * last[joint]).swapaxes(0, 1))
    factor = cholesky(reduced)
    moved = backward(factor[:, :, None], forward(factor[:, :, None], right[:, None]))[:, 0]
    for column in range(6):
        last = last - wide[:, column] * moved[column]
    turned = backward(lower[:, :, None], last[:, None])[:, 0]
    return np.concatenate([turned.swapaxes(0, 1).reshape(-1, moved.shape[1]), moved])
