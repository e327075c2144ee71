"""Objects: their shapes, surfaces and poses.

Points are in the object's axes, millimetres, many objects last: (m, 3, n). Distances are negative inside. Normals have
unit length everywhere: in the exact middle of a ball or bar, where all directions are equally near, one is chosen.
"""

from dataclasses import dataclass
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats, add_up, sincos

Length = Annotated[float, msgspec.Meta(gt=0.0, le=2000.0)]

# Below this distance squares lose their bits, and the direction of the normal is arbitrary.
_NEAREST_MM = 1e-150


class Sphere(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="sphere", tag_field="shape"):
    """A ball."""

    diameter_mm: Length

    def distance(self, points: Floats) -> tuple[Floats, Floats]:
        """Return signed distances (m, n) and unit outward normals (m, 3, n)."""
        from_centre = _norm(points)
        chosen = np.array([1.0, 0.0, 0.0])[:, None]
        return from_centre - self.diameter_mm / 2, _unit(points, from_centre[:, None], chosen)

    def curvature(self, points: Floats) -> Floats:
        """Return the rotation of the normal (m, n) per mm of sideways motion, in any direction."""
        return 1.0 / np.maximum(_norm(points), 1.0)

    def extent_mm(self) -> tuple[float, float, float]:
        """Return the size along the object's own axes."""
        return (self.diameter_mm,) * 3


class Cylinder(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="cylinder", tag_field="shape"):
    """A round bar, or a disk if it is short: `length_mm` along its own x; edges rounded by `edge_mm`."""

    diameter_mm: Length
    length_mm: Length
    edge_mm: Annotated[float, msgspec.Meta(ge=0.0)] = 0.5

    def __post_init__(self) -> None:
        _check_edge(self.edge_mm, self.diameter_mm, self.length_mm)

    def distance(self, points: Floats) -> tuple[Floats, Floats]:
        """Return signed distances (m, n) and unit outward normals (m, 3, n)."""
        x, y, z = points[:, 0], points[:, 1], points[:, 2]
        radius = np.sqrt(y * y + z * z)
        side = radius - (self.diameter_mm / 2 - self.edge_mm)
        end = np.abs(x) - (self.length_mm / 2 - self.edge_mm)
        distance, (across, along) = _rounded(np.stack([side, end]))
        outward = _unit(np.stack([y, z]), radius, np.array([1.0, 0.0])[:, None, None])
        return distance - self.edge_mm, np.stack([along * np.where(x < 0.0, -1.0, 1.0), *(across * outward)], axis=1)

    def curvature(self, points: Floats) -> Floats:
        """Return the rotation of the normal (m, n) per mm of motion across the bar; 0 at its ends."""
        x, y, z = points[:, 0], points[:, 1], points[:, 2]
        radius = np.sqrt(y * y + z * z)
        return np.where(np.abs(x) < self.length_mm / 2, 1.0 / np.maximum(radius, 1.0), 0.0)

    def extent_mm(self) -> tuple[float, float, float]:
        """Return the size along the object's own axes."""
        return (self.length_mm, self.diameter_mm, self.diameter_mm)


class Box(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="box", tag_field="shape"):
    """A box, or a card if it is thin: length, width and height along its own x, y and z; edges rounded."""

    length_mm: Length
    width_mm: Length
    height_mm: Length
    edge_mm: Annotated[float, msgspec.Meta(ge=0.0)] = 0.5

    def __post_init__(self) -> None:
        _check_edge(self.edge_mm, self.length_mm, self.width_mm, self.height_mm)

    def distance(self, points: Floats) -> tuple[Floats, Floats]:
        """Return signed distances (m, n) and unit outward normals (m, 3, n)."""
        inner = np.array(self.extent_mm()) / 2 - self.edge_mm
        beyond = np.abs(points) - inner[:, None]
        distance, out = _rounded(np.moveaxis(beyond, 1, 0))
        return distance - self.edge_mm, np.moveaxis(out, 0, 1) * np.where(points < 0.0, -1.0, 1.0)

    def curvature(self, points: Floats) -> Floats:
        """Return the rotation of the normal (m, n): 0 on a plane."""
        return np.zeros_like(points[:, 0])

    def extent_mm(self) -> tuple[float, float, float]:
        """Return the size along the object's own axes."""
        return (self.length_mm, self.width_mm, self.height_mm)


Shape = Sphere | Cylinder | Box


def _check_edge(edge_mm: float, *sides_mm: float) -> None:
    if edge_mm > min(sides_mm) / 2:
        raise ValueError(f"`edge_mm` {edge_mm} rounds off more than the object has: at most {min(sides_mm) / 2}")


def _norm(points: Floats) -> Floats:
    return np.sqrt(add_up((points * points).swapaxes(0, 1)))


def _unit(vectors: Floats, length: Floats, chosen: Floats) -> Floats:
    """Return vectors over their length, or `chosen` where the length is 0."""
    clear = length > _NEAREST_MM
    unit: Floats = np.where(clear, vectors / np.where(clear, length, 1.0), chosen)
    return unit


