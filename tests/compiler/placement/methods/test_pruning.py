"""Pruning beside its definition recomputed at every step, and beside scikit-learn."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.tree import DecisionTreeClassifier

from thenar.compiler import grow_id3
from thenar.compiler.placement.gain import gain_bits
from thenar.compiler.placement.methods.id3 import entropy_brought, pruned, weakest_links
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
    leaves: set[int] = set()
    for number in weakest_links(tree, brought):
        g = {}
        for link in below(tree, 0, leaves):
            branch = below(tree, link, leaves)
            g[link] = Fraction(sum(brought[t] for t in branch), len(branch))
        assert number == min(g, key=lambda link: (g[link], -link))
        leaves.add(number)
    assert not below(tree, 0, leaves)


@given(trees(), st.integers(0, 7))
def test_a_placement_is_of_the_largest_tree_that_asks_for_no_more(drawn: tuple[Tree, list[int]], most: int) -> None:
    tree, brought = drawn
    order = weakest_links(tree, brought)
    sizes = [labels_of(tree, set(order[:n])) for n in range(len(order) + 1)]
    assert pruned(tree, order)(most) == next(inputs for inputs in sizes if len(inputs) <= most)


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
    tree = tree_of(model)
    order = weakest_links(tree, entropy_brought(tree))
    assert len(alphas) > 10
    for alpha in (alphas[1:] + alphas[:-1]) / 2:
        theirs = tree_of(DecisionTreeClassifier(criterion="entropy", random_state=0, ccp_alpha=float(alpha)).fit(X, y))
        decisions = sum(node.input is not None for node in theirs.nodes)
        cuts = (set(order[:gone]) for gone in range(len(order) + 1))
        leaves = next(cut for cut in cuts if len(below(tree, 0, cut)) == decisions)
        assert labels_of(tree, leaves) == theirs.inputs
