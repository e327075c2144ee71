"""What each switch's row of scores is worth: by how much the loss rises where its mean takes its place."""

import numpy as np
from numpy.typing import NDArray

from ..elementary import add_up, exp
from .sums import sums_of_logs

Floats = NDArray[np.float64]


def removal_rises(probability: Floats, bits: NDArray[np.bool_], rows: Floats, labels: NDArray[np.intp]) -> Floats:
    """Return the rise (s,) of the sum of -ln P(label) for each switch whose row is replaced by its mean.

    probability (K, n) with all rows in place, bits (s, n), rows (s, K), labels (n,). Removal changes the scores of a
    frame by one of two vectors d (K,), whether the switch is closed or open; the loss then rises by
    ln(sum over k of P_k exp d_k) - d_label.
    """
    n_classes, n = probability.shape
    member = (labels == np.arange(n_classes)[:, np.newaxis]).astype(np.float64)
    closed_of_class = bits.astype(np.float64) @ member.T
    share = closed_of_class.sum(axis=1, keepdims=True) / n
    closed, opened = rows * (share - 1.0), rows * share
    own = add_up((closed_of_class * closed + (member.sum(axis=1) - closed_of_class) * opened).T)
    return sums_of_logs(_shares_after(probability, np.ascontiguousarray(bits.T), exp(closed), exp(opened))) - own


def _shares_after(probability: Floats, bits: NDArray[np.bool_], closed: Floats, opened: Floats) -> Floats:
    """Return the sum (n, s) over classes of P times its factor (s, K), added class by class."""
    # Not as a matrix product: its bits would depend on the machine.
    total = np.zeros(bits.shape)
    for shares, if_closed, if_open in zip(probability, closed.T, opened.T, strict=True):
        factors = np.where(bits, if_closed, if_open)
        factors *= shares[:, np.newaxis]
        total += factors
    return total
