import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler import grow_id3
from thenar.compiler.placement.inputs import PlacementError
from thenar.compiler.placement.tree import Node, Tree


@pytest.fixture
def tree() -> Tree:
    X = [[0, 0], [0, 2], [0, 2], [3, 2], [3, 1], [3, 0]]
    return grow_id3(X, ["cup", "pen", "pen", "rod", "rod", "rod"])


def test_a_tree_is_printed_line_by_line(tree: Tree) -> None:
    assert tree.text(["thumb", "palm"]).splitlines() == [
        "thumb?  6 rows, gain 1 bits",
        "├─ 0: palm?  3 rows, gain 0.9183 bits",
        "│  ├─ 0: cup  1 rows",
        "│  └─ 2: pen  2 rows",
        "└─ 3: rod  3 rows",
        "2 of 2 inputs, 5 nodes, 3 leaves, depth 2",
    ]


def test_a_mixed_leaf_and_pruning_are_printed() -> None:
    text = grow_id3([[0], [0], [1]], [4, 5, 4], min_samples=9).text()
    assert text.splitlines() == ["4  2 of 3 rows", "0 of 1 inputs, 1 nodes, 1 leaves, depth 0, pruned at S = 9"]


def test_names_that_are_too_few_are_refused(tree: Tree) -> None:
    with pytest.raises(PlacementError, match="1 input and 3 class names were given, the tree has 2 inputs"):
        tree.text(["thumb"])


def test_a_value_never_met_gets_the_nodes_majority(tree: Tree) -> None:
    assert tree.predict([[1, 0], [0, 1], [0, 99], [3, 99]]).tolist() == ["rod", "pen", "pen", "rod"]


def test_rows_of_another_width_are_refused(tree: Tree) -> None:
    with pytest.raises(PlacementError, match="X has 3 inputs, the tree was grown on 2"):
        tree.predict([[0, 0, 0]])


@given(st.integers(0, 999), st.sampled_from([np.int64, np.str_, np.float64, np.bool_]))
def test_what_is_stored_is_what_is_loaded(seed: int, kind: type[np.generic]) -> None:
    random = np.random.default_rng(seed)
    grown = grow_id3(random.integers(0, 3, (20, 4)), random.integers(0, 3, 20).astype(kind))
    loaded = Tree.from_json(grown.to_json())
    assert loaded == grown
    assert [type(label) for label in loaded.classes] == [type(label) for label in grown.classes]


def altered(tree: Tree, number: int, node: Node) -> bytes:
    document = msgspec.to_builtins(tree)
    document["nodes"] = [*document["nodes"][:number], msgspec.to_builtins(node), *document["nodes"][number + 1 :]]
    return msgspec.json.encode(document)


@pytest.mark.parametrize(
    ("number", "node", "reason"),
    [
        (4, Node((0, 0, 2)), "the children of node 0 do not hold its rows"),
        (4, Node((0, 3)), "node 4 needs 3 class counts"),
        (4, Node((0, -1, 4)), "node 4 needs 3 class counts"),
        (4, Node((0, 0, 3), input=1, values=(0, 1)), "not one tree in preorder"),
        (2, Node((1, 0, 0), input=1, values=(0,)), "node 2 is neither a leaf nor a decision"),
        (2, Node((1, 0, 0), gain=0.5), "node 2 is neither a leaf nor a decision"),
        (1, Node((1, 2, 0)), "not one tree in preorder"),
        (1, Node((1, 2, 0), input=2, values=(0, 2)), "node 1 tests input 2, there are 2"),
        (1, Node((1, 2, 0), input=1, values=(2, 0)), "values that do not ascend"),
        (1, Node((1, 2, 0), input=1, gain=-0.5, values=(0, 2)), "node 1 has a negative gain"),
    ],
)
def test_a_stored_tree_that_is_not_sound_is_refused(tree: Tree, number: int, node: Node, reason: str) -> None:
    with pytest.raises(PlacementError, match=reason):
        Tree.from_json(altered(tree, number, node))


@pytest.mark.parametrize("document", [b"", b"{}", b"[1]", b'{"nodes": [], "classes": [], "n_inputs": 0}', b"\xff"])
def test_a_document_that_is_no_tree_is_refused(document: bytes) -> None:
    with pytest.raises(PlacementError, match="this is no stored tree"):
        Tree.from_json(document)


def test_unseparable_leaves_are_counted_but_pruned_ones_are_not() -> None:
    X, y = [[0], [0], [1], [1], [1]], ["a", "b", "a", "b", "a"]
    tree = grow_id3(X, y)
    assert tree.n_undecided == 2
    assert tree.text().splitlines()[-1].endswith("at 2 leaves rows of several classes agree in every input")
    assert grow_id3(X, y, min_samples=3).n_undecided == 1
    assert grow_id3([[0], [1]], ["a", "b"], min_samples=3).n_undecided == 0
    assert "agree" not in grow_id3([[0], [1]], ["a", "b"]).text()
