"""The surfaces of objects of several shapes at once: each shape is asked for its own repetitions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...body.pose import Pose
from ...body.shapes import Cylinder, Shape

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Surfaces:
    """Shapes, and which of them is each repetition's object: `whose` (n,), rising."""

    shapes: tuple[Shape, ...]
    whose: Indices

    def rows(self, index: Indices) -> "Surfaces":
        """Return the surfaces of some repetitions, in order."""
        return Surfaces(self.shapes, self.whose[index])

    def at(self, pose: Pose, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Return signed distances (m, n), outward normals (m, 3, n) and curvatures (m, n) at points (m, 3, n)."""
        own = pose.inward(points)
        distance, normal, curvature = np.empty((len(own), own.shape[2])), np.empty_like(own), np.empty_like(own[:, 0])
        edges = np.searchsorted(self.whose, np.arange(len(self.shapes) + 1))
        for shape, first, last in zip(self.shapes, edges[:-1], edges[1:], strict=True):
            if first < last:
                part = own[..., first:last]
                distance[:, first:last], normal[..., first:last] = shape.distance(part)
                curvature[:, first:last] = shape.curvature(part)
        return distance, pose.outward(normal), curvature

    def bars(self) -> Floats:
        """Return 1 for repetitions (n,) whose object is straight along its own x, 0 for others."""
        straight = np.array([isinstance(shape, Cylinder) for shape in self.shapes], dtype=np.float64)
        return straight[self.whose]


def surfaces(shapes: Sequence[Shape], counts: Sequence[int]) -> Surfaces:
    """Return the surfaces of `counts` repetitions of each shape; neighbours of one shape are asked together."""
    different: list[Shape] = []
    whose: list[int] = []
    for shape, count in zip(shapes, counts, strict=True):
        if not different or different[-1] != shape:
            different.append(shape)
        whose += [len(different) - 1] * count
    return Surfaces(tuple(different), np.array(whose, dtype=np.intp))
