"""How a joint's code becomes a row of its table."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .errors import FirmwareError

MOST_ROWS = 256  # a bin is one byte
MOST_BINS = 256  # and so is what is left of a code when the first of a joint's bins is taken from it

Bins = Literal["direct", "trimmed", "search"]
Rows = NDArray[np.integer]


@dataclass(frozen=True, slots=True, eq=False)
class JointLayout:
    """A joint's rows (m, K), as stored, and the bytes `bins` (n,) that say which row a code takes.

    "direct": bins[code] for all 256 codes. "trimmed": bins[clamped code - first] from the first threshold, where codes
    still take row 0, to one beyond the last, where they take the last row. "search": no bins; the row is the number of
    thresholds (m - 1,) uint16 below the code.
    """

    first: int
    bins: NDArray[np.uint8]
    rows: Rows
    thresholds: NDArray[np.uint16]

    @property
    def constant(self) -> bool:
        """Whether all codes take the same row, which is then zero: it is part of the layout's start."""
        return len(self.thresholds) == 0

    def bin_of(self, codes: NDArray[np.uint16]) -> NDArray[np.int64]:
        """Return the row (n,) of each code (n,), found in the way that the firmware finds it."""
        if len(self.bins) == 0:
            return np.searchsorted(self.thresholds, codes, side="left").astype(np.int64)
        held = np.clip(codes.astype(np.int64), self.first, self.first + len(self.bins) - 1)
        return self.bins[held - self.first].astype(np.int64)


def joint_layout(thresholds: NDArray[np.uint16], rows: Rows, bins: Bins) -> JointLayout:
    """Return the layout of a joint whose stored rows are `rows` (T + 1, K)."""
    first, last = 0, 255
    if bins == "trimmed":
        first, last = (int(thresholds[0]), int(thresholds[-1]) + 1) if len(thresholds) else (0, 0)
    codes = np.arange(first, last + 1) if bins != "search" else np.arange(0)
    return JointLayout(first, np.searchsorted(thresholds, codes, side="left").astype(np.uint8), rows, thresholds)


def code_bits(thresholds: Sequence[NDArray[np.uint16]]) -> int:
    """Return the width of the codes, 8 where no joint's thresholds tell codes above 254 apart, else 16."""
    return 16 if any(len(steps) and steps[-1] >= 255 for steps in thresholds) else 8


def check_joints(thresholds: Sequence[NDArray[np.uint16]], bins: Bins) -> None:
    """Raise FirmwareError if a joint's rows are more than a byte can number, or cannot be found by `bins`."""
    if bins == "direct" and code_bits(thresholds) == 16:
        raise FirmwareError('codes have 16 bits: their rows are found by "trimmed" or "search", not "direct"')
    for number, steps in enumerate(thresholds):
        if len(steps) + 1 > MOST_ROWS:
            raise FirmwareError(
                f"joint {number} has {len(steps) + 1} rows, firmware has at most {MOST_ROWS} a joint: "
                "compile the build with fewer rounds or coarser codes"
            )
        if bins == "trimmed" and len(steps) and int(steps[-1]) - int(steps[0]) + 2 > MOST_BINS:
            raise FirmwareError(
                f"the thresholds of joint {number} are {steps[0]} to {steps[-1]}: "
                f'more than {MOST_BINS - 2} codes apart, their rows are found by "search"'
            )
