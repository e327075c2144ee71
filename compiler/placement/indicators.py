"""What elimination learns from: frames enough to tell switches apart, and joints as bits."""

import numpy as np
from numpy.typing import NDArray

from ..samples import Samples

MOST_ROWS = 8192
BINS = 8


def sampled(learning: Samples) -> Samples:
    """Return MOST_ROWS rows at most, spread evenly over each class's rows, in order: classes keep their shares."""
    if len(learning.labels) <= MOST_ROWS:
        return learning
    by_class = np.argsort(learning.labels, kind="stable")
    spread = np.arange(MOST_ROWS) * len(by_class) // MOST_ROWS
    return learning.rows(np.sort(by_class[spread]))


def thermometer(codes: NDArray[np.uint16]) -> NDArray[np.bool_]:
    """Return bits (b, n) of codes (n, j): for each joint, whether the code exceeds each of its BINS - 1 quantiles.

    Thresholds that no code exceeds, or that are equal, give no bit.
    """
    n = len(codes)
    rows = []
    for column in codes.T:
        quantiles = np.sort(column)[np.arange(1, BINS) * n // BINS]
        rows += [column > threshold for threshold in np.unique(quantiles) if threshold < column.max()]
    return np.array(rows, dtype=np.bool_).reshape(len(rows), n)
