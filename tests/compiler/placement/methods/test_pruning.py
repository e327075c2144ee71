"""Pruning beside its definition recomputed at every step, beside Quinlan's recursion, and beside scikit-learn."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.tree import DecisionTreeClassifier

from thenar.compiler import grow_id3
from thenar.compiler.placement.gain import gain_bits
from thenar.compiler.placement.methods.id3 import entropy_brought, error_reduction, weakest_links
from thenar.compiler.placement.tree import Node, Tree


@st.composite
def trees(draw: st.DrawFn) -> tuple[Tree, list[int]]:
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, d = draw(st.integers(1, 40)), draw(st.integers(1, 6))
    tree = grow_id3(random.random((n, d)) < 0.5, random.integers(0, 4, n))
    return tree, [int(random.integers(-2, 6)) if node.input is not None else 0 for node in tree.nodes]


def below(tree: Tree, number: int, leaves: set[int]) -> list[int]:
    """Return the decisions at and below a node, in preorder."""
    if tree.nodes[number].input is None or number in leaves:
        return []
    return [number, *(found for child in tree.children[number] for found in below(tree, child, leaves))]


def labels_of(tree: Tree, leaves: set[int]) -> tuple[int, ...]:
    return tuple(dict.fromkeys(label for n in below(tree, 0, leaves) if (label := tree.nodes[n].input) is not None))


@given(trees())
def test_the_weakest_link_of_all_that_stand_goes_each_time(drawn: tuple[Tree, list[int]]) -> None:
    tree, brought = drawn
    path = weakest_links(tree, brought)
    leaves: set[int] = set()
    for number, strength in zip(path.order, path.strengths, strict=True):
        g = {}
        for link in below(tree, 0, leaves):
            branch = below(tree, link, leaves)
            g[link] = Fraction(sum(brought[t] for t in branch), len(branch))
        assert (number, strength) == (min(g, key=lambda link: (g[link], -link)), min(g.values()))
        leaves.add(number)
    assert not below(tree, 0, leaves)
    assert all(weaker <= stronger for weaker, stronger in pairwise(path.strengths))


@given(trees(), st.integers(0, 7), st.integers(0, 3))
def test_a_placement_is_of_the_largest_tree_that_asks_for_no_more(
    drawn: tuple[Tree, list[int]], most: int, least: int
) -> None:
    tree, brought = drawn
    path = weakest_links(tree, brought)
    least = min(least, len(path.order))
    sizes = [labels_of(tree, set(path.order[:n])) for n in range(len(path.order) + 1)]
    assert path.n_inputs == tuple(map(len, sizes))
    assert path.placement(most, least) == next(inputs for inputs in sizes[least:] if len(inputs) <= most)


def quinlan(tree: Tree, spared: list[int], number: int) -> tuple[int, list[int]]:
    """Return what the subtree spares once pruned bottom-up, and its decisions."""
    if tree.nodes[number].input is None:
        return 0, []
    parts = [quinlan(tree, spared, child) for child in tree.children[number]]
    total = spared[number] + sum(part for part, _ in parts)
    return (total, [number, *(n for _, kept in parts for n in kept)]) if total > 0 else (0, [])


@given(trees())
def test_links_that_spare_nothing_are_those_of_reduced_error_pruning(drawn: tuple[Tree, list[int]]) -> None:
    tree, spared = drawn
    path = weakest_links(tree, spared)
    leaves = set(path.order[: path.n_useless])
    assert below(tree, 0, leaves) == quinlan(tree, spared, 0)[1]


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_errors_are_counted_on_the_rows_held_out(seed: int, n: int) -> None:
    random = np.random.default_rng(seed)
    X, y = random.random((n + 20, 5)) < 0.5, random.integers(0, 3, n + 20)
    y[:3] = [0, 1, 2]
    tree = grow_id3(X[:20], y[:20])
    spared = error_reduction(tree, X[20:], y[20:])
    root = int((y[20:] != tree.nodes[0].majority).sum())
    assert root - sum(spared) == int((tree.predict(X[20:]) != y[20:]).sum())
    assert all(spared[number] == 0 for number, node in enumerate(tree.nodes) if node.input is None)


def tree_of(model: DecisionTreeClassifier) -> Tree:
    """Return scikit-learn's tree as ours: it stands in preorder as well."""
    grown = model.tree_
    counts = np.rint(grown.value[:, 0] * grown.n_node_samples[:, None]).astype(int)
    nodes = []
    for number, (left, right) in enumerate(zip(grown.children_left, grown.children_right, strict=True)):
        if left < 0:
            nodes.append(Node(tuple(counts[number].tolist())))
        else:
            gain = gain_bits(counts[[left, right]].T)
            nodes.append(Node(tuple(counts[number].tolist()), int(grown.feature[number]), gain, (0, 1)))
    return Tree(tuple(nodes), tuple(model.classes_.tolist()), grown.n_features)


@pytest.mark.parametrize("seed", range(6))
def test_trees_pruned_by_entropy_are_scikit_learns(seed: int) -> None:
    random = np.random.default_rng(seed)
    y = random.integers(0, 4, 150)
    X = (random.random((4, 12)) < 0.5)[y] ^ (random.random((150, 12)) < 0.25)
    model = DecisionTreeClassifier(criterion="entropy", random_state=0).fit(X, y)
    alphas = np.unique(model.cost_complexity_pruning_path(X, y).ccp_alphas.round(9))
    path = weakest_links(tree_of(model), entropy_brought(tree_of(model)))
    assert len(alphas) > 10
    for alpha in (alphas[1:] + alphas[:-1]) / 2:
        pruned = DecisionTreeClassifier(criterion="entropy", random_state=0, ccp_alpha=float(alpha)).fit(X, y)
        gone = sum(strength <= alpha * 150 * 2**30 for strength in path.strengths)
        assert labels_of(path.tree, set(path.order[:gone])) == tree_of(pruned).inputs
