import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.recordings.spreadsheet import cell, text_of

TEXTS = st.text("'=+-@\t\ra1", max_size=5) | st.text(max_size=5)


@pytest.mark.parametrize("text", ["=1", "+1", "-1", "@a", "\ta", "\ra", "'=1", "''@"])
def test_what_a_spreadsheet_would_compute_has_an_apostrophe_before_it(text: str) -> None:
    assert cell(text) == f"'{text}"


@pytest.mark.parametrize("text", ["", "a", "'a", "1-1", "a=b", "'", "1"])
def test_everything_else_stays_as_it_is(text: str) -> None:
    assert cell(text) == text_of(text) == text


@given(TEXTS)
def test_every_text_comes_back_from_its_cell_and_no_cell_is_a_formula(text: str) -> None:
    assert text_of(cell(text)) == text
    assert not cell(text).startswith(("=", "+", "-", "@", "\t", "\r"))


@given(TEXTS, TEXTS)
def test_two_texts_have_two_cells(one: str, other: str) -> None:
    assert (cell(one) == cell(other)) == (one == other)
