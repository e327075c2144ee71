"""Score tables as integers of many lanes: a row of K int16 steps is one Python integer, 16 bits a class.

row = sum_k steps_k * 2^(16 k). Adding two such integers adds all K lanes at once. `IntegerTables` has proved that no
sum leaves int16, so no lane can spill into the next; the offset 2^15 per lane, added once, keeps every lane positive
while it is read out.
"""

from struct import Struct

import numpy as np
from numpy.typing import NDArray

from .tables import IntegerTables

LANE_OFFSET = 1 << 15


class PackedTables:
    """The rows of a build, packed.

    start                       bias and offset: what every sum begins with
    switch_rows, switch_means   s rows
    joint_means                 j rows
    joint_rows, thresholds      j lists: a row per bin, and the codes that part the bins
    """

    __slots__ = ("_lanes", "joint_means", "joint_rows", "start", "switch_means", "switch_rows", "thresholds")

    def __init__(self, tables: IntegerTables) -> None:
        self._lanes = Struct(f"<{tables.n_classes}H")
        offsets = _packed(np.zeros((1, tables.n_classes), np.int16), 0)[0]
        self.start = _packed(tables.bias[np.newaxis], 0)[0]
        self.switch_rows = _packed(tables.switch_rows, offsets)
        self.switch_means = _packed(tables.switch_means, offsets)
        self.joint_means = _packed(tables.joint_means, offsets)
        self.joint_rows = [_packed(rows, offsets) for rows in tables.joint_rows]
        self.thresholds: list[list[int]] = [thresholds.tolist() for thresholds in tables.thresholds]

    def unpacked(self, total: int) -> tuple[int, ...]:
        """Return the K lanes of a sum that began with `start`: scores, each 2^15 too high."""
        return self._lanes.unpack(total.to_bytes(self._lanes.size, "little"))


def _packed(rows: NDArray[np.int16], offsets: int) -> list[int]:
    """Return every row as one integer. `offsets` is 2^15 in each lane, taken off again; 0 leaves it in."""
    lanes = (rows.astype(np.int32) + LANE_OFFSET).astype("<u2")
    return [int.from_bytes(row.tobytes(), "little") - offsets for row in lanes]
