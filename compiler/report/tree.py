"""The tree as an icicle, every node as wide as it has rows, and as a list within lists, as far as one sees anything."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from ..placement.tree import Tree, node_text

MOST_NODES = 300
_WIDE = 1000.0  # of the icicle
_LETTER = 6.4  # on average, in the same units
_ANSWERS = {0: "open", 1: "closed"}


@dataclass(frozen=True, slots=True)
class ShownNode:
    """A node of the icicle and the list.

    number     its number in the tree
    depth, x, width   where it lies on the icicle; label: its name there, "" where it has no room
    words      what it asks or says, of how many rows, and the answer that leads to it
    opens      whether its children follow, in a list of their own; is_open: whether one sees them at once
    closes     how many lists end after it
    below      nodes below it that are not shown
    is_leaf    whether it decides on a grasp type
    """

    number: int
    depth: int
    x: float
    width: float
    label: str
    words: str
    opens: bool
    is_open: bool
    closes: int
    below: int
    is_leaf: bool


@dataclass(frozen=True, slots=True)
class TreeView:
    """The nodes that are shown, in preorder, how many levels they have, and what is left out, in a sentence."""

    nodes: tuple[ShownNode, ...]
    levels: int
    sentence: str


def tree_view(tree: Tree, names: Sequence[str], grasps: Sequence[str]) -> TreeView:
    """Return what is shown of `tree`; names are of its inputs, grasps are what its classes index."""
    deepest = _deepest(tree)
    shown = [number for number, depth in enumerate(tree.depths) if depth <= deepest]
    ends = [tree.depths[number] for number in shown[1:]] + [0]
    class_names = [grasps[int(label)] for label in tree.classes]
    below, lefts = _below(tree), _lefts(tree)
    nodes = []
    for number, following in zip(shown, ends, strict=True):
        node, depth = tree.nodes[number], tree.depths[number]
        opens = node.input is not None and depth < deepest
        width = _WIDE * node.size / tree.nodes[0].size
        answer = _answer(tree, number)
        name = answer + (class_names[node.majority] if node.input is None else f"{names[node.input]}?")
        nodes.append(
            ShownNode(
                number=number,
                depth=depth,
                x=round(_WIDE * lefts[number] / tree.nodes[0].size, 2),
                width=round(width, 2),
                label=name if _LETTER * (len(name) + 1) < width else "",
                words=answer + node_text(node, names, class_names),
                opens=opens,
                is_open=depth < 2,
                closes=0 if opens else depth - following,
                below=0 if opens else below[number],
                is_leaf=node.input is None,
            )
        )
    return TreeView(tuple(nodes), deepest + 1, _sentence(tree, deepest))


def _answer(tree: Tree, number: int) -> str:
    """Return "open: " or "closed: ", whichever leads to the node; nothing at the root."""
    parent = tree.parents[number]
    if parent < 0:
        return ""
    value = tree.nodes[parent].values[tree.children[parent].index(number)]
    return f"{_ANSWERS.get(value, str(value))}: "


def _deepest(tree: Tree) -> int:
    """Return the deepest level of which all nodes are shown; the first decision always is."""
    counts = Counter(tree.depths)
    deepest, total = 0, 1
    while deepest < tree.depth and (not deepest or total + counts[deepest + 1] <= MOST_NODES):
        deepest += 1
        total += counts[deepest]
    return deepest


def _below(tree: Tree) -> list[int]:
    below = [0] * len(tree.nodes)
    for number in reversed(range(1, len(tree.nodes))):
        below[tree.parents[number]] += 1 + below[number]
    return below


def _lefts(tree: Tree) -> list[int]:
    """Return how many of the root's rows lie to the left of each node, in the order of the answers."""
    lefts = [0] * len(tree.nodes)
    for number, children in enumerate(tree.children):
        left = lefts[number]
        for child in children:
            lefts[child] = left
            left += tree.nodes[child].size
    return lefts


def _sentence(tree: Tree, deepest: int) -> str:
    said = (
        f"{len(tree.nodes):,} nodes, {tree.n_leaves:,} of them leaves, {tree.depth} decisions deep, "
        f"asking {len(tree.inputs)} of {tree.n_inputs} switches"
    )
    if tree.min_samples:
        said += f"; nodes of fewer than {tree.min_samples} rows were not split"
    if deepest < tree.depth:
        said += f". Shown are its first {deepest} levels; thenar place --draw draws all of it"
    return f"{said}."
