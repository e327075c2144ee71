"""ID3: the paper's, under every S from one tree; pruned otherwise; and grown with an eye on scan time.

Cost-aware ID3 splits nodes largest first (of equal ones the one found first), so that the switches found first are
those that most rows ask for: the beginning of one growth serves every number of switches. At a node the switch of the
largest

    |C| * gain / (1 + marginal time / mean time of a port)

is chosen: gain against cost, with the cost that is left of it. A switch on a port that is read anyway is free; one on a
port of its own counts half where all ports take equally long. Of equal ones the cheaper wins, then the lowest number.
The comparison is exact.
"""

from heapq import heappop, heappush

import numpy as np
from numpy.typing import NDArray

from ...samples import Columns, Samples
from ..counts import Counter, Digits
from ..gain import NodeCounts, best_per_cost
from ..id3 import grow_id3
from ..ports import PortCosts
from ..pruning import entropy_brought, errors_spared, weakest_links
from .base import PAPERS, Chooser, Method, first_of

_HELD_OUT = 3
# The paper's S, and beyond, until next to nothing is left of the tree.
_PRUNES = (0, 10, 13, 29, 62, 100, 150, 200, 300, 400, 600, 1000)


def _papers(samples: Samples, _: PortCosts | None) -> Chooser:
    """Return S -> the inputs of grow_id3(min_samples=S) on the switches, from one unpruned tree.

    S only decides which nodes are terminal: a node has no more rows than any node above it, so the tree under S is the
    unpruned one less the decisions of fewer than S rows, in the same preorder.
    """
    tree = grow_id3(samples.switches, samples.labels)
    decisions = [(node.input, node.size) for node in tree.nodes if node.input is not None]
    return lambda min_samples: tuple(dict.fromkeys(column for column, size in decisions if size >= min_samples))


def _cost_complexity(samples: Samples, _: PortCosts | None) -> Chooser:
    """Return m -> the inputs, at most m, of the unpruned tree less its weakest links, by entropy of the rows."""
    tree = grow_id3(samples.switches, samples.labels)
    return weakest_links(tree, entropy_brought(tree)).placement


def _reduced_error(samples: Samples, _: PortCosts | None) -> Chooser:
    """Return m -> the inputs, at most m, of a tree grown on two thirds of the rows and pruned by errors on the others.

    What spares no error on the rows held out goes in any case (Quinlan 1987); then the weakest links, until at most m
    inputs are left.
    """
    held_out = every_third(samples.labels)
    tree = grow_id3(samples.switches[~held_out], samples.labels[~held_out])
    # Numbers of the tree's classes, of which every one has rows to grow on.
    labels = np.searchsorted(np.array(tree.classes), samples.labels[held_out])
    path = weakest_links(tree, errors_spared(tree, samples.switches[held_out], labels))
    return lambda most: path.placement(most, path.n_useless)


def every_third(labels: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return (n,) which rows are the third, sixth ... of their class."""
    order = np.argsort(labels, kind="stable")
    firsts = np.searchsorted(labels[order], labels[order])
    chosen = np.zeros(len(labels), np.bool_)
    chosen[order] = (np.arange(len(labels)) - firsts) % _HELD_OUT == _HELD_OUT - 1
    return chosen


def cost_aware_order(samples: Samples, ports: PortCosts | None = None) -> Columns:
    """Return the switches that cost-aware ID3 asks for, in the order found; without `ports` all cost alike."""
    ports = ports or PortCosts((0,) * samples.n_switches, (0.0,))
    bits, labels, n_classes = samples.switches, samples.labels, samples.n_classes
    counter = Counter(Digits.from_matrix(bits), labels, n_classes)
    waiting: list[tuple[int, int, NDArray[np.intp]]] = [(-len(bits), 0, np.arange(len(bits)))]
    found: dict[int, None] = {}
    costs = ports.marginal_costs(found)
    made = 1
    while waiting:
        _, _, rows = heappop(waiting)
        totals = np.bincount(labels[rows], minlength=n_classes)
        if np.count_nonzero(totals) < 2:
            continue
        column = best_per_cost(NodeCounts(totals, counter.count(rows), counter.starts), costs)
        if column is None:
            continue
        if column not in found:
            found[column] = None
            costs = ports.marginal_costs(found)
        closed = bits[rows, column]
        for part in (rows[~closed], rows[closed]):
            heappush(waiting, (-len(part), made, part))
            made += 1
    return tuple(found)


MEMBER = (
    Method(
        name=PAPERS,
        help="The paper's ID3: the switches that decide nodes of at least S rows",
        learn=_papers,
        parameter="S",
        ours=True,
        sizes=_PRUNES,
        tried="always",
        label="ID3",
        rank=4,
    ),
    Method(
        name="id3-cost",
        help="ID3 that weighs information gain against the scan time that a switch adds, largest nodes first",
        learn=lambda samples, ports: first_of(cost_aware_order(samples, ports)),
        ours=True,
        uses_ports=True,
        tried="always",
        rank=5,
    ),
    Method(
        name="id3-ccp",
        help="ID3 less its weakest links (cost-complexity pruning by entropy)",
        learn=_cost_complexity,
        ours=True,
        tried="unwired",
        rank=6,
    ),
    Method(
        name="id3-rep",
        help="ID3 pruned by its errors on every third row, which it was not grown on (reduced-error pruning)",
        learn=_reduced_error,
        ours=True,
        rank=7,
    ),
)
