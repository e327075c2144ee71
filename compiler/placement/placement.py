"""The placement: the switches of a set of grasps that ID3 asks for, in its order, and what each brought."""

from itertools import accumulate
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from ..limits import check_types
from .errors import PlacementError
from .gain import entropy_bits
from .id3 import grow_id3
from .tree import Tree

if TYPE_CHECKING:
    from ..recordings.graspset import GraspSet


class Chosen(msgspec.Struct, frozen=True):
    """One switch that is kept: its number in the set, its name, the bits it brought, and the share of the grasp types'
    entropy that it and those before it brought together.
    """

    number: int
    name: str
    gain_bits: float
    cumulative_share: float


class Placement(msgspec.Struct, frozen=True):
    """What `thenar place` finds: the switches in order, and how the tree came out.

    zero_gain_nodes   decisions at which no switch gains anything alone: the lowest-numbered that varies is asked
    undecided_leaves  leaves of several grasp types whose rows agree in every switch
    """

    switches: tuple[Chosen, ...]
    n_switches: int
    kept_share: float
    entropy_bits: float
    zero_gain_nodes: int
    undecided_leaves: int
    decision_nodes: int
    leaves: int
    depth: int
    prune: int
    rows: int
    fingerprint: str

    @property
    def gain_bits(self) -> float:
        """What all switches brought together."""
        return sum(chosen.gain_bits for chosen in self.switches)


def place(grasp_set: "GraspSet", prune: int = 0) -> tuple[Placement, Tree]:
    """Choose switches of `grasp_set` with ID3, pruned by S = `prune`; return the placement and the tree.

    The tree's classes are numbers of grasp types in the taxonomy, so that a tie goes to the lowest of these.
    Raises PlacementError if the set has no switches, no rows, or more grasp types than a build can hold.
    """
    if not grasp_set.switch_names:
        raise PlacementError("the set has no switches to place: it holds joints only")
    check_types(len(np.unique(grasp_set.labels)), PlacementError)
    tree = grow_id3(grasp_set.switches, grasp_set.labels, min_samples=prune)
    entropy = entropy_bits(list(tree.nodes[0].counts))
    chosen = tuple(
        Chosen(number, grasp_set.switch_names[number], gain, together / entropy)
        for number, gain, together in zip(tree.inputs, tree.gains, accumulate(tree.gains), strict=True)
    )
    n_switches, decisions = len(grasp_set.switch_names), len(tree.nodes) - tree.n_leaves
    return Placement(
        switches=chosen,
        n_switches=n_switches,
        kept_share=len(chosen) / n_switches,
        entropy_bits=entropy,
        zero_gain_nodes=tree.n_zero_gain,
        undecided_leaves=tree.n_undecided,
        decision_nodes=decisions,
        leaves=tree.n_leaves,
        depth=tree.depth,
        prune=prune,
        rows=len(grasp_set),
        fingerprint=grasp_set.fingerprint(),
    ), tree
