"""The kept switches: in which order, where on the hand, and what each brought."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

from ...runtime.manifest import Switch
from ..hand import HandShape
from ..placement.gain import entropy_bits
from ..placement.tree import Tree
from .numbers import percent


@dataclass(frozen=True, slots=True)
class KeptSwitch:
    """A row of the table: place in the order, name, part of the hand, number in the recordings, bits, and the share of
    the grasp types' entropy that it and those before it brought; "" where that is not known.
    """

    order: int
    name: str
    part: str
    column: int
    gain: str
    share: str


def placement_view(switches: Sequence[Switch], tree: Tree | None, hand: HandShape | None) -> tuple[KeptSwitch, ...]:
    """Return the rows of the table; shares are known where a tree chose the switches, parts where there is a hand."""
    entropy = 0.0 if tree is None else entropy_bits(list(tree.nodes[0].counts))
    parts = {} if hand is None else dict(zip(hand.names, hand.parts.tolist(), strict=True))
    together = accumulate(switch.gain for switch in switches)
    return tuple(
        KeptSwitch(
            order=order,
            name=switch.name,
            part="" if hand is None else hand.part_names[parts[switch.name]],
            column=switch.column,
            gain=f"{switch.gain:.3f}",
            share=percent(gain / entropy) if entropy else "",
        )
        for order, (switch, gain) in enumerate(zip(switches, together, strict=True), 1)
    )
