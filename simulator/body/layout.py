"""`murakami160`: the positions of 160 switches on the glove.

According to the paper, 160 switches with contacts 3.2 mm across and 0.4 mm high are spread uniformly over the palm side
and the sides of the fingers; it gives their positions only in a picture. This layout is ours, after that description:
thumb and thenar 26, each finger 26, palm 30.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats, sincos

from .hand import CAPSULES, TIP_SPHERE, Hand, Skeleton

# The height of a contact above the skin (Panasonic EVQPLDA15, as the paper describes it).
STANDS_OUT_MM = 0.4

# Positions on a segment: (fraction along it, degrees around it: 0 on the pad, positive to the radial side of a finger).
_TIP = (-1.0, 45.0)  # on the round tip, half way between pad and end
_SIDE = 85.0
# Rows of the palm along its five capsules, which meet at the wrist: about 11 mm apart; the thumb has a separate ball.
_PALM_ROWS = {
    "palm_index": (0.55, 0.78, 1.0),
    "palm_middle": (0.35, 0.65, 0.97),
    "palm_ring": (0.3, 0.62, 0.95),
    "palm_little": (0.45, 0.7, 0.97),
    "palm_heel": (0.15, 0.5, 0.85),
}
_PLACES = {
    "thumb_metacarpal": (*((a, r) for a in (0.25, 0.5, 0.75) for r in (-10.0, 30.0, 70.0)), (0.92, 30.0)),
    "thumb_proximal": (
        *((a, r) for a in (0.25, 0.7) for r in (-25.0, 25.0)),
        *((0.35, _SIDE), (0.8, _SIDE), (0.5, -_SIDE)),
    ),
    "thumb_distal": (
        *((a, r) for a in (0.2, 0.5) for r in (-25.0, 25.0)),
        *((0.68, 0.0), _TIP, (0.3, _SIDE), (0.6, _SIDE), (0.45, -_SIDE)),
    ),
    "proximal": (
        *((a, r) for a in (0.25, 0.55, 0.85) for r in (-24.0, 24.0)),
        *((a, r) for a in (0.4, 0.8) for r in (-_SIDE, _SIDE)),
    ),
    "middle": tuple((a, r) for r in (-24.0, 24.0, -_SIDE, _SIDE) for a in (0.3, 0.8)),
    "distal": (
        *((a, r) for a in (0.15, 0.42) for r in (-24.0, 24.0)),
        *((0.66, 0.0), _TIP, (0.5, -_SIDE), (0.5, _SIDE)),
    ),
    **{palm: tuple((a, r) for a in rows for r in (-22.0, 22.0)) for palm, rows in _PALM_ROWS.items()},
}


@dataclass(frozen=True, slots=True)
class Patch:
    """A switch: its name, its capsule, and its position: along (0 to 1; -1: on the round tip) and around in degrees."""

    name: str
    capsule: int
    along: float
    around_deg: float


@lru_cache(maxsize=1)
def murakami160() -> tuple[Patch, ...]:
    """Return the 160 switches, capsule by capsule."""
    patches = []
    for number, capsule in enumerate(CAPSULES):
        digit, segment = capsule.split("_")
        kind = capsule if digit in ("thumb", "palm") else segment
        for count, (along, around) in enumerate(_PLACES[kind], 1):
            patches.append(Patch(f"{capsule}_{count}", number, along, around))
    return tuple(patches)


@dataclass(frozen=True)
class SwitchPlaces:
    """The switches of `layout` on a hand: capsules (s,), and positions (s, 3) in each capsule's axes, mm."""

    hand: Hand
    layout: tuple[Patch, ...]

    @cached_property
    def capsules(self) -> NDArray[np.intp]:
        """The capsule (s,) of each switch."""
        return np.array([patch.capsule for patch in self.layout], dtype=np.intp)

    @cached_property
    def places(self) -> Floats:
        """The tops of the contacts (s, 3) in their capsules' axes, mm."""
        along = np.array([patch.along for patch in self.layout])
        around = np.array([patch.around_deg for patch in self.layout]) * np.pi / 180.0
        length, radius = self.hand.lengths[self.capsules], self.hand.radii[self.capsules] + STANDS_OUT_MM
        sine, cosine = sincos(around)
        on_tip = along < 0.0
        x = np.where(on_tip, TIP_SPHERE * length + radius * sine, along * length)
        return np.stack([x, np.where(on_tip, 0.0, radius * sine), -radius * cosine], axis=1)

    def tops(self, skeleton: Skeleton) -> Floats:
        """Return the tops of the contacts (s, 3, n) in hand axes."""
        frames, place = skeleton.frames[self.capsules], self.places[:, :, None, None]
        turned = frames[:, :, 0] * place[:, 0] + frames[:, :, 1] * place[:, 1] + frames[:, :, 2] * place[:, 2]
        return skeleton.origins[self.capsules] + turned


def taxel_places(listed: tuple[str, ...] | str) -> tuple[int, ...]:
    """Return the numbers of the places with taxels: "all", or names of places or of segments, as "index_distal".

    Raises ValueError for the first that the layout does not have.
    """
    names = [patch.name for patch in murakami160()]
    if listed == "all":
        return tuple(range(len(names)))
    found = set[int]()
    for given in listed:
        own = {place for place, name in enumerate(names) if given in (name, name.rpartition("_")[0])}
        if not own:
            raise ValueError(
                f"the glove has no place {given!r}: `thenar draw --numbers` shows all, thumb_distal_1 is one"
            )
        found |= own
    return tuple(sorted(found))
