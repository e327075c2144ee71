import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.evaluation.rates import Rate, interval
from thenar.compiler.text import (
    DASH,
    NBSP,
    cell,
    counted,
    duration,
    listed,
    microseconds,
    percent,
    sentence,
    text_of,
)

RATE = Rate("pooled", "trials", (1,), 1, 1, 0.9634, 0.9512, 0.97249)


def test_rates_have_one_digit_and_a_missing_one_is_a_dash() -> None:
    assert percent(0.9634) == "96.3 %"
    assert percent(0.9634, NBSP) == f"96.3{NBSP}%"
    assert interval(RATE) == "96.3 [95.1, 97.2]"
    assert interval(None) == DASH


@pytest.mark.parametrize(
    ("us", "said"),
    [
        *((0.0, "0 µs"), (61.54, "61.5 µs"), (440, "440 µs"), (999.4, "999 µs")),
        *((999.6, "1 ms"), (2052, "2.05 ms"), (1.5e6, "1.5 s")),
    ],
)
def test_a_time_has_three_digits(us: float, said: str) -> None:
    assert duration(us) == said


def test_a_column_of_microseconds_has_no_more_digits_than_can_be_read() -> None:
    assert [microseconds(us) for us in (48.12, 99.96, 1736.1)] == ["48.1", "100.0", "1,736"]


def test_counts_agree_with_their_nouns() -> None:
    assert [counted(n, "node") for n in (0, 1, 2000)] == ["0 nodes", "1 node", "2,000 nodes"]
    assert counted(2, "leaf", "leaves") == "2 leaves"


def test_lists_and_sentences() -> None:
    assert [listed(parts) for parts in ([], ["a"], ["a", "b"], ["a", "b", "c"])] == ["", "a", "a and b", "a, b and c"]
    assert sentence("no tools were there") == sentence("no tools were there.") == "No tools were there."


TEXTS = st.text("'=+-@\t\ra1", max_size=5) | st.text(max_size=5)


@pytest.mark.parametrize("text", ["=1", "+1", "-1", "@a", "\ta", "\ra", "'=1", "''@"])
def test_what_a_spreadsheet_would_compute_has_an_apostrophe_before_it(text: str) -> None:
    assert cell(text) == f"'{text}"


@pytest.mark.parametrize("text", ["", "a", "'a", "1-1", "a=b", "'", "1"])
def test_everything_else_stays_as_it_is(text: str) -> None:
    assert cell(text) == text_of(text) == text


@given(TEXTS)
def test_texts_survive_their_cells_which_are_never_formulas(text: str) -> None:
    assert text_of(cell(text)) == text
    assert not cell(text).startswith(("=", "+", "-", "@", "\t", "\r"))
