"""Trees beside ID3 written out (recursion over lists, gains as exact products of whole numbers) and beside others'."""

import sys
from collections import Counter
from fractions import Fraction
from math import prod
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.tree import DecisionTreeClassifier

from thenar.compiler import grow_id3
from thenar.compiler.placement.tree import Tree

Rows = list[tuple[tuple[int, ...], int]]
Data = tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]


class Grown(NamedTuple):
    """A node: its rows by class, and for a decision its input and children by value."""

    counts: tuple[int, ...]
    input: int | None
    children: dict[int, Any]


def split(rows: Rows, column: int) -> dict[int, Rows]:
    return {value: [row for row in rows if row[0][column] == value] for value in sorted({x[column] for x, _ in rows})}


def score(rows: Rows, column: int) -> Fraction:
    """Return e to the power of the score: the product of n_vc ^ n_vc over the product of n_v ^ n_v."""
    parts = split(rows, column).values()
    inside = prod(m**m for part in parts for m in Counter(y for _, y in part).values())
    return Fraction(inside, prod(len(part) ** len(part) for part in parts))


def written_out(rows: Rows, classes: list[int], min_samples: int) -> Grown:
    counts = tuple(sum(y == c for _, y in rows) for c in classes)
    varying = [c for c in range(len(rows[0][0])) if len({x[c] for x, _ in rows}) > 1]
    if max(counts) == len(rows) or len(rows) < min_samples or not varying:
        return Grown(counts, None, {})
    # max returns the first of equal ones.
    best = max(varying, key=lambda column: score(rows, column))
    children = {value: written_out(part, classes, min_samples) for value, part in split(rows, best).items()}
    return Grown(counts, best, children)


def as_grown(tree: Tree, number: int = 0) -> Grown:
    node = tree.nodes[number]
    children = {v: as_grown(tree, child) for v, child in zip(node.values, tree.children[number], strict=True)}
    return Grown(node.counts, node.input, children)


@st.composite
def data(draw: st.DrawFn, most_values: int = 4, most_rows: int = 40) -> Data:
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, d, values = draw(st.integers(1, most_rows)), draw(st.integers(1, 6)), draw(st.integers(1, most_values))
    return random.integers(0, values, (n, d)), random.integers(0, draw(st.integers(1, 4)), n)


@given(data(), st.integers(0, 8))
def test_the_tree_is_the_papers_steps_written_out(drawn: Data, min_samples: int) -> None:
    X, y = drawn
    rows = [(tuple(x), int(label)) for x, label in zip(X.tolist(), y, strict=True)]
    assert as_grown(grow_id3(X, y, min_samples)) == written_out(rows, sorted(set(y.tolist())), min_samples)


@given(data(most_values=2))
def test_bits_are_the_same_as_bool_and_as_numbers(drawn: Data) -> None:
    X, y = drawn
    assert grow_id3(X.astype(bool), y) == grow_id3(X, y)


def grasps(n: int, seed: int) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.intp]]:
    random = np.random.default_rng(seed)
    labels = random.integers(0, 6, n)
    return (random.random((6, 30)) < 0.4)[labels] ^ (random.random((n, 30)) < 0.08), labels


@pytest.mark.parametrize("seed", range(4))
def test_scikit_learns_entropy_tree_is_ours_where_gains_differ(seed: int) -> None:
    X, y = grasps(6000, seed)
    ours = grow_id3(X, y, min_samples=300)
    theirs = DecisionTreeClassifier(criterion="entropy", min_samples_split=300, random_state=0).fit(X, y).tree_
    assert tuple(theirs.feature.tolist()) == tuple(-2 if n.input is None else n.input for n in ours.nodes)
    assert ours.depth == theirs.max_depth
    assert ours.n_leaves == theirs.n_leaves


def test_many_rows_and_a_subtracted_sibling_make_the_tree_of_direct_counts() -> None:
    X, y = grasps(20_000, 9)
    tree = grow_id3(X, y, min_samples=500)
    subsets = {0: np.arange(len(y))}
    for number, node in enumerate(tree.nodes):
        rows = subsets.pop(number)
        assert np.bincount(y[rows], minlength=6).tolist() == list(node.counts)
        for value, child in zip(node.values, tree.children[number], strict=True):
            subsets[child] = rows[X[rows, node.input] == value]


def test_a_mixed_leaf_predicts_the_majority_ties_the_lowest_class() -> None:
    X = np.array([[0]] * 3 + [[1]] * 4)
    tree = grow_id3(X, ["b", "a", "b", "c", "b", "b", "c"])
    assert tree.predict([[0], [1]]).tolist() == ["b", "b"]


def test_a_tree_deeper_than_pythons_recursion_grows_and_is_printed() -> None:
    n = 2 * sys.getrecursionlimit() + 200
    X, y = np.eye(n, dtype=bool), np.arange(n) % 2
    chain = grow_id3(X, y)
    assert chain.depth > sys.getrecursionlimit()
    assert (chain.predict(X) == y).all()
    assert chain.text().count("\n") == len(chain.nodes)


def test_an_input_of_more_than_256_values_is_one_decision() -> None:
    X = np.column_stack([np.zeros(600, int), np.arange(600) // 2 * 7])
    tree = grow_id3(X, np.arange(600) // 2 % 3)
    assert tree.inputs == (1,)
    assert tree.nodes[0].values == tuple(range(0, 2100, 7))
