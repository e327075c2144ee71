"""Where an object is: its pose as six numbers, as a matrix, and points seen from it. Many objects last."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import sincos

from .shapes import Shape

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Pose:
    """n poses in hand axes: position (3, n) in mm, rotation (3, 3, n), the object's own axes as columns."""

    position: Floats
    rotation: Floats

    @classmethod
    def of(cls, numbers: Floats) -> "Pose":
        """Return the poses of (6, n) numbers: mm, and a rotation vector in radians."""
        return cls(numbers[:3].copy(), rotation(numbers[3:]))

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
    sine = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    small = sine < 1e-150
    return np.stack(v) * np.where(small, 2.0, 2.0 * _angle(sine, w) / np.where(small, 1.0, sine))


def _quaternion(matrix: Floats) -> Floats:
    """Return unit quaternions (4, n), the scalar first and not negative, by whichever of four ways cancels least."""
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

    A guess is mended twice by the sine of what is left of it: 0.08 becomes 3e-7, and that nothing.
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
