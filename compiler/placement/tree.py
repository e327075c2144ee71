"""A grown decision tree: predicts, prints, goes to JSON and back.

Nodes stand in preorder: a node, then its children's subtrees in the order of their values. That order and the number
of values of each node are all that is needed to know the children.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from .errors import PlacementError
from .inputs import check_matrix
from .printing import tree_text
from .soundness import check_tree

Label = bool | int | float | str


class Node(msgspec.Struct, frozen=True):
    """One node: `counts` of its rows by class; a decision node also has the number of its `input`, what that input
    gains there in bits, and the `values` it takes there, ascending, a child for each.
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
        """Class number of most rows; the lowest of them if several have most."""
        return self.counts.index(max(self.counts))

    @property
    def gains_nothing(self) -> bool:
        """Whether this is a decision at which no input gains anything by itself."""
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
        check_tree(self)

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
        """What each of `inputs` brought, in bits: the sum over its nodes of |C| / n * gain."""
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
        """Largest number of decisions on a way from the root to a leaf."""
        return max(self.depths)

    @property
    def n_leaves(self) -> int:
        """Number of nodes that decide nothing further."""
        return sum(node.input is None for node in self.nodes)

    @property
    def n_zero_gain(self) -> int:
        """Number of decision nodes at which no input gains anything by itself, as in XOR."""
        return sum(node.gains_nothing for node in self.nodes)

    @property
    def n_undecided(self) -> int:
        """Number of leaves of several classes whose rows agree in every input; pruned ones are none of them."""
        return sum(node.is_mixed_leaf and node.size >= self.min_samples for node in self.nodes)

    def predict(self, X: npt.ArrayLike) -> npt.NDArray[Any]:
        """Return the label (n,) of each row of X (n, n_inputs); a value not met in growing gets the node's majority."""
        matrix = check_matrix(X)
        if matrix.shape[1] != self.n_inputs:
            raise PlacementError(f"X has {matrix.shape[1]} inputs, the tree was grown on {self.n_inputs}")
        answers = np.zeros(len(matrix), dtype=np.intp)
        rows_of = {0: np.arange(len(matrix))}
        for number, node in enumerate(self.nodes):
            rows = rows_of.pop(number, None)
            if rows is None:
                continue
            answers[rows] = node.majority
            if node.input is not None:
                rows_of |= _share_out(rows, matrix[rows, node.input], node.values, self.children[number])
        return np.array(self.classes)[answers]

    def text(self, names: Sequence[str] = (), class_names: Sequence[str] = ()) -> str:
        """Return the tree for people, a line a node; names default to x0, x1 ... and `classes`."""
        return tree_text(self, names, class_names)

    def to_json(self) -> bytes:
        """Return the tree as one JSON document."""
        return msgspec.json.encode(self)

    @classmethod
    def from_json(cls, document: bytes | str) -> "Tree":
        """Return the tree of `to_json`; raise PlacementError if the document is not one, or the tree is not sound."""
        try:
            return msgspec.json.decode(document, type=cls)
        except msgspec.DecodeError as wrong:
            raise PlacementError(f"this is no stored tree: {wrong}") from None


def _share_out(
    rows: npt.NDArray[np.intp], column: npt.NDArray[Any], values: tuple[int, ...], children: tuple[int, ...]
) -> dict[int, npt.NDArray[np.intp]]:
    parts = {child: rows[column == value] for value, child in zip(values, children, strict=True)}
    return {child: part for child, part in parts.items() if len(part)}
