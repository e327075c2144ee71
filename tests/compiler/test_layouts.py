"""Layouts of one's own: drawings as Inkscape and others write them, lists in TOML, and what must not get through."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.hand import HandShape, MapError
from thenar.compiler.layouts import load_layout

Load = Callable[..., HandShape]
NAMESPACES = 'xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
PAGE = 'width="210mm" height="297mm" viewBox="0 0 2100 2970"'


@pytest.fixture(scope="module")
def load(tmp_path_factory: pytest.TempPathFactory) -> Load:
    """Return a function that loads the text or bytes of a layout."""
    folder = tmp_path_factory.mktemp("layouts")

    def loading(content: str | bytes, name: str = "glove.svg") -> HandShape:
        path = folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return load_layout(path)

    return loading


def svg(inside: str, page: str = PAGE) -> str:
    return f'<?xml version="1.0"?><svg {NAMESPACES} {page}>{inside}</svg>'


def test_shapes_of_inkscape_are_switches_by_their_labels_and_layers_are_parts(load: Load) -> None:
    hand = load(
        svg(
            '<g inkscape:groupmode="layer" inkscape:label="thumb" id="layer1" transform="translate(10,20)">'
            '<circle id="circle7" inkscape:label="pad_1" cx="100" cy="200" r="30"/></g>'
            '<path id="pad_2" d="m 500,100 h 20 v 40 h -20 z"/><path id="path7-1" d="M 0 0 L 9 9"/>'
            '<path id="path8" inkscape:label="outline" d="M 0 0 L 2100 0 L 0 2970 Z"/><text id="title">mine</text>'
        )
    )
    assert (hand.names, hand.part_names, hand.parts.tolist()) == (("pad_1", "pad_2"), ("thumb", "glove"), [0, 1])
    np.testing.assert_allclose(hand.places, [[11.0, 275.0], [51.0, 285.0]], atol=1e-3)
    np.testing.assert_allclose(hand.outline, [[210.0, 297.0], [0.0, 0.0], [0.0, 297.0]], atol=1e-3)
    assert (hand.length_mm, hand.glove) == (None, "glove.svg")


@pytest.mark.parametrize(
    ("page", "mm_a_unit"),
    [
        ('width="100mm" height="200mm" viewBox="0 0 100 200"', 1.0),
        ('width="10cm" height="20cm" viewBox="0 0 1000 2000"', 0.1),
        ('width="2in" height="4in" viewBox="0 0 100 200"', 0.508),
        ('width="96" height="192"', 25.4 / 96),
        ('width="96px" height="192px" viewBox="0 0 48 96"', 25.4 / 48),
    ],
)
def test_units_and_view_box_give_millimetres(load: Load, page: str, mm_a_unit: float) -> None:
    hand = load(svg('<circle id="a" cx="0" cy="0" r="1"/><circle id="b" cx="30" cy="40" r="1"/>', page))
    assert np.hypot(*(hand.places[1] - hand.places[0])) == pytest.approx(50 * mm_a_unit, abs=2e-3)
    assert hand.places[1, 1] < hand.places[0, 1], "y counts upwards"


@settings(max_examples=30)
@given(st.lists(st.tuples(st.integers(0, 2000), st.integers(0, 2900)), min_size=1, max_size=9, unique=True))
def test_a_drawing_and_a_list_of_the_same_places_are_the_same_hand(load: Load, places: list[tuple[int, int]]) -> None:
    drawn = load(svg("".join(f'<circle id="s{n}" cx="{x}" cy="{y}" r="9"/>' for n, (x, y) in enumerate(places))))
    listed = load(
        "[places]\n" + "".join(f"s{n} = [{x / 10}, {297 - y / 10}]\n" for n, (x, y) in enumerate(places)), "list.toml"
    )
    assert drawn.names == listed.names
    np.testing.assert_allclose(drawn.places, listed.places, atol=2e-3)
    assert drawn.radius_mm == pytest.approx(listed.radius_mm, abs=2e-3)


def test_a_list_says_parts_outline_and_what_to_buy(load: Load) -> None:
    hand = load(
        'part_number = "FSR 402"\nbody_mm = 18.3\noutline = [[0, 0], [50, 0], [25, 90]]\n'
        '[places]\na = [1, 2]\nb = [30, 40]\n[parts]\nthumb = ["b"]\n',
        "mine.toml",
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
    ],
)
def test_a_wrong_list_is_refused_with_its_line(load: Load, text: str, message: str) -> None:
    with pytest.raises(MapError, match=message):
        load(text, "wrong.toml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("no svg at all", "is no SVG"),
        ("<html/>", "begins with <html>"),
        (svg('<circle id="circle12" r="3"/>'), "has no switch"),
        (svg('<circle id="a" r="3"/><rect id="a" width="2" height="2"/>'), "two shapes are called 'a'"),
        (svg('<circle id="a" r="3"/>', 'viewBox="0 0 9 9"'), "set a width and a height of the page"),
        (svg('<circle id="a" r="3"/>', 'width="100%" height="100%"'), "set a width and a height of the page"),
        (svg('<circle id="a" cx="9e9" r="3"/>'), "lengths are in mm|cannot be read"),
        (f'<!DOCTYPE svg [<!ENTITY a "b">]>{svg("&a;")[21:]}', "declares XML entities"),
        (f'<!DOCTYPE svg [<!ENTITY a SYSTEM "file:///etc/passwd">]>{svg("&a;")[21:]}', "declares XML entities"),
        (svg('<circle id="a\u202eb" r="3"/>'), "wrong.svg: "),
        (svg("".join(f'<circle id="s{n}" r="3"/>' for n in range(4097))), "more than 4096"),
    ],
)
def test_a_wrong_drawing_is_refused(load: Load, text: str, message: str) -> None:
    with pytest.raises(MapError, match=message):
        load(text, "wrong.svg")


def test_clones_styles_scripts_and_hidden_definitions_do_nothing(load: Load) -> None:
    bomb = "".join(f'<g id="g{n + 1}"><use href="#g{n}"/><use href="#g{n}"/></g>' for n in range(40))
    hand = load(
        svg(
            f'<script>alert(1)</script><style>circle {{ cx: 5 }}</style><defs><circle id="hidden" r="2"/></defs>{bomb}'
            '<circle id="a" cx="100" cy="100" r="20" onclick="alert(1)" style="background: url(http://x/)"/>'
        )
    )
    assert hand.names == ("a",)


@settings(max_examples=150)
@given(st.data())
def test_damaged_drawings_load_or_are_refused(load: Load, data: st.DataObject) -> None:
    whole = svg(
        '<g transform="matrix(1 0 0 1 3 4) rotate(5)"><ellipse id="a" cx="100" cy="200" rx="30" ry="9"/></g>'
        '<path id="outline" d="M 0 0 C 1 1 2 2 3 0 A 3 3 0 0 1 9 9 Q 3 4 5 6 Z"/><polygon id="p" points="0,0 9,9 9,0"/>'
    ).encode()
    at = data.draw(st.integers(0, len(whole) - 1))
    new = data.draw(st.sampled_from([b"", b"\0", b'"', b"<", b"-", b"9e999", b"nan", b"%", b"M", b"\xff", b"(("]))
    try:
        hand = load(whole[:at] + new + whole[at + data.draw(st.integers(0, 9)) :], "damaged.svg")
    except MapError:
        return
    assert np.isfinite(hand.places).all()
    assert np.isfinite(hand.outline).all()


def test_another_ending_is_refused(load: Load) -> None:
    with pytest.raises(MapError, match=r"an \.svg or a \.toml file"):
        load("", "glove.png")
