"""The code and the colour of each type, as pages show them."""

import random
from collections.abc import Iterator
from typing import Any

import pytest

from thenar.runtime.web.server import Server

pytestmark = pytest.mark.slow

_STYLES = """const done = arguments[1];
    import("/types.js").then(({ typeStyles }) => done([...typeStyles(arguments[0])]));"""
KAMAKURA = ["PoS", "PoI", "PoH", "PoE", "Lat", "Tri", "PMF", "DM", "TVI", "TVII", "TVIII", "PE", "IE", "Add"]


@pytest.fixture
def styles(browser: Any) -> Iterator[Any]:
    with Server("live", "127.0.0.1:0", token=None) as server:
        browser.open(server.url)
        yield lambda names: dict(browser.driver.execute_async_script(_STYLES, names))
        browser.driver.get("about:blank")


def test_every_type_has_its_own_short_code_in_legible_ink(styles: Any) -> None:
    strange = ["<b>", "🎉", "𝐀𝐁", "ﬃ", "é", "É", "a b", "A b", "a-b", " ", "1", "toString", "__proto__"]
    words = [f"{size} {shape}" for size in ("large", "small", "Large") for shape in ("diameter", "disk", "sphere")]
    for names in (KAMAKURA, strange, words, [f"type {number}" for number in range(255)]):
        found = styles([*names, "none", "unknown"])
        codes = [style["code"] for style in found.values()]
        assert len({code.lower() for code in codes}) == len(codes) == len(names) + 2
        assert {len(code) for code in codes} <= {1, 2, 3}
        for name in names:
            style = found[name]
            assert contrast(style["colour"], style["ink"]) >= 4.5
        assert found["none"] == {"code": "–", "colour": None, "ink": None}
    assert {name for name in KAMAKURA if len(name) <= 3 and styles(KAMAKURA)[name]["code"] == name}


def test_styles_are_of_the_names_and_not_of_their_order(styles: Any) -> None:
    shuffled = list(KAMAKURA)
    random.Random(1).shuffle(shuffled)
    found = styles(KAMAKURA)
    assert styles([*shuffled, "PoS"]) == found
    assert len({style["colour"] for style in found.values()}) == len(KAMAKURA)
    # Another type changes few of them.
    more = styles([*KAMAKURA, "Ring"])
    assert sum(found[name] != more[name] for name in KAMAKURA) <= 3


def contrast(one: str, other: str) -> float:
    """Return the contrast of two colours by WCAG."""
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def luminance(colour: str) -> float:
    shares = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    red, green, blue = [share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue
