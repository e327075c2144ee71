"""Where the 160 switches of `murakami160` lie on the hand laid flat, all from the layout's own data.

On a digit, `along` is kept and `around` is bent flat. Switches on the sides go to the strips beside the digit. The ball
of the thumb is turned to the viewer as a whole. On the palm, capsules are spread as their knuckles are.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.recordings.names import nearest
from thenar.drivers.errors import ThenarError

from ..body.anthropometry import DIGITS
from ..body.layout import Switches, murakami160
from .flathand import HAND, Floats, Ray, palm_at, rays
from .handlines import creases, outlines

RADIUS_MM = 1.8  # of a switch on paper: no two overlap
PARTS = (*DIGITS, "palm")

_SIDE_DEG = 75.0  # from here on around a segment is its side
_STRIP_END_MM = 1.6  # of a strip before its first and after its last switch, besides its round end
_LABEL_MM = 5.0  # from a fingertip to the middle of its name
_PALM_SPREAD = 1.2  # how much further than on the hand a switch of the palm lies from its capsule's axis


class MapError(ThenarError, ValueError):
    """A switch or a set cannot be drawn on the hand."""


@dataclass(frozen=True, slots=True, eq=False)
class HandMap:
    """A right hand, palm up, thumb right, on paper; mm.

    names, places (s, 2)   the switches, in the layout's order, and where they lie
    parts, sides (s,)      index of each in PARTS; -1 on the strip left of its digit, 1 on the right one, 0 elsewhere
    outline (k, 2)         the hand from cuff to cuff; digits: that of each, (k, 2); labels (5, 2): above their tips
    strips, creases        outlines of the unfolded sides, left and right of the thumb, then of the index ...; lines
    """

    names: tuple[str, ...]
    places: Floats
    parts: NDArray[np.intp]
    sides: NDArray[np.intp]
    outline: Floats
    digits: tuple[Floats, ...]
    labels: Floats
    strips: tuple[Floats, ...]
    creases: tuple[Floats, ...]

    def numbers_of(self, names: Sequence[str]) -> NDArray[np.intp]:
        """Return the layout's numbers of switches called `names`. Raises MapError naming the first strange one."""
        number = {name: number for number, name in enumerate(self.names)}
        strange = next((name for name in names if name not in number), None)
        if strange is not None:
            raise MapError(f"{strange!r} is no switch of the glove murakami160{nearest(strange, self.names)}")
        return np.array([number[name] for name in names], dtype=np.intp)


@lru_cache(maxsize=1)
def hand_map() -> HandMap:
    """Return the map of `murakami160`."""
    switches = Switches(HAND, murakami160())
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
    return HandMap(names, places, parts, sides, *outlines(), labels, strips, creases())


def _along(switches: Switches) -> Floats:
    """Return how far from their digit's base switches lie (s,)."""
    begins = np.array([*np.concatenate([ray.joints[:3] for ray in rays()]), *np.zeros(5)])
    return begins[switches.capsules] + switches.places[:, 0]


def _flat(switches: Switches, mine: NDArray[np.bool_], sides: NDArray[np.intp]) -> Floats:
    """Return how far right of the middle switches of one segment lie when its skin is bent flat (m,)."""
    layout = [patch for patch, is_mine in zip(switches.layout, mine, strict=True) if is_mine]
    on_tip = np.array([patch.along < 0.0 for patch in layout])
    around = np.array([patch.around_deg for patch in layout])
    front = around[~on_tip & (sides == 0)]
    turned = np.where(on_tip, 0.0, around - front.mean())
    return turned * np.pi / 180.0 * HAND.radii[switches.capsules[mine]]


def _on_digit(ray: Ray, along: Floats, flat: Floats, sides: NDArray[np.intp]) -> Floats:
    return ray.at(along, np.where(sides == 0, flat, sides * ray.beside(along)))


def _strip(ray: Ray, along: Floats, side: int) -> Floats:
    return ray.strip(side, float(along.min()) - _STRIP_END_MM, float(along.max()) + _STRIP_END_MM)


def _on_palm(switches: Switches) -> Floats:
    """Return places of switches on the palm's capsules (s, 2), beside axes that are spread like the knuckles."""
    skeleton = HAND.skeleton(np.zeros((20, 1)))
    tops = switches.tops(skeleton)[:, :2, 0]
    ahead = skeleton.frames[switches.capsules, :2, 0, 0]
    axes = skeleton.origins[switches.capsules, :2, 0] + switches.places[:, :1] * ahead
    return palm_at(axes) + _PALM_SPREAD * (tops - axes)[:, ::-1]
