"""Checks of the user's data for a placement: a matrix of inputs and one label for each of its rows."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from thenar.runtime.errors import ThenarError


class PlacementError(ThenarError, ValueError):
    """Inputs, labels or a stored tree from which no placement can be made."""


def check_matrix(X: npt.ArrayLike) -> npt.NDArray[Any]:
    """Return X (n, d) as an array of bool or int, all values >= 0; floats with integer values become ints.

    Raises PlacementError that names row and column of the first other entry.
    """
    matrix = np.asarray(X)
    if matrix.ndim != 2:
        raise PlacementError(f"X has {matrix.ndim} dimensions, (rows, inputs) are needed")
    if matrix.dtype.kind not in "biuf":
        raise PlacementError(f"X holds {matrix.dtype}, bits or non-negative whole numbers are needed")
    if matrix.dtype.kind == "f":
        # Comparisons with NaN are false, so this finds NaN as well.
        _refuse(~((matrix >= 0) & (matrix < 2**62) & (matrix == np.floor(matrix))), matrix)
        return matrix.astype(np.int64)
    if matrix.dtype.kind == "i" and matrix.size and matrix.min() < 0:
        _refuse(matrix < 0, matrix)
    return matrix


def _refuse(bad: npt.NDArray[np.bool_], matrix: npt.NDArray[Any]) -> None:
    if bad.any():
        row, column = (int(index) for index in np.argwhere(bad)[0])
        raise PlacementError(f"X holds {matrix[row, column]} in row {row}, column {column}: not a whole number >= 0")


def check_bits(X: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Return X (n, d) as bool; raise PlacementError that names the first entry that is neither 0 nor 1."""
    matrix = check_matrix(X)
    if matrix.dtype != np.bool_:
        _refuse_wide(matrix)
    return matrix.astype(np.bool_, copy=False)


def _refuse_wide(matrix: npt.NDArray[Any]) -> None:
    if matrix.size and matrix.max() > 1:
        row, column = (int(index) for index in np.argwhere(matrix > 1)[0])
        raise PlacementError(f"X holds {matrix[row, column]} in row {row}, column {column}: neither 0 nor 1")


def check_labels(y: npt.ArrayLike, n_rows: int) -> tuple[npt.NDArray[Any], npt.NDArray[np.intp]]:
    """Return the sorted classes (K,) of y and the class number of each row (n,).

    Raises PlacementError if y is empty, does not have one label for each row, holds NaN or infinity, or cannot be
    sorted.
    """
    labels = np.asarray(y)
    if labels.shape != (n_rows,):
        raise PlacementError(f"y has shape {labels.shape}, one label for each of the {n_rows} rows of X is needed")
    if not n_rows:
        raise PlacementError("there are no rows: a placement needs at least one labelled grasp")
    if (strange := _not_finite(labels)).any():
        row = int(strange.argmax())
        raise PlacementError(f"y is {labels[row]} in row {row}: every row needs a label")
    try:
        classes, numbers = np.unique(labels, return_inverse=True)
    except TypeError as mixed:
        raise PlacementError(f"the labels in y cannot be sorted ({mixed}): use text or numbers, not both") from None
    return classes, numbers


def _not_finite(labels: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    if labels.dtype.kind == "O":
        return np.array([isinstance(label, float) and not math.isfinite(label) for label in labels.tolist()])
    return ~np.isfinite(labels) if labels.dtype.kind == "f" else np.zeros(len(labels), np.bool_)
