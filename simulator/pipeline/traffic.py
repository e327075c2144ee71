"""What is on the serial lines between the glove and the computer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Traffic:
    """The bytes of n repetitions, F frames each; of a frame's B bytes the first `scanner` go over the scanner's line,
    the others over the CyberGlove's.

    A byte keeps its place from sending to receiving, so that what happens to one never shifts the fate of another.

    data    (n, F, B) uint8  as they arrive
    at_us   (n, F, B)        when each has arrived in full
    arrives (n, F, B)        False where one is lost on the way
    """

    data: NDArray[np.uint8]
    at_us: NDArray[np.int64]
    arrives: NDArray[np.bool_]
    scanner: int
