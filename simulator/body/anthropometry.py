"""How long the parts of a hand are, from its length and breadth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DIGITS = ("thumb", "index", "middle", "ring", "little")

# Lengths over hand length (Buchholz, Armstrong, Goldstein 1992, Ergonomics 35:261-273): a digit a row; the thumb's
# metacarpal, proximal and distal; the fingers' proximal, middle and distal phalanx.
SEGMENTS = np.array(
    [
        [0.251, 0.196, 0.158],
        [0.245, 0.143, 0.097],
        [0.266, 0.170, 0.108],
        [0.244, 0.165, 0.107],
        [0.204, 0.117, 0.093],
    ]
)
# Where the first joint of each digit lies: distal of the wrist (over hand length) and radial of the middle finger's ray
# (over hand breadth), the same source as commonly quoted; and dorsal (over hand breadth), which makes the palm's
# transverse arch: ours.
BASES = np.array(
    [
        [0.073, 0.196, -0.140],
        [0.447, 0.251, -0.010],
        [0.446, 0.000, 0.020],
        [0.421, -0.206, -0.010],
        [0.390, -0.402, -0.070],
    ]
)
# Radii of the three segments of each digit over hand breadth: fingers 16 to 20 mm thick on a hand 85 mm broad. Ours,
# rounded from surveys of finger breadth and depth.
RADII = np.array(
    [
        [0.160, 0.120, 0.108],
        [0.108, 0.097, 0.085],
        [0.110, 0.099, 0.087],
        [0.104, 0.093, 0.082],
        [0.092, 0.083, 0.074],
    ]
)
# The fingers fan out by these angles (degrees, radial positive) when no one abducts them: ours.
FAN_DEG = np.array([0.0, 3.0, 0.0, -4.0, -9.0])


@dataclass(frozen=True, slots=True)
class Size:
    """The two measures that everything else of a hand follows from."""

    length_mm: float
    breadth_mm: float

    def segments_mm(self) -> Floats:
        """Return the lengths (5 digits, 3 segments)."""
        return SEGMENTS * self.length_mm

    def bases_mm(self) -> Floats:
        """Return the first joints (5 digits, xyz): distal, radial and dorsal of the wrist's middle."""
        return BASES * [self.length_mm, self.breadth_mm, self.breadth_mm]

    def radii_mm(self) -> Floats:
        """Return the thickness (5 digits, 3 segments)."""
        return RADII * self.breadth_mm
