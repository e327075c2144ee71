"""A right hand of 20 degrees of freedom and 20 capsules: how its parts lie for given joint angles, many at a time.

Axes: x distal, y radial, z dorsal, from the middle of the wrist, millimetres; the palm looks to -z. Every digit is a
chain of four joints and three segments. A segment's own axes: x along it, z dorsal of it; its pad looks to -z.

Degrees of freedom (`DOF`), digit by digit: thumb CMC abduction and flexion, MCP, IP; fingers MCP abduction (radial) and
flexion, PIP, DIP. Capsules (`CAPSULES`): three segments of five digits, then five of the palm.

Arrays of many hands carry them LAST, so that each operation runs along them, one hand never touches another, and a hand
comes out the same in any company: (..., n).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import add_up, sincos

from .anthropometry import DIGITS, Size
from .axes import ABDUCTORS, BETWEEN, REST, about_y, about_z, frame, thumb_times

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

_JOINTS = (("cmc_abduction", "cmc_flexion", "mcp", "ip"),) + (("abduction", "mcp", "pip", "dip"),) * 4
DOF = tuple(f"{digit}_{joint}" for digit, joints in zip(DIGITS, _JOINTS, strict=True) for joint in joints)
_SEGMENTS = (("metacarpal", "proximal", "distal"),) + (("proximal", "middle", "distal"),) * 4
PALM = ("palm_index", "palm_middle", "palm_ring", "palm_little", "palm_heel")
CAPSULES = (
    *(f"{digit}_{segment}" for digit, segments in zip(DIGITS, _SEGMENTS, strict=True) for segment in segments),
    *PALM,
)

# Ranges of the joints in degrees, order of DOF (Cobos' lower bounds and the GraspIt hand; the thumb's first two joints
# count from our neutral position).
LIMITS_DEG = np.array(
    [
        *([-10, 70], [-25, 55], [-10, 75], [-15, 85]),
        *([-20, 25], [-15, 95], [-5, 110], [-5, 85]),
        *([-20, 20], [-15, 95], [-5, 110], [-5, 85]),
        *([-25, 15], [-15, 95], [-5, 115], [-5, 85]),
        *([-35, 20], [-15, 95], [-5, 120], [-5, 85]),
    ],
    dtype=np.float64,
)

# Where spheres of skin sit along each segment, over its length; the last one of a digit makes its round tip.
TIP_SPHERE = 0.62
_DISTAL, _MIDDLE, _PROXIMAL = (0.20, TIP_SPHERE), (0.30, 0.80), (0.25, 0.55, 0.85)
_SPHERES = ((_PROXIMAL, _MIDDLE, _DISTAL),) * 5
_PALM_SPHERES = (0.30, 0.65, 0.97)
# The palm's capsules: from (over hand length, breadth, breadth) to (the same), radius over breadth.
_PALM = np.array(
    [
        [0.10, 0.12, -0.01, 0.435, 0.245, -0.010, 0.145],
        [0.08, 0.02, 0.01, 0.435, 0.000, 0.020, 0.145],
        [0.08, -0.09, 0.00, 0.410, -0.206, -0.010, 0.140],
        [0.09, -0.17, -0.02, 0.380, -0.395, -0.065, 0.130],
        [0.06, -0.25, -0.05, 0.300, -0.400, -0.070, 0.165],
    ]
)


@dataclass(frozen=True, slots=True)
class Skeleton:
    """Where everything lies for n sets of joint angles; hand axes, mm.

    frames   (20 capsules, 3, 3, n)  a capsule's own axes as columns
    origins  (20, 3, n)              where each capsule begins
    axes     (5 digits, 4 joints, 3, n)    what each joint turns on, unit vectors
    centres  (5, 4, 3, n)            a point on it
    """

    frames: Floats
    origins: Floats
    axes: Floats
    centres: Floats


@dataclass(frozen=True)
class Hand:
    """A hand of one size.

    lengths (20,), radii (20,) of the capsules; spheres of skin on their axes: sphere_capsules (m,), sphere_offsets (m,)
    along the capsule, sphere_radii (m,).
    """

    size: Size

    @cached_property
    def lengths(self) -> Floats:
        """Lengths of the capsules (20,) in mm."""
        palm = self._palm[:, 3:6] - self._palm[:, :3]
        return np.concatenate([self.size.segments_mm().ravel(), np.sqrt(add_up((palm * palm).T))])

    @cached_property
    def radii(self) -> Floats:
        """Radii of the capsules (20,) in mm."""
        return np.concatenate([self.size.radii_mm().ravel(), self._palm[:, 6]])

    @cached_property
    def sphere_capsules(self) -> Indices:
        """The capsule (m,) that each sphere of skin belongs to."""
        return np.repeat(np.arange(20), [len(places) for places in self._sphere_places])

    @cached_property
    def sphere_offsets(self) -> Floats:
        """How far along its capsule each sphere's centre lies (m,), mm."""
        places = np.concatenate([np.array(places) for places in self._sphere_places])
        return places * self.lengths[self.sphere_capsules]

    @cached_property
    def sphere_radii(self) -> Floats:
        """Radii of the spheres (m,) in mm."""
        return self.radii[self.sphere_capsules]

    @cached_property
    def _sphere_places(self) -> tuple[tuple[float, ...], ...]:
        return (*(places for digit in _SPHERES for places in digit), *(_PALM_SPHERES,) * 5)

    @cached_property
    def _palm(self) -> Floats:
        length, breadth = self.size.length_mm, self.size.breadth_mm
        return _PALM * [length, breadth, breadth, length, breadth, breadth, breadth]

    @cached_property
    def _palm_frames(self) -> Floats:
        along = (self._palm[:, 3:6] - self._palm[:, :3]) / self.lengths[15:, None]
        return np.stack([frame(x, np.array([0.0, 0.0, 1.0])) for x in along])

    def skeleton(self, angles: Floats) -> Skeleton:
        """Return how the hand lies for joint angles (20, n) in radians, order of DOF."""
        n = angles.shape[1]
        a = angles.reshape(5, 4, n)
        sine, cosine = sincos(a)
        lengths = self.size.segments_mm()
        first = about_z(np.broadcast_to(ABDUCTORS[..., None], (5, 3, 3, n)), sine[:, 0], cosine[:, 0])
        between = thumb_times(first, BETWEEN)
        second = thumb_times(about_y(between, sine[:, 1], cosine[:, 1]), REST)
        third = about_y(second, sine[:, 2], cosine[:, 2])
        fourth = about_y(third, sine[:, 3], cosine[:, 3])
        base = np.broadcast_to(self.size.bases_mm()[:, :, None], (5, 3, n))
        knee = base + lengths[:, 0, None, None] * second[:, :, 0]
        ankle = knee + lengths[:, 1, None, None] * third[:, :, 0]
        palm = np.broadcast_to(self._palm_frames[..., None], (5, 3, 3, n))
        wrist = np.broadcast_to(self._palm[:, :3, None], (5, 3, n))
        frames = np.concatenate([np.stack([second, third, fourth], axis=1).reshape(15, 3, 3, n), palm])
        origins = np.concatenate([np.stack([base, knee, ankle], axis=1).reshape(15, 3, n), wrist])
        axes = np.stack([first[:, :, 2], between[:, :, 1], third[:, :, 1], fourth[:, :, 1]], axis=1)
        return Skeleton(frames, origins, axes, np.stack([base, base, knee, ankle], axis=1))

    def spheres(self, skeleton: Skeleton) -> Floats:
        """Return the centres (m, 3, n) of the spheres of skin."""
        capsule = self.sphere_capsules
        return skeleton.origins[capsule] + self.sphere_offsets[:, None, None] * skeleton.frames[capsule, :, 0]
