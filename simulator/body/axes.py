"""What the joints of a hand at rest turn on, and turning about it.

Frames are (d, 3, 3, n): axes as columns, d digits, n hands.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import add_up, sincos

from .anthropometry import FAN_DEG

Floats = NDArray[np.float64]

# The thumb at rest points distal, 30 degrees to the radial side and 10 to the palm; its nail looks radial and dorsal.
_THUMB_RADIAL_DEG, _THUMB_PALMAR_DEG, _THUMB_ROLL_DEG = 30.0, 10.0, 50.0
# Its first joint turns on axes that lean on the metacarpal, so that abduction and flexion also pronate it (opposition).
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
    """Return axes as columns: x as given, y and z square to it, z as near `dorsal` as can be."""
    y = _cross(dorsal, x)
    y = y / np.sqrt(add_up(y * y))
    return np.stack([x, y, _cross(x, y)], axis=1)


def _cross(a: Floats, b: Floats) -> Floats:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


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
    abductor = np.stack([_cross(y, abduction), y, abduction], axis=1)
    z = rest[:, 2]
    return abductor, np.stack([_cross(flexion, z), flexion, z], axis=1), rest


def _fingers() -> Iterator[Floats]:
    for fan in FAN_DEG[1:]:
        sine, cosine = _unit(float(fan))
        yield np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


# R = abductor * Rz(abduction) * between * Ry(flexion) * rest; the last two turn the thumb alone.
_ABDUCTOR, _FLEXOR, _AT_REST = _thumb()
ABDUCTORS = np.stack([_ABDUCTOR, *_fingers()])
BETWEEN, REST = _product(_ABDUCTOR.T, _FLEXOR), _product(_FLEXOR.T, _AT_REST)
