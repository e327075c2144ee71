"""The list of switches: what each is called, and where on the flat hand it sits."""

from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from ..hand import HandShape

# Of the switch EVQPLDA15: its body, and the disc that the hand's skin meets (Murakami et al. on their glove).
BODY_MM = 4.9
CONTACT_MM = 3.2
_SIDES = {-1: "left side", 0: "palm side", 1: "right side"}


class PlacedSwitch(Struct, frozen=True):
    """A switch of the reduced glove: number n is SWn everywhere.

    part is the digit, or "palm"; side, where on it, left and right as drawn: the palm up, the thumb right. x_mm counts
    to the thumb's side and y_mm to the fingertips on the flat pattern, from the middle of the wrist's crease. All None
    where nobody knows where the glove's switches lie.
    """

    number: int
    name: str
    part: str | None = None
    side: str | None = None
    x_mm: float | None = None
    y_mm: float | None = None


def place_switches(names: Sequence[str], hand: HandShape | None) -> tuple[PlacedSwitch, ...]:
    """Return the switches called `names`, all of which `hand`, if given, knows; millimetres with one decimal."""
    if hand is None:
        return tuple(PlacedSwitch(number, name) for number, name in enumerate(names, start=1))
    return tuple(
        PlacedSwitch(
            number=number,
            name=name,
            part=hand.part_names[hand.parts[mine]],
            side=_SIDES[int(hand.sides[mine])],
            x_mm=round(float(hand.places[mine, 0]), 1),
            y_mm=round(float(hand.places[mine, 1]), 1),
        )
        for number, (name, mine) in enumerate(zip(names, hand.numbers_of(names), strict=True), start=1)
    )


def crowded(switches: Sequence[PlacedSwitch]) -> list[tuple[int, int, float]]:
    """Return pairs of switches whose middles are nearer than a switch's body is broad, and how near, mm."""
    places = np.array([(each.x_mm, each.y_mm) for each in switches if each.x_mm is not None]).reshape(-1, 2)
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    first, second = np.nonzero(np.triu(apart < BODY_MM, k=1))
    return [(int(a) + 1, int(b) + 1, round(float(apart[a, b]), 2)) for a, b in zip(first, second, strict=True)]
