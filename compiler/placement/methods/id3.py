"""ID3: the paper's, for every S from one tree; and cost-aware, by scan time.

Cost-aware ID3 splits nodes largest first (of equal ones the one found first), so that the switches found first decide
the most rows: a prefix of one growth serves every number of switches. At a node the switch of the largest

    |C| * gain / (1 + marginal time / mean time of a port)

is chosen: gain divided by the remaining cost. A switch on a port that is already read is free; one on another port
counts half if all ports take equally long. Of equal ones the cheaper wins, then the lowest number. The comparison is
exact.
"""

from heapq import heappop, heappush

import numpy as np

from ...samples import Columns, Samples
from ..gain import CellCounter, NodeCounts, best_per_cost
from ..ports import PortCosts
from ..tree import Rows, grow_id3
from .base import PAPERS, Chooser, Method, first_of

# The paper's S, and larger ones, until almost nothing is left of the tree.
_PRUNES = (0, 10, 13, 29, 62, 100, 150, 200, 300, 400, 600, 1000)


def _papers(samples: Samples, _: PortCosts | None) -> Chooser:
    """Return S -> the inputs of grow_id3(min_samples=S) on the switches, from one unpruned tree.

    S only decides which nodes are terminal: a node has no more rows than any node above it, so the tree under S is the
    unpruned one without the decisions of fewer than S rows, in the same preorder.
    """
    tree = grow_id3(samples.switches, samples.labels)
    decisions = [(node.input, node.size) for node in tree.nodes if node.input is not None]
    return lambda min_samples: tuple(dict.fromkeys(column for column, size in decisions if size >= min_samples))


def cost_aware_order(samples: Samples, ports: PortCosts | None = None) -> Columns:
    """Return the switches of cost-aware ID3, in the order found; without `ports` all cost the same."""
    ports = ports or PortCosts((0,) * samples.n_switches, (0.0,))
    bits, labels, n_classes = samples.switches, samples.labels, samples.n_classes
    counter = CellCounter(bits, labels, n_classes)
    waiting: list[tuple[int, int, Rows]] = [(-len(bits), 0, np.arange(len(bits)))]
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
        nested=True,
        ours=True,
        uses_ports=True,
        tried="always",
        rank=5,
    ),
)
