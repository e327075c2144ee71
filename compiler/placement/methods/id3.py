"""ID3: the paper's, for every S from one tree; with other kinds of pruning; and cost-aware, by scan time.

Cost-aware ID3 splits nodes largest first (of equal ones the one found first), so that the switches found first decide
the most rows: a prefix of one growth serves every number of switches. At a node the switch of the largest

    |C| * gain / (1 + marginal time / mean time of a port)

is chosen: gain divided by the remaining cost. A switch on a port that is already read is free; one on another port
counts half if all ports take equally long. Of equal ones the cheaper wins, then the lowest number. The comparison is
exact.

Cost-complexity pruning removes weakest links: the decisions with the least gain go first, until few enough inputs are
left (Breiman, Friedman, Olshen and Stone, Classification and Regression Trees, 1984, section 3.3). With R the risk of a
node as a leaf, the entropy of its training rows, the weakest link is the decision t of the smallest

    g(t) = (R(t) - sum of R over the leaves below t) / (leaves below t - 1),

and it becomes a leaf. Risks are integers, so g is compared exactly; of equal links the last in preorder is removed
first, descendants before ancestors.
"""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from fractions import Fraction
from heapq import heapify, heappop, heappush

import numpy as np

from ...samples import Columns, Samples
from ..gain import CellCounter, NodeCounts, best_per_cost
from ..ports import PortCosts
from ..tree import Rows, Tree, grow_id3
from .base import PAPERS, Chooser, Method, first_of

# A decision's share of the entropy, in integer multiples of 2^-30 bits: far below the effect of one row.
_BITS = 30


def weakest_links(tree: Tree, brought: Sequence[int]) -> tuple[int, ...]:
    """Return the numbers of the decisions that become leaves, in their order, until the root is one.

    `brought` is how much the decision at each node lowers the risk, 0 for a leaf.
    """
    standing = [node.input is not None for node in tree.nodes]
    # The reduction by each node and those below it, and their links.
    total, links = list(brought), [max(len(node.values) - 1, 0) for node in tree.nodes]
    for number in range(len(tree.nodes) - 1, 0, -1):
        total[tree.parents[number]] += total[number]
        links[tree.parents[number]] += links[number]

    def key(number: int) -> tuple[Fraction, int]:
        return Fraction(total[number], links[number]), -number

    order: list[int] = []
    waiting = [key(number) for number, remaining in enumerate(standing) if remaining]
    heapify(waiting)
    while waiting:
        weakest = heappop(waiting)
        number = -weakest[1]
        if not standing[number] or weakest != key(number):
            continue  # removed, or pushed again since
        below = [number]
        while below:
            node = below.pop()
            if standing[node]:
                standing[node] = False
                below += tree.children[node]
        above = tree.parents[number]
        while above >= 0:
            total[above] -= total[number]
            links[above] -= links[number]
            heappush(waiting, key(above))
            above = tree.parents[above]
        order.append(number)
    return tuple(order)


def entropy_brought(tree: Tree) -> list[int]:
    """Return by how much each node's decision lowers the entropy of the training rows."""
    return [round(Fraction(node.gain) * node.size * 2**_BITS) for node in tree.nodes]


def pruned(tree: Tree, order: Sequence[int]) -> Chooser:
    """Return m -> the inputs of the largest tree with at most m inputs, after the first of `order` became leaves."""

    def inputs(leaves: int) -> Columns:
        return tuple(dict.fromkeys(_labels(tree, {*order[:leaves]})))

    return lambda most: inputs(bisect_left(range(len(order)), -max(most, 0), key=lambda n: -len(inputs(n))))


def _labels(tree: Tree, leaves: set[int]) -> Iterator[int]:
    """Yield the inputs of the decisions of `tree` in preorder, except at or below `leaves`."""
    waiting = [0]
    while waiting:
        number = waiting.pop()
        label = tree.nodes[number].input
        if label is not None and number not in leaves:
            yield label
            waiting += reversed(tree.children[number])


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


def _cost_complexity(samples: Samples, _: PortCosts | None) -> Chooser:
    """Return m -> the inputs, at most m, of the tree after cost-complexity pruning by entropy of the rows."""
    tree = grow_id3(samples.switches, samples.labels)
    return pruned(tree, weakest_links(tree, entropy_brought(tree)))


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
    Method(
        name="id3-ccp",
        help="ID3 without its weakest links (cost-complexity pruning by entropy)",
        learn=_cost_complexity,
        ours=True,
        tried="unwired",
        rank=6,
    ),
)
