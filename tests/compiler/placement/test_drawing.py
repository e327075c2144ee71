import re
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import grow_id3
from thenar.compiler.pictures import PictureError
from thenar.compiler.placement.drawing import draw_tree
from thenar.compiler.placement.tree import Tree


@pytest.fixture
def tree() -> Tree:
    random = np.random.default_rng(3)
    return grow_id3(random.integers(0, 3, (30, 4)), random.integers(0, 3, 30))


def test_every_decision_and_leaf_is_in_the_picture(tree: Tree, tmp_path: Path) -> None:
    draw_tree(tree, tmp_path / "tree.svg", ["thumb", "palm", "ring", "wrist"], ["cup", "pen", "rod"])
    picture = (tmp_path / "tree.svg").read_text()
    for name, number in (("thumb", 0), ("palm", 1), ("ring", 2), ("wrist", 3)):
        assert picture.count(f"{name}? ") == sum(node.input == number for node in tree.nodes)
    leaves = sum(
        len(re.findall(rf"<!-- (?:open|closed|2): {name} \d+/\d+ -->", picture)) for name in ("cup", "pen", "rod")
    )
    assert leaves == tree.n_leaves
    assert "<!-- switch? gain in bits -->" in picture


def test_the_same_tree_makes_the_same_file(tree: Tree, tmp_path: Path) -> None:
    for name in ("a.svg", "b.svg", "a.png", "b.png"):
        draw_tree(tree, tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_another_kind_of_file_is_refused(tree: Tree, tmp_path: Path) -> None:
    with pytest.raises(PictureError, match=r"ends in \.png or \.svg, not in \.pdf"):
        draw_tree(tree, tmp_path / "tree.pdf")


def test_a_dollar_in_a_name_is_a_dollar(tmp_path: Path) -> None:
    draw_tree(grow_id3([[0], [1]], [0, 1]), tmp_path / "tree.svg", [r"$\left{$"], ["$a$", "b"])
    assert r"<!-- $\left{$? 1 -->" in (tmp_path / "tree.svg").read_text()
