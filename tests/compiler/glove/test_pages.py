"""Sheets: large enough, and no larger than needed."""

from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.glove.pages import MARGIN_MM, page_for

# ISO 216.
SHEETS = {"A4": (210, 297), "A3": (297, 420), "A2": (420, 594), "A1": (594, 841), "A0": (841, 1189)}
SIZES = st.floats(1.0, 2000.0)


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


def test_sheets_stand_or_lie() -> None:
    assert page_for(200, 287).name == page_for(287, 200).name == "A4"
    assert page_for(200.1, 287).name == page_for(287, 200.1).name == "A3"
    assert page_for(1500, 10).name == ""


def test_tiles_cover_the_page() -> None:
    assert page_for(100, 100).hint == "one A4 sheet"
    assert page_for(1500, 10).hint == (
        "a sheet (1510 x 20 mm), or 8 A4 sheets, 8 across and 1 down, as a poster without scaling"
    )
