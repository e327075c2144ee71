import re
from pathlib import Path
from xml.etree import ElementTree

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


def test_the_root_is_at_the_top_left_however_large_the_tree_and_the_page_is_narrow(tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    tree = grow_id3(random.random((3000, 40)) < 0.1, random.integers(0, 9, 3000), min_samples=20)
    assert len(tree.nodes) > 200
    draw_tree(tree, tmp_path / "tree.svg", [f"thumb_proximal_{number}" for number in range(40)])
    root = ElementTree.parse(tmp_path / "tree.svg").getroot()
    wide, tall = (float(root.attrib[side].removesuffix("pt")) for side in ("width", "height"))
    assert wide < 1000
    boxes = [group for group in root.iter("{http://www.w3.org/2000/svg}g") if group.get("id", "").startswith("patch_")]
    first = re.findall(r"[ML] ([\d.]+) ([\d.]+)", next(boxes[3].iter("{http://www.w3.org/2000/svg}path")).attrib["d"])
    assert min(float(x) for x, _ in first) == 0
    assert min(float(y) for _, y in first) < 30
    assert max(float(y) for _, y in first) == pytest.approx(tall, abs=0.5)


def test_the_same_tree_makes_the_same_file(tree: Tree, tmp_path: Path) -> None:
    for name in ("a.svg", "b.svg", "a.png", "b.png"):
        draw_tree(tree, tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_single_leaf_can_be_drawn(tmp_path: Path) -> None:
    draw_tree(grow_id3([[0]], ["cup"]), tmp_path / "leaf.png")
    assert (tmp_path / "leaf.png").read_bytes().startswith(b"\x89PNG")


def test_another_kind_of_file_is_refused(tree: Tree, tmp_path: Path) -> None:
    with pytest.raises(PictureError, match=r"ends in \.png or \.svg, not in \.pdf"):
        draw_tree(tree, tmp_path / "tree.pdf")


def test_a_dollar_in_a_name_is_a_dollar(tmp_path: Path) -> None:
    draw_tree(grow_id3([[0], [1]], [0, 1]), tmp_path / "tree.svg", [r"$\left{$"], ["$a$", "b"])
    assert r"<!-- $\left{$? 1 -->" in (tmp_path / "tree.svg").read_text()


def test_a_decision_without_a_gain_says_so_and_a_small_gain_is_one(tmp_path: Path) -> None:
    draw_tree(grow_id3([[0, 0], [0, 1], [1, 0], [1, 1]], [0, 1, 1, 0]), tmp_path / "tree.svg")
    picture = (tmp_path / "tree.svg").read_text()
    assert picture.count("no gain -->") == 1
    X = np.arange(2000)[:, np.newaxis] < 1000
    draw_tree(grow_id3(X, np.arange(2000) % 1000 < 500 + X[:, 0]), tmp_path / "small.svg")
    assert "? 7.21e-07 -->" in (tmp_path / "small.svg").read_text()
