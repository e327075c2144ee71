import pytest

from thenar.compiler.recordings import RecordingError, check_names


@pytest.mark.parametrize(
    ("name", "reason"),
    [("", "is empty"), (" a", "blank"), ("a\n", "blank"), ("a\tb", "control"), ("\ud800", "control"), ("?", "missing")],
)
def test_a_name_that_a_file_format_would_lose_is_refused(name: str, reason: str) -> None:
    with pytest.raises(RecordingError, match=reason):
        check_names("column", ["fine", name])


def test_ordinary_names_of_any_language_pass() -> None:
    check_names("column", ["thumb 1", "親指", "a,b", "it's", "50 %"])


def test_equal_names_are_refused() -> None:
    with pytest.raises(RecordingError, match="switch 'a' occurs twice"):
        check_names("switch", ["a", "b", "a"])
