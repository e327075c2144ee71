"""Placements from ID3: under every S from one tree, pruned otherwise, or grown with an eye on scan time."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..samples import Columns, Samples
from .costaware import PortCosts, cost_aware_order
from .id3 import grow_id3
from .pruning import entropy_brought, errors_spared, weakest_links

_HELD_OUT = 3


def id3_chooser(learning: Samples) -> Callable[[float], Columns]:
    """Return S -> the inputs of grow_id3(min_samples=S) on the switches, from one unpruned tree.

    S only decides which nodes are terminal: a node has no more rows than any node above it, so the tree under S is the
    unpruned one less the decisions of fewer than S rows, in the same preorder.
    """
    tree = grow_id3(learning.switches, learning.labels)
    decisions = [(node.input, node.size) for node in tree.nodes if node.input is not None]

    def choose(min_samples: float) -> Columns:
        return tuple(dict.fromkeys(column for column, size in decisions if size >= min_samples))

    return choose


def cost_complexity_chooser(learning: Samples) -> Callable[[float], Columns]:
    """Return m -> the inputs, at most m, of the unpruned tree less its weakest links, by entropy of the rows."""
    tree = grow_id3(learning.switches, learning.labels)
    return weakest_links(tree, entropy_brought(tree)).placement


def reduced_error_chooser(learning: Samples) -> Callable[[float], Columns]:
    """Return m -> the inputs, at most m, of a tree grown on two thirds of the rows and pruned by errors on the others.

    What spares no error on the rows held out goes in any case (Quinlan 1987); then the weakest links, until at most m
    inputs are left.
    """
    held_out = every_third(learning.labels)
    tree = grow_id3(learning.switches[~held_out], learning.labels[~held_out])
    # Numbers of the tree's classes, of which every one has rows to grow on.
    labels = np.searchsorted(np.array(tree.classes), learning.labels[held_out])
    path = weakest_links(tree, errors_spared(tree, learning.switches[held_out], labels))
    return lambda most: path.placement(most, path.n_useless)


def every_third(labels: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return (n,) which rows are the third, sixth ... of their class."""
    order = np.argsort(labels, kind="stable")
    firsts = np.searchsorted(labels[order], labels[order])
    chosen = np.zeros(len(labels), np.bool_)
    chosen[order] = (np.arange(len(labels)) - firsts) % _HELD_OUT == _HELD_OUT - 1
    return chosen


def cost_aware_chooser(learning: Samples, ports: PortCosts | None) -> Callable[[float], Columns]:
    """Return m -> the first m switches of cost-aware ID3; without `ports` all switches cost the same."""
    alike = PortCosts((0,) * learning.n_switches, (0.0,))
    order = cost_aware_order(learning.switches, learning.labels, ports or alike)
    return lambda most: order[: max(int(most), 0)]
