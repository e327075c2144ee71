import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.type_marks import type_marks

NAMES = st.lists(st.text(max_size=20), max_size=30, unique=True)


@given(NAMES)
def test_codes_are_short_and_differ_and_so_do_up_to_24_colours(names: list[str]) -> None:
    marks = type_marks(names)
    assert list(marks) == names
    codes, colours = [code for code, _ in marks.values()], [colour for _, colour in marks.values()]
    assert len(set(codes)) == len(names)
    assert all(0 < len(code) <= 4 for code in codes)
    assert len(set(colours)) >= min(len(names), 24)


@given(NAMES)
def test_marks_do_not_depend_on_the_order_of_the_names(names: list[str]) -> None:
    mixed = sorted(names, key=lambda name: name[::-1])
    assert type_marks(mixed) == type_marks(names)


def test_a_short_name_is_its_code_and_a_long_one_gives_its_initials() -> None:
    marks = type_marks(["PoS", "medium wrap", "minimal way", "none"])
    assert {name: code for name, (code, _) in marks.items()} == {
        "PoS": "PoS",
        "medium wrap": "MW",
        "minimal way": "Mi",
        "none": "none",
    }
    # A type keeps its mark where others come and go, unless they are alike.
    assert marks["PoS"] == type_marks(["PoS", "Lat", "Tip"])["PoS"]


def luminance(lightness: float, chroma: float, hue: float) -> float:
    """Return the relative luminance of WCAG 2 of a colour of CSS's oklch(), by its linear sRGB."""
    a, b = chroma * math.cos(math.radians(hue)), chroma * math.sin(math.radians(hue))
    long = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3
    middle = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3
    short = (lightness - 0.0894841775 * a - 1.2914855480 * b) ** 3
    red = 4.0767416621 * long - 3.3077115913 * middle + 0.2309699292 * short
    green = -1.2684380046 * long + 2.6097574011 * middle - 0.3413193965 * short
    blue = -0.0041960863 * long - 0.7034186147 * middle + 1.7076147010 * short
    red, green, blue = (min(max(part, 0.0), 1.0) for part in (red, green, blue))
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.parametrize("page", [1.0, 0.0081], ids=["light", "dark"])
def test_colours_contrast_with_light_and_dark_pages(page: float) -> None:
    for _, colour in type_marks([f"type {number}" for number in range(24)] + ["none"]).values():
        found = re.fullmatch(r"oklch\(([\d.]+) ([\d.]+) ([\d.]+)\)", colour)
        assert found
        low, high = sorted((luminance(*map(float, found.groups())), page))
        assert (high + 0.05) / (low + 0.05) >= 3
