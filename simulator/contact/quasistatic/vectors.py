"""Vectors as (m, 3, n): products in one fixed order, without temporary stacks."""

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import add_up

Floats = NDArray[np.float64]


def dot(a: Floats, b: Floats) -> Floats:
    """Return (m, n) of (m, 3, n) and (m, 3, n)."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def cross(a: Floats, b: Floats) -> Floats:
    """Return (m, 3, n) of (m, 3, n) and (m, 3, n)."""
    crossed = np.empty(np.broadcast_shapes(a.shape, b.shape))
    np.subtract(a[:, 1] * b[:, 2], a[:, 2] * b[:, 1], out=crossed[:, 0])
    np.subtract(a[:, 2] * b[:, 0], a[:, 0] * b[:, 2], out=crossed[:, 1])
    np.subtract(a[:, 0] * b[:, 1], a[:, 1] * b[:, 0], out=crossed[:, 2])
    return crossed


def length(vectors: Floats) -> Floats:
    """Return (n,) of (3, n)."""
    return np.sqrt(add_up(vectors * vectors))


def turn(now: Floats, then: Floats) -> Floats:
    """Return the small turn (3, n) from rotations `then` to `now` (3, 3, n), in hand axes."""
    columns = cross(then.swapaxes(0, 1), now.swapaxes(0, 1))
    return add_up(columns) * 0.5


def turned(frames: Floats, vectors: Floats) -> Floats:
    """Return vectors (m, 3, n), given in the axes of frames (m, 3, 3, n), in hand axes."""
    x, y, z = vectors[:, 0, None], vectors[:, 1, None], vectors[:, 2, None]
    return frames[:, :, 0] * x + frames[:, :, 1] * y + frames[:, :, 2] * z


def wrench(levers: Floats, forces: Floats) -> Floats:
    """Return force and moment (m, k, 6, n) of forces (m, k, 3, n) at levers (m, 3, n)."""
    found = np.empty((*forces.shape[:2], 6, forces.shape[3]))
    found[:, :, :3] = forces
    x, y, z = levers[:, None, 0], levers[:, None, 1], levers[:, None, 2]
    np.subtract(y * forces[:, :, 2], z * forces[:, :, 1], out=found[:, :, 3])
    np.subtract(z * forces[:, :, 0], x * forces[:, :, 2], out=found[:, :, 4])
    np.subtract(x * forces[:, :, 1], y * forces[:, :, 0], out=found[:, :, 5])
    return found


def contract(a: Floats, b: Floats) -> Floats:
    """Return a b^T over xyz: (m, i, 3, n) and (m, j, 3, n) give (m, i, j, n)."""
    product = a[:, :, None, 0] * b[:, None, :, 0]
    product += a[:, :, None, 1] * b[:, None, :, 1]
    product += a[:, :, None, 2] * b[:, None, :, 2]
    return product
