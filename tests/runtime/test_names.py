import pytest

from thenar.runtime.names import list_names, nearest, printable, shortened


def test_near_names_are_suggested_or_else_the_first_there_are() -> None:
    assert nearest("subjct", ["subject", "object"]).startswith(" (did you mean 'subject'")
    assert nearest("zzz", ["subject", "object"]) == " (there are: subject, object)"


def test_long_lists_are_cut_and_counted() -> None:
    assert list_names(["a", "b"]) == "a, b"
    assert list_names([*"abcdefg"]) == "a, b, c, d, e and 2 more"
    assert list_names([*"abcde"], 12) == "a, b, c, d, e and 7 more"


@pytest.mark.parametrize(
    ("foreign", "shown"),
    [
        ("\x1b[31mred", r"\x1b[31mred"),
        ("two\nlines", r"two\nlines"),
        ("\u202egnp.exe", r"\u202egnp.exe"),
        ("\u2028", r"\u2028"),
        ("\ud800", r"\ud800"),
        ("große Kraft, 力", "große Kraft, 力"),
    ],
)
def test_what_a_terminal_would_obey_is_spelled_out(foreign: str, shown: str) -> None:
    assert printable(foreign) == shown


def test_a_long_text_is_cut_in_messages() -> None:
    assert shortened("x" * 100, 10) == "xxxxxxxxxx..."
    assert shortened("x" * 10, 10) == "x" * 10
