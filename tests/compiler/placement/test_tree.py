import numpy as np
import pytest

from thenar.compiler.placement.tree import Tree, check_matrix, grow_id3
from thenar.compiler.samples import TrainingError


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
    with pytest.raises(TrainingError, match="1 input and 3 class names were given, the tree has 2 inputs"):
        tree.text(["thumb"])


def test_a_value_never_met_gets_the_nodes_majority(tree: Tree) -> None:
    assert tree.predict([[1, 0], [0, 1], [0, 99], [3, 99]]).tolist() == ["rod", "pen", "pen", "rod"]


def test_rows_of_another_width_are_refused(tree: Tree) -> None:
    with pytest.raises(TrainingError, match="X has 3 inputs, the tree was grown on 2"):
        tree.predict([[0, 0, 0]])


def test_unseparable_leaves_are_counted_but_pruned_ones_are_not() -> None:
    X, y = [[0], [0], [1], [1], [1]], ["a", "b", "a", "b", "a"]
    tree = grow_id3(X, y)
    assert tree.n_undecided == 2
    assert tree.text().splitlines()[-1].endswith("at 2 leaves rows of several classes agree in every input")
    assert grow_id3(X, y, min_samples=3).n_undecided == 1
    assert grow_id3([[0], [1]], ["a", "b"], min_samples=3).n_undecided == 0
    assert "agree" not in grow_id3([[0], [1]], ["a", "b"]).text()


@pytest.mark.parametrize(
    ("X", "reason"),
    [
        ([[0, 1], [2, -3]], "X holds -3 in row 1, column 1"),
        ([[0.0, np.nan]], "X holds nan in row 0, column 1"),
        ([[0.0], [1.5]], "X holds 1.5 in row 1, column 0"),
        ([[np.inf]], "X holds inf in row 0, column 0"),
        ([0, 1], "X has 1 dimensions"),
        ([["a"]], "X holds <U1"),
    ],
)
def test_what_is_no_matrix_of_whole_numbers_is_refused_where_it_is(X: object, reason: str) -> None:
    with pytest.raises(TrainingError, match=reason):
        grow_id3(np.array(X), [0] * len(np.array(X)))


@pytest.mark.parametrize(
    ("y", "reason"),
    [
        ([0], r"y has shape \(1,\), one label for each of the 2 rows"),
        ([0.0, np.nan], "y is nan in row 1"),
        ([0.0, -np.inf], "y is -inf in row 1"),
        (np.array([1.0, np.nan], object), "y is nan in row 1"),
        (np.array([1, "a"], dtype=object), "cannot be sorted"),
    ],
)
def test_labels_that_do_not_fit_are_refused(y: object, reason: str) -> None:
    with pytest.raises(TrainingError, match=reason):
        grow_id3([[0], [1]], np.asarray(y))


def test_no_rows_and_a_negative_number_of_samples_are_refused() -> None:
    with pytest.raises(TrainingError, match="there are no rows"):
        grow_id3(np.zeros((0, 3), bool), [])
    with pytest.raises(TrainingError, match="min_samples is -1"):
        grow_id3([[0]], [0], min_samples=-1)


def test_whole_floats_are_taken_as_whole_numbers() -> None:
    assert check_matrix([[0.0, 7.0]]).tolist() == [[0, 7]]
