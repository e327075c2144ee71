"""Positions of the 160 switches of `murakami160` on the flat hand, all from the layout's data.

Paper axes: x to the right, the thumb's side of the viewer's own right palm, y up to the fingertips; millimetres of a
medium hand. Lengths and proportions are those of `hand.py`. For drawing, digits are spread, the palm is broadened to
make room for the unfolded sides between the fingers, and fingers are slightly slimmer than they are thick.

On a digit, `along` is kept and `around` is flattened. Switches on the sides go to the strips along the digit. The ball
of the thumb is turned to the viewer as a whole. On the palm, capsules are spread like their knuckles.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import sincos
from thenar.compiler.hand import HandShape

from ..body.hand import DIGITS, Hand, Size
from ..body.layout import SwitchPlaces, murakami160

Floats = NDArray[np.float64]
Places = Floats | Sequence[float]

HAND = Hand(Size(190.0, 88.0))

# The first joints of little, ring, middle and index finger on paper; the inclination of each digit to the right.
_BASES_X = (-51.0, -26.5, 0.0, 27.0)
_LEANS_DEG = (46.0, 8.5, -0.5, -10.0, -21.0)
_SLIM = 0.92
_STRIP_MM, _GAP_MM = 4.6, 0.9  # width of a strip, and its distance from its digit
_ARC = np.linspace(0.0, np.pi, 9)


@dataclass(frozen=True, slots=True)
class Ray:
    """A digit on paper: from `base` (2,) straight along `ahead` (2,), a unit vector, to its tip at `end` mm.

    joints (4,): starts of its segments and the end of the last; halves (3,): half its breadth at their `middles` (3,).
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
        """Return half the breadth (n,) at positions along the digit, without the rounding of its tip."""
        return np.interp(along, self.middles, self.halves)

    def strip_offset(self, along: Places) -> Floats:
        """Return the distance of the middle of a strip from the digit's middle (n,)."""
        return self.half(along) + _GAP_MM + _STRIP_MM / 2

    def strip(self, side: int, first: float, last: float) -> Floats:
        """Return the outline (k, 2) of the unfolded side from `first` to `last`; `side`: -1 left, 1 right."""
        along = np.linspace(first, last, 16)
        bend = half_circle(_STRIP_MM / 2)
        middle, reach = self.strip_offset(along), _STRIP_MM / 2
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
    # The flattened flesh of the tip extends slightly beyond the bone.
    end = float(joints[2] + 0.62 * lengths[2] + 1.3 * radii[2])
    ahead = np.array([float(sine[0]), float(cosine[0])])
    return Ray(
        palm_at(np.array([[distal, radial]]))[0], ahead, joints, (joints[1:] + joints[:-1]) / 2, _SLIM * radii, end
    )


def palm_at(places: Floats) -> Floats:
    """Return the paper positions (n, 2) of palm points (n, 2), distal and radial of the wrist's middle in mm."""
    distal, radial = places.T
    bases = HAND.size.bases_mm()[:0:-1, 1]
    slopes = np.diff(_BASES_X) / np.diff(bases)
    beyond = np.minimum(radial - bases[0], 0.0) * slopes[0] + np.maximum(radial - bases[-1], 0.0) * slopes[-1]
    return np.stack([np.interp(radial, bases, _BASES_X) + beyond, distal], axis=1)


# Points on the lines of the palm (x, y), drawn to fit the digits of `flathand`.
_ULNAR_EDGE = ((-36.5, -13.0), (-38.0, -2.0), (-47.0, 13.0), (-56.0, 33.0), (-60.5, 55.0), (-61.0, 68.0))
_RADIAL_EDGE = ((37.5, 82.0), (39.0, 70.0), (43.5, 60.0))
_WRIST = ((37.5, -4.0), (36.5, -13.0))
_PALM_CREASES = (
    ((39.0, 67.0), (27.0, 67.0), (16.0, 61.0), (7.0, 48.0), (2.5, 31.0), (3.0, 14.0), (6.5, 3.0)),
    ((39.0, 67.0), (24.0, 71.5), (4.0, 68.5), (-18.0, 60.0), (-37.0, 47.5)),
    ((-60.0, 60.5), (-42.0, 61.0), (-22.0, 68.5), (-4.0, 75.5), (8.0, 78.5), (13.5, 84.5)),
    ((-36.5, -4.0), (-17.0, -6.5), (10.0, -6.5), (36.0, -3.5)),
)
_ROOT = 0.22  # start of a finger at the palm, over its first segment
_CURVED = 12  # steps of a curve between two of its points


