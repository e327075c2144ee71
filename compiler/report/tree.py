"""The tree as an icicle, a line for each node with its children inside, and as nested lists."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from ..placement.tree import Tree, edge_label, node_text, sizes_of

MOST_NODES = 300
# Pixels of the icicle: indentation of a level, height of a line, and room for the words of the deepest level.
STEP, LINE, WORDS = 22, 18, 280
_LETTERS = 40  # that fit there


@dataclass(frozen=True, slots=True)
class ShownNode:
    """A node of the icicle and the list.

    number     its number in the tree
    depth, line, lines  its place in the icicle, and its height; label: its name there
    words      its question or class, its number of rows, and the switch state that leads to it
    opens      whether its children follow, in a nested list; is_open: whether that is open at first
    closes     the number of lists that end after it
    below      the number of nodes below it that are not shown
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
    """The nodes shown, in preorder, their number of levels, and a sentence on the omitted nodes."""

    nodes: tuple[ShownNode, ...]
    levels: int
    sentence: str


def tree_view(tree: Tree, names: Sequence[str], grasps: Sequence[str]) -> TreeView:
    """Return the view of `tree`; names are those of its inputs, grasps those of its classes."""
    deepest = _deepest(tree)
    shown = [number for number, depth in enumerate(tree.depths) if depth <= deepest]
    ends = [tree.depths[number] for number in shown[1:]] + [0]
    class_names = [grasps[int(label)] for label in tree.classes]
    sizes, lines = sizes_of(tree), sizes_of(tree, deepest)
    nodes = []
    for line, (number, following) in enumerate(zip(shown, ends, strict=True)):
        node, depth = tree.nodes[number], tree.depths[number]
        opens = node.input is not None and depth < deepest
        state = edge_label(tree, number)
        name = state + (class_names[node.majority] if node.input is None else f"{names[node.input]}?")
        nodes.append(
            ShownNode(
                number=number,
                depth=depth,
                line=line,
                lines=lines[number],
                label=name if len(name) <= _LETTERS else f"{name[: _LETTERS - 1]}…",
                words=state + node_text(node, names, class_names),
                opens=opens,
                is_open=depth < 2,
                closes=0 if opens else depth - following,
                below=0 if opens else sizes[number] - 1,
                is_leaf=node.input is None,
            )
        )
    return TreeView(tuple(nodes), deepest + 1, _sentence(tree, deepest))


def _deepest(tree: Tree) -> int:
    """Return the deepest level whose nodes all fit; the first decision always does."""
    counts = Counter(tree.depths)
    deepest, total = 0, 1
    while deepest < tree.depth and (not deepest or total + counts[deepest + 1] <= MOST_NODES):
        deepest += 1
        total += counts[deepest]
    return deepest


def _sentence(tree: Tree, deepest: int) -> str:
    said = (
        f"{len(tree.nodes):,} nodes, {tree.n_leaves:,} of them leaves, {tree.depth} decisions deep, "
        f"using {len(tree.inputs)} of {tree.n_inputs} switches"
    )
    if tree.min_samples:
        said += f"; nodes of fewer than {tree.min_samples} rows were not split"
    if deepest < tree.depth:
        said += f". Its first {deepest} levels are shown; thenar place --draw draws all of it"
    return f"{said}."
