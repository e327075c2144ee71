"""The hand that reports and specs draw: the simulator's glove."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from thenar.compiler.hand import HandShape


def hand_shape() -> "HandShape":
    """Return the glove `murakami160` laid flat."""
    from thenar.compiler.hand import HandShape
    from thenar.simulator.handmaps.flathand import HAND
    from thenar.simulator.handmaps.handmap import PARTS, RADIUS_MM, hand_map

    glove = hand_map()
    return HandShape(
        length_mm=HAND.size.length_mm,
        names=glove.names,
        places=glove.places,
        radius_mm=RADIUS_MM,
        part_names=PARTS,
        parts=glove.parts,
        sides=glove.sides,
        outline=glove.outline,
        strips=glove.strips,
        creases=glove.creases,
        labels=glove.labels,
    )


def hand_of(switch_names: Sequence[str], length_mm: float | None = None) -> "HandShape | None":
    """Return that glove for a hand of `length_mm`, if it has all of these switches.

    None: of a glove of the user's own nobody knows where its switches lie.
    """
    return hand_shape().fitted(switch_names, length_mm)
