"""A grown decision tree: predicts, prints, and converts to JSON and back.

Nodes are in preorder: a node, then its children's subtrees in the order of their values. That order and each node's
number of values determine the children.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from ..text import counted
from .inputs import PlacementError, check_matrix

Label = bool | int | float | str


class Node(msgspec.Struct, frozen=True):
    """One node: `counts` of its rows by class; a decision node also has the number of its `input`, the input's gain
    there in bits, and the `values` it takes there, ascending, with a child for each.
    """

    counts: tuple[int, ...]
    input: int | None = None
    gain: float = 0.0
    values: tuple[int, ...] = ()

    @property
    def size(self) -> int:
        """Number of rows at the node."""
        return sum(self.counts)

    @property
    def majority(self) -> int:
        """Class number of most rows; of several, the lowest."""
        return self.counts.index(max(self.counts))

    @property
    def gains_nothing(self) -> bool:
        """Whether this is a decision at which no input has a gain alone."""
        return self.input is not None and self.gain == 0

    @property
    def is_mixed_leaf(self) -> bool:
        """Whether this is a leaf of rows of several classes."""
        return self.input is None and max(self.counts) < self.size


class Tree(msgspec.Struct, frozen=True, dict=True):
    """An ID3 tree over `n_inputs` inputs: `nodes` in preorder, `classes` in ascending order, pruned by `min_samples`.

    Raises PlacementError if nodes, classes and inputs do not make a tree.
    """

    nodes: tuple[Node, ...]
    classes: tuple[Label, ...]
    n_inputs: int
    min_samples: int = 0

    def __post_init__(self) -> None:
        _check_tree(self)

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """For each node, the numbers of its children, in the order of their values."""
        found: list[list[int]] = [[] for _ in self.nodes]
        for number, parent in enumerate(self.parents):
            if parent >= 0:
                found[parent].append(number)
        return tuple(map(tuple, found))

    @cached_property
    def parents(self) -> tuple[int, ...]:
        """For each node, the number of its parent; -1 for the root."""
        parents, waiting = [], [-1]
        for number, node in enumerate(self.nodes):
            parents.append(waiting.pop())
            waiting += [number] * len(node.values)
        return tuple(parents)

    @cached_property
    def depths(self) -> tuple[int, ...]:
        """For each node, the number of decisions above it."""
        depths: list[int] = []
        for parent in self.parents:
            depths.append(depths[parent] + 1 if parent >= 0 else 0)
        return tuple(depths)

    @property
    def inputs(self) -> tuple[int, ...]:
        """The placement: numbers of the inputs that label decision nodes, in the order of the nodes, each once."""
        return tuple(self._gain_of_input)

    @property
    def gains(self) -> tuple[float, ...]:
        """Each input's gain, in bits: the sum over its nodes of |C| / n * gain."""
        return tuple(self._gain_of_input.values())

    @cached_property
    def _gain_of_input(self) -> dict[int, float]:
        brought: dict[int, float] = {}
        for node in self.nodes:
            if node.input is not None:
                share = node.gain * node.size / self.nodes[0].size
                brought[node.input] = brought.get(node.input, 0.0) + share
        return brought

    @property
    def depth(self) -> int:
        """Largest number of decisions on a path from the root to a leaf."""
        return max(self.depths)

    @property
    def n_leaves(self) -> int:
        """Number of leaves."""
        return sum(node.input is None for node in self.nodes)

    @property
    def n_zero_gain(self) -> int:
        """Number of decision nodes at which no input has a gain alone, as in XOR."""
        return sum(node.gains_nothing for node in self.nodes)

    @property
    def n_undecided(self) -> int:
        """Number of leaves of several classes whose rows agree in every input; pruned leaves do not count."""
        return sum(node.is_mixed_leaf and node.size >= self.min_samples for node in self.nodes)

    def remarks(self, what: str = "input") -> Iterator[str]:
        """Yield warnings: decisions without a gain, and leaves that no input can split."""
        if self.n_zero_gain:
            yield (
                f"at {counted(self.n_zero_gain, 'node')} no {what} gains anything alone, "
                "the lowest-numbered varying one was taken"
            )
        if self.n_undecided:
            leaves = counted(self.n_undecided, "leaf", "leaves")
            yield f"at {leaves} rows of several classes agree in every {what}"

    def predict(self, X: npt.ArrayLike) -> npt.NDArray[Any]:
        """Return the label (n,) of each row of X (n, n_inputs); an unseen value gets the node's majority."""
        matrix = check_matrix(X)
        if matrix.shape[1] != self.n_inputs:
            raise PlacementError(f"X has {matrix.shape[1]} inputs, the tree was grown on {self.n_inputs}")
        labels = np.zeros(len(matrix), dtype=np.intp)
        rows_of = {0: np.arange(len(matrix))}
        for number, node in enumerate(self.nodes):
            rows = rows_of.pop(number, None)
            if rows is None:
                continue
            labels[rows] = node.majority
            if node.input is not None:
                rows_of |= _share_out(rows, matrix[rows, node.input], node.values, self.children[number])
        return np.array(self.classes)[labels]

    def text(self, names: Sequence[str] = (), class_names: Sequence[str] = ()) -> str:
        """Return the tree as text, one line per node; names default to x0, x1 ... and `classes`."""
        return _tree_text(self, names, class_names)

    def to_json(self) -> bytes:
        """Return the tree as one JSON document."""
        return msgspec.json.encode(self)

    @classmethod
    def from_json(cls, document: bytes | str) -> "Tree":
        """Return the tree of `to_json`; raise PlacementError if the document is not one, or the tree is invalid."""
        try:
            return msgspec.json.decode(document, type=cls)
        except (ValueError, RecursionError) as wrong:
            raise PlacementError(f"this is no stored tree: {wrong}") from None


