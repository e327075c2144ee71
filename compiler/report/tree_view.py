"""The tree as a list within lists, as far as one still sees something in it."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from ..placement.tree import Tree, node_text

MOST_NODES = 300
_ANSWERS = {0: "open", 1: "closed"}


@dataclass(frozen=True, slots=True)
class ShownNode:
    """A node of the list.

    number, parent  its number in the tree and its parent's; -1 above the root
    answer          the answer that leads to it: "open", "closed"; "" at the root
    words           what it asks or says, and of how many rows
    name, size      the same in short, for charts
    opens           whether its children follow, in a list of their own; is_open: whether one sees them at once
    closes          how many lists end after it
    below           nodes below it that are not shown
    is_leaf         whether it decides on a grasp type
    """

    number: int
    parent: int
    answer: str
    words: str
    name: str
    size: int
    opens: bool
    is_open: bool
    closes: int
    below: int
    is_leaf: bool


@dataclass(frozen=True, slots=True)
class TreeView:
    """What is shown of a tree: nodes in preorder, and a sentence on what it is and what is left out."""

    nodes: tuple[ShownNode, ...]
    sentence: str


def tree_view(tree: Tree, names: Sequence[str], grasps: Sequence[str]) -> TreeView:
    """Return the list of the nodes of `tree`; names are of its inputs, grasps are what its classes index."""
    deepest = _deepest(tree)
    shown = [number for number, depth in enumerate(tree.depths) if depth <= deepest]
    ends = [tree.depths[number] for number in shown[1:]] + [0]
    class_names = [grasps[int(label)] for label in tree.classes]
    below = _below(tree)
    nodes = []
    for number, following in zip(shown, ends, strict=True):
        node, depth, parent = tree.nodes[number], tree.depths[number], tree.parents[number]
        opens = node.input is not None and depth < deepest
        nodes.append(
            ShownNode(
                number=number,
                parent=parent,
                answer=_answer(tree, number),
                words=node_text(node, names, class_names),
                name=class_names[node.majority] if node.input is None else f"{names[node.input]}?",
                size=node.size,
                opens=opens,
                is_open=depth < 2,
                closes=0 if opens else depth - following,
                below=0 if opens else below[number],
                is_leaf=node.input is None,
            )
        )
    return TreeView(tuple(nodes), _sentence(tree, deepest))


def _answer(tree: Tree, number: int) -> str:
    parent = tree.parents[number]
    if parent < 0:
        return ""
    value = tree.nodes[parent].values[tree.children[parent].index(number)]
    return _ANSWERS.get(value, str(value))


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
