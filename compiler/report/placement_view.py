"""The kept switches: by which method and in which order, where on the hand, and what each brought."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

from thenar.runtime.manifest import Manifest, Switch

from ..hand import HandShape
from ..placement.gain import entropy_bits
from ..placement.methods.base import METHODS
from ..placement.tree import Tree
from ..text import NBSP, percent


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


@dataclass(frozen=True, slots=True)
class PlacementView:
    """The table's rows, whether their shares are known, sentences that read it, and why there is no tree."""

    switches: tuple[KeptSwitch, ...]
    together: bool
    sentences: tuple[str, ...]
    no_tree: str


def placement_view(manifest: Manifest, tree: Tree | None, hand: HandShape | None) -> PlacementView:
    """Return what is said of the placement; shares are known where a tree chose it, parts where there is a hand."""
    method, switches = manifest.options.placement, manifest.switches
    how = METHODS[method].help if method in METHODS else "Chosen by another version of thenar"
    if tree is not None:
        bits = "brought the tree; together is what it and those before it brought, as a share of all there is to know"
    else:
        bits = "holds alone, without the others"
    return PlacementView(
        switches=_kept(switches, tree, hand),
        together=tree is not None,
        sentences=(
            f"{how} (--placement {method}).",
            f"Columns count from 0 in the recordings. Bits are the information on the grasp type that a switch {bits}.",
        ),
        no_tree=f"No tree: the switches were chosen by {method}." if switches else "No tree: no switches were chosen.",
    )


def _kept(switches: Sequence[Switch], tree: Tree | None, hand: HandShape | None) -> tuple[KeptSwitch, ...]:
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
            share=percent(gain / entropy, NBSP) if entropy else "",
        )
        for order, (switch, gain) in enumerate(zip(switches, together, strict=True), 1)
    )
