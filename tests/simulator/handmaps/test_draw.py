import re
from dataclasses import replace
from io import BytesIO
from xml.etree import ElementTree

import numpy as np
import pytest

from thenar.compiler.hand import MapError
from thenar.compiler.pictures import PictureError, painting
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import own, published
from thenar.simulator.handmaps.draw import Dot, Panel, Picture, all_switches, colour, contacts, draw, kept
from thenar.simulator.handmaps.handmap import hand_map

HAND = hand_map()
NAMES = HAND.names
SVG = "{http://www.w3.org/2000/svg}"


def grasp_set(switches: np.ndarray, names: tuple[str, ...], grasps: list[str]) -> GraspSet:
    n = len(grasps)
    taxonomy = published("kamakura14") if "Tip" in grasps else own(["Tip", "Lat", "a < b & $c$"])
    texts = (np.array(grasps, dtype=str), taxonomy, np.full(n, "A"), np.full(n, "pen"), np.arange(n))
    return GraspSet(switches, names, np.zeros((n, 0), np.uint16), (), *texts)


@pytest.fixture
def two_types() -> GraspSet:
    """Three Tip and one Lat: switch 5 closes in all Tip, switch 9 in Lat only, switch 7 never; only these are known."""
    bits = np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]], bool)
    return grasp_set(bits, (NAMES[5], NAMES[9], NAMES[7]), ["Tip", "Tip", "Tip", "Lat"])


@pytest.fixture
def pads(two_types: GraspSet) -> GraspSet:
    """Return the same rows with a pad in place of switch 9, and one that reads noise only."""
    newtons = np.array([[10, 3], [0, 0], [12, 1], [900, 4]], np.uint16)
    columns = tuple(Joint(NAMES[place], "N", 0, 0.0, 1000, 1.0) for place in (9, 11))
    return replace(
        two_types,
        switches=two_types.switches[:, [0, 2]],
        switch_names=(NAMES[5], NAMES[7]),
        taxels=newtons,
        taxel_columns=columns,
    )


def titles(svg: bytes, hand: int = 0) -> dict[int, str]:
    """Return what hovering over each circle of a hand says."""
    found = {}
    for group in ElementTree.parse(BytesIO(svg)).getroot().iter(f"{SVG}g"):
        match = re.fullmatch(rf"dot-{hand}-(\d+)", group.get("id", ""))
        if match:
            assert int(match[1]) not in found, "drawn twice"
            assert len(list(group.iter(f"{SVG}path"))) == 1
            found[int(match[1])] = str(group.findtext(f"{SVG}title"))
    return found


def test_every_switch_is_drawn_once_and_named_on_hovering() -> None:
    svg = draw(all_switches(HAND), "svg")
    assert titles(svg) == {number: f"{number} {name}" for number, name in enumerate(NAMES)}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["svg", "png"])
def test_the_same_picture_gives_the_same_bytes(kind: str, two_types: GraspSet) -> None:
    assert draw(contacts(HAND, two_types, per_grasp=True), kind) == draw(
        contacts(HAND, two_types, per_grasp=True), kind
    )


def test_shades_are_the_shares_of_grasps_in_which_a_switch_closed(two_types: GraspSet) -> None:
    picture = contacts(HAND, two_types, per_grasp=False)
    (panel,) = picture.panels
    assert picture.bar_top == 0.75
    assert (panel.dots[5].shade, panel.dots[9].shade, panel.dots[7].shade) == (1.0, 0.25 / 0.75, None)
    assert panel.dots[9].hint == f"{NAMES[9]}: closed in 1 of 4 grasps (25.0%)"
    assert panel.note == "4 grasps, 1.0 switches closed on average"
    assert [number for number, dot in enumerate(panel.dots) if not dot.absent] == [5, 7, 9]


def test_each_grasp_type_that_has_rows_gets_a_hand_on_one_scale(two_types: GraspSet) -> None:
    picture = contacts(HAND, two_types, per_grasp=True)
    assert [panel.title for panel in picture.panels] == ["Lat: Lateral grip", "Tip: Tip grip"]
    lateral, tip = (panel.dots for panel in picture.panels)
    assert (lateral[9].shade, lateral[5].shade) == (1.0, None)
    assert (tip[5].shade, tip[9].shade) == (1.0, None)
    svg = draw(picture, "svg")
    assert titles(svg, 1)[5] == f"{NAMES[5]}: closed in 3 of 3 grasps (100.0%)"
    assert len(titles(svg, 0)) == len(titles(svg, 1)) == 160