def _rounded(beyond: Floats) -> tuple[Floats, Floats]:
    """Return the distance from a corner at offsets `beyond` (sides, m, n), and its unit gradient."""
    outside = np.maximum(beyond, 0.0)
    distance = np.sqrt(add_up(outside * outside))
    nearest = np.arange(len(beyond))[:, None, None] == beyond.argmax(axis=0)
    return distance + np.minimum(beyond.max(axis=0), 0.0), _unit(outside, distance, nearest.astype(np.float64))


@dataclass(frozen=True, slots=True)
class Pose:
    """n poses in hand axes: position (3, n) in mm, rotation (3, 3, n), the object's own axes as columns."""

    position: Floats
    rotation: Floats

    @classmethod
    def of(cls, numbers: Floats) -> "Pose":
        """Return the poses of (6, n) numbers: mm, and a rotation vector in radians."""
        return cls(numbers[:3].copy(), rotation(numbers[3:]))

    def rows(self, index: NDArray[np.intp] | slice) -> "Pose":
        """Return some of the poses, in order."""
        return Pose(self.position[:, index], self.rotation[..., index])

    def moved(self, step: Floats) -> "Pose":
        """Return the poses after (6, n): a shift in mm and a small turn about hand axes in radians."""
        return Pose(self.position + step[:3], _product(rotation(step[3:]), self.rotation))

    def inward(self, points: Floats) -> Floats:
        """Return points (m, 3, n) of the hand in the object's axes."""
        return _combined(points - self.position, self.rotation)

    def outward(self, vectors: Floats) -> Floats:
        """Return directions (m, 3, n) of the object in hand axes."""
        return _combined(vectors, self.rotation.swapaxes(0, 1))

    def distance(self, shape: Shape, points: Floats) -> tuple[Floats, Floats]:
        """Return signed distances (m, n) of points (m, 3, n) from the object, and its outward normals (m, 3, n)."""
        distance, normal = shape.distance(self.inward(points))
        return distance, self.outward(normal)


def rotation(vector: Floats) -> Floats:
    """Return the matrices (3, 3, n) of rotation vectors (3, n), by Rodrigues' formula."""
    x, y, z = vector
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    sine, cosine = sincos(angle)
    small = angle < 1e-8
    a = np.where(small, 1.0, sine / np.where(small, 1.0, angle))
    b = np.where(small, 0.5, (1.0 - cosine) / np.where(small, 1.0, square))
    return np.array(
        [
            [1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)],
        ]
    )


def rotation_vector(matrix: Floats) -> Floats:
    """Return the rotation vectors (3, n), at most half a turn long, of matrices (3, 3, n)."""
    w, *v = _quaternion(matrix)
    sine = np.sqrt(add_up(np.array(v) ** 2))
    small = sine < 1e-150
    return np.stack(v) * np.where(small, 2.0, 2.0 * _angle(sine, w) / np.where(small, 1.0, sine))


def _quaternion(matrix: Floats) -> Floats:
    """Return unit quaternions (4, n), the scalar first and not negative, by the least cancelling of four formulas."""
    m = matrix
    w = [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]
    xy, xz, yz = m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1]
    ways = np.array(
        [
            [1.0 + m[0, 0] + m[1, 1] + m[2, 2], *w],
            [w[0], 1.0 + m[0, 0] - m[1, 1] - m[2, 2], xy, xz],
            [w[1], xy, 1.0 - m[0, 0] + m[1, 1] - m[2, 2], yz],
            [w[2], xz, yz, 1.0 - m[0, 0] - m[1, 1] + m[2, 2]],
        ]
    )
    largest = ways[np.arange(4), np.arange(4)].argmax(axis=0)
    way = ways[largest, :, np.arange(m.shape[2])].T
    norm = np.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2] + way[3] * way[3])
    unit: Floats = way / np.where(way[0] < 0.0, -norm, norm)
    return unit


def _angle(sine: Floats, cosine: Floats) -> Floats:
    """Return the angle in the first quadrant with this sine and cosine; numpy's arctan2 differs between processors.

    A guess is corrected twice by the sine of its error: 0.08 becomes 3e-7, then 0.
    """
    angle = 0.5 * np.pi * sine / (sine + cosine)
    for _ in range(2):
        s, c = sincos(angle)
        left = sine * c - cosine * s
        angle = angle + left + left * left * left / 6.0
    return angle


def _combined(vectors: Floats, rotation: Floats) -> Floats:
    """Return vectors (m, 3, n) times rotation (3, 3, n), row by column."""
    turned = np.empty(vectors.shape)
    for k in range(3):
        np.multiply(vectors[:, 0], rotation[0, k], out=turned[:, k])
        turned[:, k] += vectors[:, 1] * rotation[1, k]
        turned[:, k] += vectors[:, 2] * rotation[2, k]
    return turned


def _product(a: Floats, b: Floats) -> Floats:
    return a[:, 0, None] * b[None, 0] + a[:, 1, None] * b[None, 1] + a[:, 2, None] * b[None, 2]
