"""Layouts of one's own: lists in TOML, and what must not get through."""

from pathlib import Path

import pytest

from thenar.compiler.hand import HandShape, MapError, load_layout


def load(folder: Path, text: str, name: str = "layout.toml") -> HandShape:
    (folder / name).write_text(text)
    return load_layout(folder / name)


def test_a_list_says_parts_outline_and_what_to_buy(tmp_path: Path) -> None:
    hand = load(
        tmp_path,
        'part_number = "FSR 402"\nbody_mm = 18.3\noutline = [[0, 0], [50, 0], [25, 90]]\n'
        '[places]\na = [1, 2]\nb = [30, 40]\n[parts]\nthumb = ["b"]\n',
    )
    assert (hand.part_number, hand.body_mm, hand.part_names, hand.parts.tolist()) == (
        *("FSR 402", 18.3, ("thumb", "glove")),
        [1, 0],
    )
    assert hand.wrist == (25.0, 0.0)
    assert 2 * hand.radius_mm <= 18.3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[places]\na = [1, 2, 3]\n", "line 2: places"),
        ("[places]\na = [nan, 2]\n", "line 2: places"),
        ("[places]\na = [1, 20000]\n", "line 2: places"),
        ('[places]\na = [1, 2]\n[parts]\nthumb = ["b"]\n', "line 4: parts.thumb: 'b' is not among the places"),
        ('[places]\na = [1, 2]\n[parts]\nx = ["a"]\ny = ["a"]\n', "'a' is on 'x' already"),
        ("[plces]\n", "did you mean 'places'"),
        ("places = {}\n", "has no switch"),
        ('[places]\n"a\\u202eb" = [1, 2]\n', "holds a control character"),
    ],
)
def test_a_wrong_list_is_refused_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(MapError, match=message):
        load(tmp_path, text)


def test_another_ending_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"a \.toml file"):
        load(tmp_path, "", "glove.svg")
