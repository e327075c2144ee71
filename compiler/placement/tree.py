"""A grown decision tree: predicts and prints.

Nodes are in preorder: a node, then its children's subtrees in the order of their values. That order and each node's
number of values determine the children.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property
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
    """An ID3 tree over `n_inputs` inputs: nodes in preorder, classes in ascending order, pruned by `min_samples`."""

    nodes: tuple[Node, ...]
    classes: tuple[Label, ...]
    n_inputs: int
    min_samples: int = 0

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
                column = matrix[rows, node.input]
                for value, child in zip(node.values, self.children[number], strict=True):
                    if (below := rows[column == value]).size:
                        rows_of[child] = below
        return np.array(self.classes)[labels]

    def text(self, names: Sequence[str] = (), class_names: Sequence[str] = ()) -> str:
        """Return the tree as text, one line per node; names default to x0, x1 ... and `classes`.

        Raises PlacementError if there are names, but not one for each.
        """
        names, class_names = names_for(self, names, class_names)
        lines = []
        # The node's number, and the prefixes of its line and of its children's lines.
        waiting = [(0, "", "")]
        while waiting:
            number, lead, below = waiting.pop()
            node, children = self.nodes[number], self.children[number]
            lines.append(lead + node_text(node, names, class_names))
            for value, child in zip(reversed(node.values), reversed(children), strict=True):
                last = child == children[-1]
                waiting.append(
                    (child, f"{below}{'└─' if last else '├─'} {value}: ", below + ("   " if last else "│  "))
                )
        return "\n".join([*lines, _summary(self)])


def sizes_of(tree: Tree) -> list[int]:
    """Return the size of each node's subtree, the node included."""
    sizes = [1] * len(tree.nodes)
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
