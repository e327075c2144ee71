"""The lines of the hand on paper: its soft outline, the outline of each digit, and the creases of its skin."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from .flathand import Floats, Ray, half_circle, rays

# Points that the lines of the palm go through (x, y), drawn to fit the digits of `flathand`.
_ULNAR_EDGE = ((-36.5, -13.0), (-38.0, -2.0), (-47.0, 13.0), (-56.0, 33.0), (-60.5, 55.0), (-61.0, 68.0))
_RADIAL_EDGE = ((37.5, 82.0), (39.0, 70.0), (43.5, 60.0))
_WRIST = ((37.5, -4.0), (36.5, -13.0))
_PALM_CREASES = (
    ((39.0, 67.0), (27.0, 67.0), (16.0, 61.0), (7.0, 48.0), (2.5, 31.0), (3.0, 14.0), (6.5, 3.0)),
    ((39.0, 67.0), (24.0, 71.5), (4.0, 68.5), (-18.0, 60.0), (-37.0, 47.5)),
    ((-60.0, 60.5), (-42.0, 61.0), (-22.0, 68.5), (-4.0, 75.5), (8.0, 78.5), (13.5, 84.5)),
    ((-36.5, -4.0), (-17.0, -6.5), (10.0, -6.5), (36.0, -3.5)),
)
_ROOT = 0.22  # where a finger leaves the palm, over its first segment
_CURVED = 12  # steps of a curve between two of its points


@lru_cache(maxsize=1)
def outlines() -> tuple[Floats, tuple[Floats, ...]]:
    """Return the outline of the hand (k, 2) from cuff to cuff, and that of each digit, thumb first.

    A digit's outline is the piece of the hand's that goes round it; straight across its root it is closed.
    """
    thumb, index, middle, ring, little = rays()
    pieces = [np.array(_ULNAR_EDGE), _round(little)]
    for left, right in ((little, ring), (ring, middle), (middle, index)):
        pieces += [_web(left, right), _round(right)]
    pieces += [np.array(_RADIAL_EDGE), _round_thumb(thumb), _ball(thumb)]
    ends = np.cumsum(list(map(len, pieces)))
    outline = smooth(np.concatenate(pieces))
    digits = [outline[_CURVED * ends[n - 1] : _CURVED * (ends[n] - 1) + 1] for n in (9, 7, 5, 3, 1)]
    return outline, tuple(digits)


@lru_cache(maxsize=1)
def creases() -> tuple[Floats, ...]:
    """Return the lines of the skin, each (k, 2): across the digits at their joints, and the palm's and the wrist's."""
    thumb, *fingers = rays()
    lines = [_crease(finger, float(joint)) for finger in fingers for joint in finger.joints[1:3]]
    lines += [_crease(finger, _ROOT * 0.45 * float(finger.joints[1])) for finger in fingers]
    lines += [_crease(thumb, float(joint)) for joint in thumb.joints[1:3]]
    return (*lines, *map(smooth, _PALM_CREASES))


def smooth(points: Floats | Sequence[Sequence[float]]) -> Floats:
    """Return a soft curve (m, 2) through `points` (k, 2): the cubic of Catmull and Rom."""
    p = np.asarray(points, dtype=np.float64)
    p = np.concatenate([[2 * p[0] - p[1]], p, [2 * p[-1] - p[-2]]])
    before, here, there, after = (p[n : len(p) - 3 + n, None] for n in range(4))
    t = (np.arange(_CURVED) / _CURVED)[:, None]
    bend = 2 * before - 5 * here + 4 * there - after
    curve = here + t / 2 * (there - before + t * (bend + t * (3 * (here - there) + after - before)))
    return np.concatenate([curve.reshape(-1, 2), p[-2:-1]])


def _round(finger: Ray) -> Floats:
    """Return points round a finger: up its left side, over its tip, down its right side."""
    knuckle, last = (float(joint) for joint in finger.joints[1:3])
    return _sides(finger, [_ROOT * knuckle, 0.6 * knuckle, knuckle, (knuckle + last) / 2, last])


def _round_thumb(thumb: Ray) -> Floats:
    knuckle, last = (float(joint) for joint in thumb.joints[1:3])
    return _sides(thumb, [knuckle + 6.0, (knuckle + last) / 2 + 2.0, last])


def _sides(ray: Ray, stations: Sequence[float]) -> Floats:
    breadth = float(ray.halves[2])
    tall = 1.15 * breadth
    stations = [*stations, (stations[-1] + ray.end - tall) / 2]
    half = ray.half(stations)
    bend = half_circle(1.0)
    tip = ray.at(ray.end - tall + tall * bend[:, 1], -breadth * bend[:, 0])
    return np.concatenate([ray.at(stations, -half), tip, ray.at(stations[::-1], half[::-1])])


def _web(left: Ray, right: Ray) -> Floats:
    """Return the bottom (1, 2) of the fork between two fingers."""
    low = 0.35 * _ROOT
    return (left.at(low * left.joints[1:2], left.halves[:1]) + right.at(low * right.joints[1:2], -right.halves[:1])) / 2


def _ball(thumb: Ray) -> Floats:
    """Return points down the ball of the thumb and the wrist."""
    length, half = thumb.joints[1], thumb.halves[0]
    edge = thumb.at(np.array([0.8, 0.45, 0.18]) * length, np.array([1.02, 1.14, 1.22]) * half)
    return np.concatenate([edge, _WRIST])


def _crease(ray: Ray, along: float) -> Floats:
    reach = 0.92 * float(ray.half([along])[0])
    return smooth(ray.at([along + 0.8, along, along - 0.3, along, along + 0.8], np.linspace(-reach, reach, 5)))
