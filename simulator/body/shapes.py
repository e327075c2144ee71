"""Primitive objects: how far points are from their surface, and which way is out.

Points are in the object's own axes, millimetres, many objects last: (m, 3, n). Distances are negative inside. Normals
are of unit length everywhere: in the very middle of a ball or bar, where all ways out are as near, one is chosen.
"""

from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Length = Annotated[float, msgspec.Meta(gt=0.0, le=2000.0)]

# Nearer than this, squares lose their bits, and which way is out is no matter of distance any more.
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
        """Return how fast the normal turns (m, n) per mm that a point moves sideways, in any direction."""
        return 1.0 / np.maximum(_norm(points), 1.0)

    def extent_mm(self) -> tuple[float, float, float]:
        """Return the size along the object's own axes."""
        return (self.diameter_mm,) * 3


class Cylinder(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="cylinder", tag_field="shape"):
    """A round bar, or a disk where it is short: `length_mm` along its own x; edges rounded by `edge_mm`."""

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
        across, along = _corner(np.stack([side, end]))
        distance = _rounded(np.stack([side, end])) - self.edge_mm
        outward = _unit(np.stack([y, z]), radius, np.array([1.0, 0.0])[:, None, None])
        return distance, np.stack([along * np.where(x < 0.0, -1.0, 1.0), *(across * outward)], axis=1)

    def curvature(self, points: Floats) -> Floats:
        """Return how fast the normal turns (m, n) per mm that a point moves across the bar; not at all at its ends."""
        x, y, z = points[:, 0], points[:, 1], points[:, 2]
        radius = np.sqrt(y * y + z * z)
        return np.where(np.abs(x) < self.length_mm / 2, 1.0 / np.maximum(radius, 1.0), 0.0)

    def extent_mm(self) -> tuple[float, float, float]:
        """Return the size along the object's own axes."""
        return (self.length_mm, self.diameter_mm, self.diameter_mm)


class Box(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="box", tag_field="shape"):
    """A box, or a card where it is thin: length, width and height along its own x, y and z; edges rounded."""

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
        stacked = np.moveaxis(beyond, 1, 0)
        normal = np.moveaxis(_corner(stacked), 0, 1) * np.where(points < 0.0, -1.0, 1.0)
        return _rounded(stacked) - self.edge_mm, normal

    def curvature(self, points: Floats) -> Floats:
        """Return how fast the normal turns (m, n): not at all on a plane."""
        return np.zeros_like(points[:, 0])

    def extent_mm(self) -> tuple[float, float, float]:
        """Return the size along the object's own axes."""
        return (self.length_mm, self.width_mm, self.height_mm)


Shape = Sphere | Cylinder | Box


def _check_edge(edge_mm: float, *sides_mm: float) -> None:
    if edge_mm > min(sides_mm) / 2:
        raise ValueError(f"`edge_mm` {edge_mm} rounds off more than the object has: at most {min(sides_mm) / 2}")


def _norm(points: Floats) -> Floats:
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    distance: Floats = np.sqrt(x * x + y * y + z * z)
    return distance


def _unit(vectors: Floats, length: Floats, chosen: Floats) -> Floats:
    """Return vectors over their length, and what was `chosen` where they have none."""
    clear = length > _NEAREST_MM
    unit: Floats = np.where(clear, vectors / np.where(clear, length, 1.0), chosen)
    return unit


def _rounded(beyond: Floats) -> Floats:
    """Return the distance from a corner whose sides lie `beyond` (sides, m, n) away."""
    outside = np.maximum(beyond, 0.0)
    total = outside[0] * outside[0]
    for side in outside[1:]:
        total = total + side * side
    distance: Floats = np.sqrt(total) + np.minimum(beyond.max(axis=0), 0.0)
    return distance


def _corner(beyond: Floats) -> Floats:
    """Return the unit gradient of `_rounded` with respect to each side."""
    outside = np.maximum(beyond, 0.0)
    total = outside[0] * outside[0]
    for side in outside[1:]:
        total = total + side * side
    nearest = np.arange(len(beyond))[:, None, None] == beyond.argmax(axis=0)
    return _unit(outside, np.sqrt(total), nearest.astype(np.float64))
