"""The pattern at 1:1: the SVG, read again, has the switches where the hand has them, in millimetres."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from thenar.compiler.glove.files import spec_files
from thenar.compiler.glove.pattern import LAYERS, MARGIN_MM, page_for
from thenar.compiler.hand import HandShape

from .conftest import manifest_of

SVG = "{http://www.w3.org/2000/svg}"
KEPT = 48
# ISO 216.
SHEETS = {"A4": (210, 297), "A3": (297, 420), "A2": (420, 594), "A1": (594, 841), "A0": (841, 1189)}
SIZES = st.floats(1.0, 2000.0)


@pytest.fixture(scope="module")
def kept(hand: HandShape) -> tuple[str, ...]:
    return hand.names[:KEPT]


@pytest.fixture(scope="module")
def files(hand: HandShape, kept: tuple[str, ...]) -> Mapping[str, bytes]:
    return spec_files(manifest_of(kept), hand=hand)


def groups(svg: bytes) -> dict[str, ET.Element]:
    root = ET.fromstring(svg)
    return {group.attrib["id"]: group for group in root.iter(f"{SVG}g")}


def holes(svg: bytes) -> NDArray[np.float64]:
    """Return the middles of the holes, y up."""
    height = float(ET.fromstring(svg).attrib["height"].removesuffix("mm"))
    circles = groups(svg)["holes"].iter(f"{SVG}circle")
    return np.array([(float(c.attrib["cx"]), height - float(c.attrib["cy"])) for c in circles])


def test_one_unit_of_the_svg_is_one_millimetre(files: Mapping[str, bytes]) -> None:
    root = ET.fromstring(files["cutting.svg"])
    width, height = (root.attrib[name].removesuffix("mm") for name in ("width", "height"))
    assert root.attrib["viewBox"] == f"0 0 {width} {height}"
    assert (float(width), float(height)) == (210.0, 297.0)


def test_holes_lie_to_each_other_as_the_switches_on_the_hand(
    files: Mapping[str, bytes], hand: HandShape, kept: tuple[str, ...]
) -> None:
    drawn, places = holes(files["cutting.svg"]), hand.places[hand.numbers_of(kept)]
    np.testing.assert_allclose(drawn - drawn[0], places - places[0], atol=0.11)


def test_a_longer_hand_is_drawn_larger_with_holes_of_the_same_size(
    files: Mapping[str, bytes], hand: HandShape, kept: tuple[str, ...]
) -> None:
    longer = spec_files(manifest_of(kept), hand=hand.scaled(209.0))
    small, large = holes(files["cutting.svg"]), holes(longer["cutting.svg"])
    np.testing.assert_allclose(large - large[0], (small - small[0]) * 1.1, atol=0.25)
    for name in ("cutting.svg",):
        radii = {c.attrib["r"] for c in groups(longer[name])["holes"].iter(f"{SVG}circle")}
        assert radii == {"1.6"}


def test_the_bar_is_50_mm_long(files: Mapping[str, bytes]) -> None:
    bars = [line.attrib["points"].split() for line in groups(files["cutting.svg"])["scale"]]
    (x0, y0), (x1, y1) = (tuple(map(float, point.split(","))) for point in bars[0])
    assert (x1 - x0, y1 - y0) == (50.0, 0.0)


def test_each_layer_holds_its_part_of_the_hand(files: Mapping[str, bytes], hand: HandShape) -> None:
    layers = groups(files["cutting.svg"])
    assert {name for name, layer in layers.items() if len(layer)} == set(LAYERS)
    (outline,) = layers["outline"].iter(f"{SVG}polygon")
    points = np.array([pair.split(",") for pair in outline.attrib["points"].split()], float)
    np.testing.assert_allclose(np.ptp(points, axis=0), np.ptp(hand.outline, axis=0), atol=1e-3)
    assert len(list(layers["strips"].iter(f"{SVG}polygon"))) == len(hand.strips)
    assert len(list(layers["creases"].iter(f"{SVG}polyline"))) == len(hand.creases)


def test_every_switch_is_named_on_the_drawing(files: Mapping[str, bytes], kept: tuple[str, ...]) -> None:
    texts = [text.text for text in groups(files["cutting.svg"])["names"]]
    for number, name in enumerate(kept, start=1):
        assert texts.count(f"{number}  {name}") == 1
        assert texts.count(str(number)) == 1


@pytest.mark.parametrize("count", [1, 48, 160])
def test_nothing_is_drawn_off_the_page(hand: HandShape, count: int) -> None:
    files = spec_files(manifest_of(hand.names[:count]), hand=hand)
    svg = ET.fromstring(files["cutting.svg"])
    page = [float(svg.attrib[name].removesuffix("mm")) for name in ("width", "height")]
    for shape in svg.iter():
        if "points" in shape.attrib:
            points = np.array([pair.split(",") for pair in shape.attrib["points"].split()], float)
            assert np.all((points >= 4.9) & (points <= np.array(page) - 4.9))
        if shape.tag == f"{SVG}text":
            assert 0 < float(shape.attrib["x"]) < page[0]
            assert 4.9 < float(shape.attrib["y"]) < page[1] - 4.0


def test_a_hand_larger_than_a4_names_the_sheet_to_use(hand: HandShape) -> None:
    readme = spec_files(manifest_of(hand.names), hand=hand)["README.txt"].decode()
    assert "A3 (297 x 420 mm), or 4 A4 sheets, 2 across and 2 down" in " ".join(readme.split())


@given(width=SIZES, height=SIZES)
def test_a_page_holds_the_drawing_and_its_margins(width: float, height: float) -> None:
    page = page_for(width, height)
    assert page.width_mm >= width + 2 * MARGIN_MM
    assert page.height_mm >= height + 2 * MARGIN_MM


@given(width=SIZES, height=SIZES)
def test_no_smaller_sheet_holds_it(width: float, height: float) -> None:
    name = page_for(width, height).name
    for smaller in SHEETS if not name else list(SHEETS)[: list(SHEETS).index(name)]:
        short, long = (side - 2 * MARGIN_MM for side in SHEETS[smaller])
        assert min(width, height) > short or max(width, height) > long


def test_tiles_cover_the_page() -> None:
    assert page_for(100, 100).hint == "one A4 sheet"
    assert page_for(1500, 10).hint == (
        "a sheet (1510 x 20 mm), or 8 A4 sheets, 8 across and 1 down, as a poster without scaling"
    )
