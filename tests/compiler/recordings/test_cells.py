import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.recordings.cells import bits, integers, names, numbers

WORDS = ["1.5", " 2 ", "-3e2", "", "?", "NA", "nan", "NaN", "inf", "-inf", "1_000", "x", "0x1"]


def test_numbers_tell_missing_from_wrong() -> None:
    parsed = numbers(WORDS)
    assert parsed.values[:3].tolist() == [1.5, 2.0, -300.0]
    assert [word for word, missing in zip(WORDS, parsed.missing, strict=True) if missing] == [
        "",
        "?",
        "NA",
        "nan",
        "NaN",
    ]
    assert [word for word, wrong in zip(WORDS, parsed.wrong, strict=True) if wrong] == [
        "inf",
        "-inf",
        "1_000",
        "x",
        "0x1",
    ]


@given(st.lists(st.sampled_from(WORDS), min_size=1))
def test_a_cell_reads_the_same_in_any_column(words: list[str]) -> None:
    together = numbers(words)
    for row, word in enumerate(words):
        alone = numbers([word])
        assert (alone.missing[0], alone.wrong[0]) == (together.missing[row], together.wrong[row])
        assert alone.values[0] == together.values[row] or np.isnan(alone.values[0])


@pytest.mark.parametrize("word", ["0", "1", "0.0", "1.0", "true", "false", "TRUE", " False "])
def test_a_switch_is_zero_or_one_in_these_spellings(word: str) -> None:
    parsed = bits([word, "?"])
    assert parsed.values[0] == (word.strip().lower() in ("1", "1.0", "true"))
    assert parsed.missing.tolist() == [False, True]
    assert not parsed.wrong.any()


@pytest.mark.parametrize("word", ["2", "0.5", "-1", "yes", "inf", "x"])
def test_anything_else_is_no_switch(word: str) -> None:
    assert bits(["1", word]).wrong.tolist() == [False, True]


def test_a_trial_is_a_whole_number() -> None:
    parsed = integers(["3", "-4.0", "", "1.5", "1e300", "x", str(2**53), str(2**53 + 2)])
    assert parsed.values[:2].tolist() == [3, -4]
    assert parsed.missing.tolist() == [False, False, True, False, False, False, False, False]
    assert parsed.wrong.tolist() == [False, False, False, True, True, True, False, True]


def test_a_name_with_a_control_character_is_wrong_wherever_it_stands() -> None:
    cells = ["a\0", "\0", "a\nb", "fine", "", "?"]
    assert names(cells).wrong.tolist() == [True, True, True, False, False, False]
    assert names(cells).missing.tolist() == [False, False, False, False, True, True]


def test_finite_numbers_are_names_and_zero_has_one_name() -> None:
    parsed = names(np.array([3.0, -0.0, 0.0, np.inf, -np.inf, np.nan, 0.5]))
    assert parsed.values[[0, 1, 2, 6]].tolist() == ["3", "0", "0", "0.5"]
    assert parsed.wrong.tolist() == [False, False, False, True, True, False, False]
    assert parsed.missing.tolist() == [False, False, False, False, False, True, False]