@lru_cache(maxsize=1)
def outlines() -> tuple[Floats, tuple[Floats, ...]]:
    """Return the outline of the hand (k, 2) from cuff to cuff, and that of each digit, thumb first.

    A digit's outline is its part of the hand's outline, closed straight across its root.
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


RADIUS_MM = 1.8  # of a switch on paper: no two overlap
PARTS = (*DIGITS, "palm")

_SIDE_DEG = 75.0  # from here on around a segment is its side
_STRIP_END_MM = 1.6  # of a strip before its first and after its last switch, in addition to its round end
_LABEL_MM = 5.0  # from a fingertip to the middle of its name
_PALM_SPREAD = 1.2  # factor on the distance of a palm switch from its capsule's axis


@lru_cache(maxsize=1)
def hand_map() -> HandShape:
    """Return the flat map of the glove `murakami160`."""
    switches = SwitchPlaces(HAND, murakami160())
    around = np.array([patch.around_deg for patch in switches.layout])
    sides = np.where(np.abs(around) > _SIDE_DEG, np.sign(around), 0.0).astype(np.intp)
    parts = np.minimum(switches.capsules // 3, 5)
    places, along = _on_palm(switches), _along(switches)
    for capsule in range(15):
        mine = switches.capsules == capsule
        places[mine] = _on_digit(rays()[capsule // 3], along[mine], _flat(switches, mine, sides[mine]), sides[mine])
    strips = tuple(
        _strip(ray, along[(parts == digit) & (sides == side)], side)
        for digit, ray in enumerate(rays())
        for side in (-1, 1)
    )
    names = tuple(patch.name for patch in switches.layout)
    labels = np.stack([ray.at([ray.end + _LABEL_MM], [0.0])[0] for ray in rays()])
    return HandShape(
        glove="murakami160",
        length_mm=HAND.size.length_mm,
        names=names,
        places=places,
        radius_mm=RADIUS_MM,
        part_names=PARTS,
        parts=parts,
        sides=sides,
        outline=outlines()[0],
        strips=strips,
        creases=creases(),
        labels=labels,
        part_number="EVQPLDA15",
        body_mm=4.9,
    )


def _along(switches: SwitchPlaces) -> Floats:
    """Return the distance of switches from their digit's base (s,)."""
    begins = np.array([*np.concatenate([ray.joints[:3] for ray in rays()]), *np.zeros(5)])
    return begins[switches.capsules] + switches.places[:, 0]


def _flat(switches: SwitchPlaces, mine: NDArray[np.bool_], sides: NDArray[np.intp]) -> Floats:
    """Return the offset to the right of the middle of one segment's switches on flattened skin (m,)."""
    layout = [patch for patch, is_mine in zip(switches.layout, mine, strict=True) if is_mine]
    on_tip = np.array([patch.along < 0.0 for patch in layout])
    around = np.array([patch.around_deg for patch in layout])
    front = around[~on_tip & (sides == 0)]
    turned = np.where(on_tip, 0.0, around - front.mean())
    return turned * np.pi / 180.0 * HAND.radii[switches.capsules[mine]]


def _on_digit(ray: Ray, along: Floats, flat: Floats, sides: NDArray[np.intp]) -> Floats:
    return ray.at(along, np.where(sides == 0, flat, sides * ray.strip_offset(along)))


def _strip(ray: Ray, along: Floats, side: int) -> Floats:
    return ray.strip(side, float(along.min()) - _STRIP_END_MM, float(along.max()) + _STRIP_END_MM)


def _on_palm(switches: SwitchPlaces) -> Floats:
    """Return positions of switches on the palm's capsules (s, 2), along axes that are spread like the knuckles."""
    skeleton = HAND.skeleton(np.zeros((20, 1)))
    tops = switches.tops(skeleton)[:, :2, 0]
    ahead = skeleton.frames[switches.capsules, :2, 0, 0]
    axes = skeleton.origins[switches.capsules, :2, 0] + switches.places[:, :1] * ahead
    return palm_at(axes) + _PALM_SPREAD * (tops - axes)[:, ::-1]
