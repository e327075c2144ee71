"""The hand that reports and specs draw: the simulator's glove, where its switches are the recordings' own."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from thenar.compiler.hand import HandShape


def hand_of(switch_names: Sequence[str], length_mm: float | None = None) -> "HandShape | None":
    """Return the glove `murakami160` laid flat, for a hand of `length_mm`, if it has all of these switches.

    None: of a glove of the user's own nobody knows where its switches lie.
    """
    from thenar.simulator.handmaps.handmap import hand_map

    shape = hand_map()
    if not switch_names or not shape.knows(switch_names):
        return None
    return shape if length_mm is None else shape.scaled(length_mm)
