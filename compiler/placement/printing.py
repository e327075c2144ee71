"""A tree as text: a line a node, children under their parent in the order of their values."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from .errors import PlacementError

if TYPE_CHECKING:
    from .tree import Node, Tree


def tree_text(tree: "Tree", names: Sequence[str], class_names: Sequence[str]) -> str:
    """Return the text of Tree.text; raise PlacementError if there are names, but not one for each."""
    names, class_names = names_for(tree, names, class_names)
    lines = []
    # Number of the node, what stands before its own line, and before its children's.
    waiting = [(0, "", "")]
    while waiting:
        number, lead, below = waiting.pop()
        node, children = tree.nodes[number], tree.children[number]
        lines.append(lead + node_text(node, names, class_names))
        for value, child in zip(reversed(node.values), reversed(children), strict=True):
            last = child == children[-1]
            waiting.append((child, f"{below}{'└─' if last else '├─'} {value}: ", below + ("   " if last else "│  ")))
    return "\n".join([*lines, _summary(tree)])


def names_for(tree: "Tree", names: Sequence[str], class_names: Sequence[str]) -> tuple[Sequence[str], Sequence[str]]:
    """Return a name for each input and each class, those given or their numbers and labels."""
    names = names or [f"x{number}" for number in range(tree.n_inputs)]
    class_names = class_names or [str(label) for label in tree.classes]
    if len(names) != tree.n_inputs or len(class_names) != len(tree.classes):
        raise PlacementError(
            f"{len(names)} input and {len(class_names)} class names were given, "
            f"the tree has {tree.n_inputs} inputs and {len(tree.classes)} classes"
        )
    return names, class_names


def node_text(node: "Node", names: Sequence[str], class_names: Sequence[str]) -> str:
    """Return one node in words."""
    if node.input is not None:
        gain = "no input gains anything alone" if node.gains_nothing else f"gain {node.gain:.4g} bits"
        return f"{names[node.input]}?  {node.size} rows, {gain}"
    most = max(node.counts)
    return f"{class_names[node.majority]}  {most if most == node.size else f'{most} of {node.size}'} rows"


def _summary(tree: "Tree") -> str:
    pruned = f", pruned at S = {tree.min_samples}" if tree.min_samples else ""
    said = (
        f"{len(tree.inputs)} of {tree.n_inputs} inputs, {len(tree.nodes)} nodes, {tree.n_leaves} leaves, "
        f"depth {tree.depth}{pruned}"
    )
    if tree.n_zero_gain:
        said += (
            f"; at {count_of(tree.n_zero_gain, 'node')} no input gains anything alone, the lowest-numbered varying one "
            "was taken"
        )
    if tree.n_undecided:
        leaves = count_of(tree.n_undecided, "leaf", "leaves")
        said += f"; at {leaves} rows of several classes agree in every input"
    return said


def count_of(number: int, one: str, many: str = "") -> str:
    """Return "1 node" or "2 nodes"; `many` where it is not `one` with an s."""
    return f"{number} {one if number == 1 else many or one + 's'}"
