"""The scores of many frames at once, by the integer tables: what `runtime.scores` gives frame by frame."""

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import IntegerTables


def integer_scores(tables: IntegerTables, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.int32]:
    """Return the scores (n, K), in steps, of the kept switches (n, s) and the joints' codes (n, j)."""
    # No partial sum leaves int16 (IntegerTables), so nothing overflows; a product of small whole numbers is exact.
    scores = bits.astype(np.int32) @ tables.switch_rows.astype(np.int32) + tables.bias.astype(np.int32)
    for column, thresholds, rows in zip(codes.T, tables.thresholds, tables.joint_rows, strict=True):
        scores += rows[np.searchsorted(thresholds, column, side="left")]
    return scores
