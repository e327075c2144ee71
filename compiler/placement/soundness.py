"""Whether nodes that come from a file make a tree."""

from itertools import pairwise
from typing import TYPE_CHECKING

from .errors import PlacementError

if TYPE_CHECKING:
    from .tree import Node, Tree


def check_tree(tree: "Tree") -> None:
    """Raise PlacementError, with the number of the node, if `tree` is not sound."""
    if not tree.nodes or not tree.classes:
        raise PlacementError("a tree has at least one node and one class")
    waiting = 1
    for number, node in enumerate(tree.nodes):
        waiting += len(node.values) - 1
        if waiting < 0 or (waiting == 0) != (number == len(tree.nodes) - 1):
            raise PlacementError(f"the {len(tree.nodes)} nodes are not one tree in preorder (node {number})")
        _check_node(tree, number, node)
    for number, children in enumerate(tree.children):
        counts = zip(*(tree.nodes[child].counts for child in children), strict=True)
        if children and tuple(map(sum, counts)) != tree.nodes[number].counts:
            raise PlacementError(f"the children of node {number} do not hold its rows")


def _check_node(tree: "Tree", number: int, node: "Node") -> None:
    if len(node.counts) != len(tree.classes) or min(node.counts) < 0 or not node.size:
        raise PlacementError(f"node {number} needs {len(tree.classes)} class counts >= 0, not all zero")
    if (node.input is None) != (len(node.values) < 2) or (node.input is None and (node.values or node.gain)):
        raise PlacementError(f"node {number} is neither a leaf nor a decision between two values or more")
    if node.input is not None and not 0 <= node.input < tree.n_inputs:
        raise PlacementError(f"node {number} asks for input {node.input}, there are {tree.n_inputs}")
    if not node.gain >= 0 or any(a >= b for a, b in pairwise((-1, *node.values))):
        raise PlacementError(f"node {number} has a negative gain, or values that do not ascend from 0")