def _share_out(
    rows: npt.NDArray[np.intp], column: npt.NDArray[Any], values: tuple[int, ...], children: tuple[int, ...]
) -> dict[int, npt.NDArray[np.intp]]:
    parts = {child: rows[column == value] for value, child in zip(values, children, strict=True)}
    return {child: part for child, part in parts.items() if len(part)}


def _check_tree(tree: Tree) -> None:
    """Raise PlacementError, with the number of the node, if `tree` is invalid."""
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


def _check_node(tree: Tree, number: int, node: Node) -> None:
    if len(node.counts) != len(tree.classes) or min(node.counts) < 0 or not node.size:
        raise PlacementError(f"node {number} needs {len(tree.classes)} class counts >= 0, not all zero")
    if (node.input is None) != (len(node.values) < 2) or (node.input is None and (node.values or node.gain)):
        raise PlacementError(f"node {number} is neither a leaf nor a decision between two values or more")
    if node.input is not None and not 0 <= node.input < tree.n_inputs:
        raise PlacementError(f"node {number} tests input {node.input}, there are {tree.n_inputs}")
    if not node.gain >= 0 or any(a >= b for a, b in pairwise((-1, *node.values))):
        raise PlacementError(f"node {number} has a negative gain, or values that do not ascend from 0")


def _tree_text(tree: Tree, names: Sequence[str], class_names: Sequence[str]) -> str:
    """Return the text of Tree.text; raise PlacementError if there are names, but not one for each."""
    names, class_names = names_for(tree, names, class_names)
    lines = []
    # The node's number, and the prefixes of its line and of its children's lines.
    waiting = [(0, "", "")]
    while waiting:
        number, lead, below = waiting.pop()
        node, children = tree.nodes[number], tree.children[number]
        lines.append(lead + node_text(node, names, class_names))
        for value, child in zip(reversed(node.values), reversed(children), strict=True):
            last = child == children[-1]
            waiting.append((child, f"{below}{'└─' if last else '├─'} {value}: ", below + ("   " if last else "│  ")))
    return "\n".join([*lines, _summary(tree)])


def sizes_of(tree: Tree, deepest: int | None = None) -> list[int]:
    """Return the size of each node's subtree, the node included; only of nodes down to level `deepest`."""
    sizes = [int(deepest is None or depth <= deepest) for depth in tree.depths]
    for number in reversed(range(1, len(tree.nodes))):
        sizes[tree.parents[number]] += sizes[number]
    return sizes


_STATES = {0: "open", 1: "closed"}


def edge_label(tree: Tree, number: int) -> str:
    """Return "open: " or "closed: ", or an input's value, on the edge that leads to a node; "" at the root."""
    parent = tree.parents[number]
    if parent < 0:
        return ""
    value = tree.nodes[parent].values[tree.children[parent].index(number)]
    return f"{_STATES.get(value, str(value))}: "


def names_for(tree: Tree, names: Sequence[str], class_names: Sequence[str]) -> tuple[Sequence[str], Sequence[str]]:
    """Return a name for each input and each class: those given, or numbers and labels."""
    names = names or [f"x{number}" for number in range(tree.n_inputs)]
    class_names = class_names or [str(label) for label in tree.classes]
    if len(names) != tree.n_inputs or len(class_names) != len(tree.classes):
        raise PlacementError(
            f"{len(names)} input and {len(class_names)} class names were given, "
            f"the tree has {tree.n_inputs} inputs and {len(tree.classes)} classes"
        )
    return names, class_names


def node_text(node: Node, names: Sequence[str], class_names: Sequence[str]) -> str:
    """Return one node in words."""
    if node.input is not None:
        gain = "no input gains anything alone" if node.gains_nothing else f"gain {node.gain:.4g} bits"
        return f"{names[node.input]}?  {node.size} rows, {gain}"
    most = max(node.counts)
    return f"{class_names[node.majority]}  {most if most == node.size else f'{most} of {node.size}'} rows"


def _summary(tree: Tree) -> str:
    pruned = f", pruned at S = {tree.min_samples}" if tree.min_samples else ""
    said = (
        f"{len(tree.inputs)} of {tree.n_inputs} inputs, {len(tree.nodes)} nodes, {tree.n_leaves} leaves, "
        f"depth {tree.depth}{pruned}"
    )
    return "; ".join([said, *tree.remarks()])
