"""The hand: lengths of its parts, axes of its joints, and its forward kinematics.

Frames are (d, 3, 3, n): axes as columns, d digits, n hands.

Axes: x distal, y radial, z dorsal, from the middle of the wrist, millimetres; the palm looks to -z. Every digit is a
chain of four joints and three segments. A segment's own axes: x along it, z dorsal of it; its pad looks to -z.

Degrees of freedom (`DOF`), digit by digit: thumb CMC abduction and flexion, MCP, IP; fingers MCP abduction (radial) and
flexion, PIP, DIP. Capsules (`CAPSULES`): three segments of five digits, then five of the palm.

Arrays of many hands have the hand as LAST axis, so that operations run along it, hands are independent, and a hand's
result does not depend on the others: (..., n).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats, add_up, sincos

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
# The position of the first joint of each digit: distal of the wrist (over hand length) and radial of the middle
# finger's ray (over hand breadth), the same source as commonly quoted; and dorsal (over hand breadth), which makes the
# palm's transverse arch: ours.
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
    """The two measures that determine all dimensions of a hand."""

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


# The thumb at rest points distal, 30 degrees to the radial side and 10 to the palm; its nail looks radial and dorsal.
_THUMB_RADIAL_DEG, _THUMB_PALMAR_DEG, _THUMB_ROLL_DEG = 30.0, 10.0, 50.0
# The axes of its first joint are tilted, so that abduction and flexion also pronate it (opposition).
_ABDUCTION_LEAN_DEG, _FLEXION_LEAN_DEG = 40.0, 25.0


def _times(a: Floats, b: Floats) -> Floats:
    """Return the matrix products (d, 3, 3, n), summed in one fixed order."""
    return a[:, :, 0, None] * b[:, None, 0] + a[:, :, 1, None] * b[:, None, 1] + a[:, :, 2, None] * b[:, None, 2]


def thumb_times(frames: Floats, matrix: Floats) -> Floats:
    """Return the frames (5, 3, 3, n) with the thumb's, the first, turned by a constant (3, 3)."""
    turned = frames.copy()
    turned[:1] = _times(frames[:1], matrix[None, ..., None])
    return turned


def about_z(frames: Floats, sine: Floats, cosine: Floats) -> Floats:
    """Return frames (d, 3, 3, n) turned about their own z."""
    turned = frames.copy()
    x, y, s, c = frames[:, :, 0], frames[:, :, 1], sine[:, None], cosine[:, None]
    np.add(c * x, s * y, out=turned[:, :, 0])
    np.subtract(c * y, s * x, out=turned[:, :, 1])
    return turned


def about_y(frames: Floats, sine: Floats, cosine: Floats) -> Floats:
    """Return frames (d, 3, 3, n) turned about their own y."""
    turned = frames.copy()
    x, z, s, c = frames[:, :, 0], frames[:, :, 2], sine[:, None], cosine[:, None]
    np.subtract(c * x, s * z, out=turned[:, :, 0])
    np.add(s * x, c * z, out=turned[:, :, 2])
    return turned


def frame(x: Floats, dorsal: Floats) -> Floats:
    """Return axes as columns: x as given, y and z orthogonal to it, z as close to `dorsal` as possible."""
    y = np.cross(dorsal, x)
    y = y / np.sqrt(add_up(y * y))
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _product(a: Floats, b: Floats) -> Floats:
    return _times(a[None, ..., None], b[None, ..., None])[0, ..., 0]


def _unit(degrees: float) -> tuple[float, float]:
    sine, cosine = sincos(np.array([degrees * np.pi / 180.0]))
    return float(sine[0]), float(cosine[0])


def _thumb() -> tuple[Floats, Floats, Floats]:
    """Return frames whose z is the abduction axis, whose y is the flexion axis, and of the metacarpal at rest."""
    (sr, cr), (sp, cp), (so, co) = map(_unit, (_THUMB_RADIAL_DEG, _THUMB_PALMAR_DEG, _THUMB_ROLL_DEG))
    along = np.array([cr * cp, sr * cp, -sp])
    rest = frame(along, np.array([-sr * so, cr * so, co]))
    (sa, ca), (sf, cf) = _unit(_ABDUCTION_LEAN_DEG), _unit(_FLEXION_LEAN_DEG)
    abduction = ca * rest[:, 2] - sa * rest[:, 0]
    flexion = cf * rest[:, 1] - sf * rest[:, 0]
    y = rest[:, 1]
    abductor = np.stack([np.cross(y, abduction), y, abduction], axis=1)
    z = rest[:, 2]
    return abductor, np.stack([np.cross(flexion, z), flexion, z], axis=1), rest


def _fingers() -> Iterator[Floats]:
    for fan in FAN_DEG[1:]:
        sine, cosine = _unit(float(fan))
        yield np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


# R = abductor * Rz(abduction) * between * Ry(flexion) * rest; the last two turn the thumb alone.
_ABDUCTOR, _FLEXOR, _AT_REST = _thumb()
ABDUCTORS = np.stack([_ABDUCTOR, *_fingers()])
BETWEEN, REST = _product(_ABDUCTOR.T, _FLEXOR), _product(_FLEXOR.T, _AT_REST)


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

# Open, empty hands, order of DOF. Flat: straight fingers, side by side. Relaxed is ours: half-way from there to the
# position of function in hand surgery (MCP about 45, PIP 30 to 45, DIP 10 to 20), the little finger bent most.
RESTS_DEG = {
    "relaxed": np.array([10, 10, 10, 15, 5, 20, 22, 8, 0, 22, 25, 9, -3, 25, 28, 10, -6, 28, 30, 11], np.float64),
    "flat": np.zeros(20),
}

# Positions of the spheres of skin along each segment, over its length; the last one of a digit is its round tip.
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
    """The positions of all parts for n sets of joint angles; hand axes, mm.

    frames   (20 capsules, 3, 3, n)  a capsule's own axes as columns
    origins  (20, 3, n)              start of each capsule
    axes     (5 digits, 4 joints, 3, n)    rotation axis of each joint, unit vectors
    centres  (5, 4, 3, n)            a point on each axis
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
        """Position of each sphere's centre along its capsule (m,), mm."""
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
        """Return the hand's skeleton for joint angles (20, n) in radians, order of DOF."""
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
