"""A right hand laid flat on paper, palm up: where its digits and its palm lie, and the sides of the digits as strips.

Paper axes: x to the right, which is the thumb's side of one's own right palm, y up to the fingertips; millimetres of a
hand of middling size. Lengths and proportions are those of `hand.py`. A draughtsman's are: digits spread, and a palm
broadened until the unfolded sides find room between the fingers, and fingers a little slimmer than they are thick.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import sincos

from ..body.anthropometry import Size
from ..body.hand import Hand

Floats = NDArray[np.float64]
Places = Floats | Sequence[float]

HAND = Hand(Size(190.0, 88.0))

# The first joints of little, ring, middle and index finger on paper; how far thumb to little finger lean to the right.
_BASES_X = (-51.0, -26.5, 0.0, 27.0)
_LEANS_DEG = (46.0, 8.5, -0.5, -10.0, -21.0)
_SLIM = 0.92
_STRIP_MM, _GAP_MM = 4.6, 0.9  # how broad a strip is, and how far from its digit
_ARC = np.linspace(0.0, np.pi, 9)


@dataclass(frozen=True, slots=True)
class Ray:
    """A digit on paper: from `base` (2,) straight along `ahead` (2,), a unit vector, to its tip at `end` mm.

    joints (4,): where its segments begin and the last one ends; halves (3,): half its breadth at their `middles` (3,).
    """

    base: Floats
    ahead: Floats
    joints: Floats
    middles: Floats
    halves: Floats
    end: float

    def at(self, along: Places, across: Places) -> Floats:
        """Return points (n, 2): `along` the digit from its base, `across` it to the right, mm."""
        right = np.array([self.ahead[1], -self.ahead[0]])
        places: Floats = self.base + np.multiply.outer(along, self.ahead) + np.multiply.outer(across, right)
        return places

    def half(self, along: Places) -> Floats:
        """Return half the breadth (n,) at places along the digit; the rounding of its tip is not in it."""
        return np.interp(along, self.middles, self.halves)

    def beside(self, along: Places) -> Floats:
        """Return how far from the digit's middle the middle of a strip lies (n,)."""
        return self.half(along) + _GAP_MM + _STRIP_MM / 2

    def strip(self, side: int, first: float, last: float) -> Floats:
        """Return the outline (k, 2) of the unfolded side from `first` to `last`; `side`: -1 left, 1 right."""
        along = np.linspace(first, last, 16)
        bend = half_circle(_STRIP_MM / 2)
        middle, reach = self.beside(along), _STRIP_MM / 2
        over = self.at(last + bend[::-1, 1], side * (middle[-1] + bend[::-1, 0]))
        under = self.at(first - bend[:, 1], side * (middle[0] + bend[:, 0]))
        edges = self.at(along, side * (middle - reach)), self.at(along[::-1], side * (middle + reach)[::-1])
        return np.concatenate([edges[0], over, edges[1], under])


def half_circle(radius: float) -> Floats:
    """Return points (k, 2) of a half circle over the middle of its diameter, from (radius, 0) to (-radius, 0)."""
    sine, cosine = sincos(_ARC)
    return np.stack([radius * cosine, radius * sine], axis=1)


@lru_cache(maxsize=1)
def rays() -> tuple[Ray, ...]:
    """Return the five digits, thumb first."""
    return tuple(map(_ray, range(5)))


def _ray(digit: int) -> Ray:
    segments = slice(3 * digit, 3 * digit + 3)
    lengths, radii = HAND.lengths[segments], HAND.radii[segments]
    joints = np.array([0.0, *np.cumsum(lengths)])
    sine, cosine = sincos(np.array([_LEANS_DEG[digit] * np.pi / 180.0]))
    distal, radial, _ = HAND.size.bases_mm()[digit]
    # The flesh of the tip, bent flat, reaches a little further than the bone.
    end = float(joints[2] + 0.62 * lengths[2] + 1.3 * radii[2])
    ahead = np.array([float(sine[0]), float(cosine[0])])
    return Ray(
        palm_at(np.array([[distal, radial]]))[0], ahead, joints, (joints[1:] + joints[:-1]) / 2, _SLIM * radii, end
    )


def palm_at(places: Floats) -> Floats:
    """Return where on paper points of the palm (n, 2), distal and radial of the wrist's middle in mm, lie: (n, 2)."""
    distal, radial = places.T
    bases = HAND.size.bases_mm()[:0:-1, 1]
    slopes = np.diff(_BASES_X) / np.diff(bases)
    beyond = np.minimum(radial - bases[0], 0.0) * slopes[0] + np.maximum(radial - bases[-1], 0.0) * slopes[-1]
    return np.stack([np.interp(radial, bases, _BASES_X) + beyond, distal], axis=1)