def test_a_set_in_which_nothing_ever_closed_is_all_hollow(two_types: GraspSet) -> None:
    held = grasp_set(np.zeros((2, 1), bool), (NAMES[0],), ["Tip", "Tip"])
    picture = contacts(HAND, held, per_grasp=False)
    more = grasp_set(np.array([[0], [1], [0]], bool), (NAMES[0],), ["Tip", "none", "Tip"])
    assert contacts(HAND, more, per_grasp=False) == picture
    assert [panel.title for panel in contacts(HAND, more, per_grasp=True).panels] == ["Tip: Tip grip"]
    assert all(dot.shade is None for dot in picture.panels[0].dots)
    assert draw(picture, "png").startswith(b"\x89PNG")


def test_kept_switches_are_full_and_bear_their_order() -> None:
    (panel,) = kept(HAND, [("A", [NAMES[40], NAMES[3], NAMES[159]])]).panels
    full = {number: dot.mark for number, dot in enumerate(panel.dots) if dot.shade is not None}
    assert full == {40: "1", 3: "2", 159: "3"}
    assert panel.note == "3 of 160 kept: thumb 1, index 1, middle 0, ring 0, little 0, palm 1"
    hints = titles(draw(kept(HAND, [("A", [NAMES[40]])]), "svg"))
    assert hints[40] == "index_middle_5: kept, number 1"
    assert hints[41] == f"{NAMES[41]}: left out"


def test_names_in_titles_are_neither_formulas_nor_markup() -> None:
    svg = draw(kept(HAND, [("a < b & $c$", [NAMES[0]])]), "svg")
    ElementTree.parse(BytesIO(svg))
    assert b"<!-- a &lt; b &amp; $c$ -->" in svg
    dots = (Dot("a < b & c"), *(Dot("") for _ in NAMES[1:]))
    assert titles(draw(Picture(HAND, (Panel("", "", dots),), "", "switch"), "svg"))[0] == "a < b & c"


def test_sets_that_are_not_of_this_glove_are_refused() -> None:
    bits = np.ones((1, 2), bool)
    with pytest.raises(MapError, match="'s1' is no switch of the glove"):
        contacts(HAND, grasp_set(bits, (NAMES[0], "s1"), ["Tip"]), per_grasp=False)
    with pytest.raises(MapError, match="without rows"):
        contacts(HAND, grasp_set(bits[:0], (NAMES[0], NAMES[1]), []), per_grasp=False)


def test_only_svg_and_png_are_drawn() -> None:
    with pytest.raises(PictureError, match=r"not in \.pdf"):
        draw(all_switches(HAND), "pdf")


def test_taxels_are_drawn_by_how_often_they_were_pressed(pads: GraspSet) -> None:
    picture = contacts(HAND, pads, per_grasp=False)
    assert picture.full == "share of grasps in which the switch closed or the taxel was pressed"
    hints = [picture.panels[0].dots[place].hint.partition(": ")[2] for place in (5, 9, 11)]
    assert hints == [
        "touched in 3 of 4 grasps (75.0%)",
        "touched in 1 of 4 grasps (25.0%)",
        "touched in 0 of 4 grasps (0.0%)",
    ]
    only = replace(pads, switches=pads.switches[:, :0], switch_names=())
    assert contacts(HAND, only, per_grasp=False).hollow == "never pressed"


def test_levels_mark_their_taxel_which_bears_the_number_of_the_first() -> None:
    dots = kept(HAND, [("A", (NAMES[3], f"{NAMES[9]}>400", f"{NAMES[9]}>90"))]).panels[0].dots
    assert (dots[3].mark, dots[9].mark) == ("1", "2")
    assert dots[9].hint == f"{NAMES[9]}: kept, number 2 (counts >400), number 3 (counts >90)"
    with pytest.raises(MapError, match="no switch of the glove"):
        kept(HAND, [("A", (NAMES[3], "pad>400"))])


def test_shades_darken_steadily_in_grey_and_begin_darker_than_hollow() -> None:
    with painting(7):
        colours = [colour(Dot("", shade), graded=True) for shade in np.linspace(0.0, 1.0, 21).tolist()]
        assert colour(Dot(""), graded=True) == "white"
    grey = [np.dot([int(c[i : i + 2], 16) for i in (1, 3, 5)], [0.299, 0.587, 0.114]) for c in colours]
    assert (np.diff([255.0, *grey]) < -5).all()
