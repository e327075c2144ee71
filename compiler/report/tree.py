"""The tree as an icicle, a line for each node and its children within it, and as a list within lists."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from ..placement.tree import Tree, edge_label, node_text, sizes_of

MOST_NODES = 300
# Of the icicle, in pixels: how far a level is set in, a line, and what is left for the words of the deepest level.
STEP, LINE, WORDS = 22, 18, 280
_LETTERS = 40  # as many as have room there


@dataclass(frozen=True, slots=True)
class ShownNode:
    """A node of the icicle and the list.

    number     its number in the tree
    depth, line, lines  where it lies on the icicle, and how tall it is; label: its name there
    words      what it asks or says, of how many rows, and the answer that leads to it
    opens      whether its children follow, in a list of their own; is_open: whether one sees them at once
    closes     how many lists end after it
    below      nodes below it that are not shown
    is_leaf    whether it decides on a grasp type
    """

    number: int
    depth: int
    line: int
    lines: int
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
    sizes, lines = sizes_of(tree), sizes_of(tree, deepest)
    nodes = []
    for line, (number, following) in enumerate(zip(shown, ends, strict=True)):
        node, depth = tree.nodes[number], tree.depths[number]
        opens = node.input is not None and depth < deepest
        answer = edge_label(tree, number)
        name = answer + (class_names[node.majority] if node.input is None else f"{names[node.input]}?")
        nodes.append(
            ShownNode(
                number=number,
                depth=depth,
                line=line,
                lines=lines[number],
                label=name if len(name) <= _LETTERS else f"{name[: _LETTERS - 1]}…",
                words=answer + node_text(node, names, class_names),
                opens=opens,
                is_open=depth < 2,
                closes=0 if opens else depth - following,
                below=0 if opens else sizes[number] - 1,
                is_leaf=node.input is None,
            )
        )
    return TreeView(tuple(nodes), deepest + 1, _sentence(tree, deepest))


def _deepest(tree: Tree) -> int:
    """Return the deepest level of which all nodes are shown; the first decision always is."""
    counts = Counter(tree.depths)
    deepest, total = 0, 1
    while deepest < tree.depth and (not deepest or total + counts[deepest + 1] <= MOST_NODES):
        deepest += 1
        total += counts[deepest]
    return deepest


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
