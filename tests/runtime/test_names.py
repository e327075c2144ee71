import csv
import io
import unicodedata
from xml.etree import ElementTree

import msgspec
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.names import fault, list_names, nearest, printable, shortened


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


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("", "is empty"),
        ("?", "means a missing value"),
        (" a", "begins or ends with a blank"),
        ("a\u3000", "begins or ends with a blank"),
        ("a\tb", r"holds a control character (U+0009)"),
        ("a\x1b[2Jb", r"holds a control character (U+001B)"),
        ("a\x9bb", r"holds a control character (U+009B)"),
        ("a\u202eb", r"holds a control character (U+202E)"),
        ("a\u2066b", r"holds a control character (U+2066)"),
        ("a\u200bb", r"holds a control character (U+200B)"),
        ("a\ufeffb", r"holds a control character (U+FEFF)"),
        ("a\u2028b", r"holds a control character (U+2028)"),
        ("a\ud800b", r"holds a control character (U+D800)"),
        ("a\uffffb", r"holds a control character (U+FFFF)"),
        ("a\U000e0041b", r"holds a control character (U+E0041)"),
        ("a" * 201, "has 201 characters: at most 200"),
    ],
)
def test_what_would_get_lost_or_deceive_is_no_name(name: str, reason: str) -> None:
    assert fault(name).startswith(reason)


@pytest.mark.parametrize(
    "name",
    [
        "thumb 1",
        "=1+1",
        "مى‌خواهم",
        "क्‍ष",
        "e\u0301",
        "👩‍🔬",
        "Ǆ",
        "a\u00a0b",
        "a" * 200,
    ],
)
def test_names_of_every_script_are_good(name: str) -> None:
    assert fault(name) == ""


@given(st.text(st.characters(categories=["L", "M", "N", "P", "S"]), min_size=1, max_size=200))
def test_letters_marks_digits_and_signs_are_good_whatever_their_script(name: str) -> None:
    assert fault(name) == "" or name == "?"


@given(st.text().filter(lambda name: not fault(name)))
def test_a_good_name_survives_every_format_and_terminal(name: str) -> None:
    assert name.encode().decode() == name
    assert name.splitlines() == [name]
    assert msgspec.json.decode(msgspec.json.encode(name)) == name
    assert msgspec.toml.decode(tomli_w.dumps({"key": name, name: 1})) == {"key": name} | {name: 1}
    text = io.StringIO()
    csv.writer(text).writerow([name, name])
    assert next(csv.reader([text.getvalue()])) == [name, name]
    element = ElementTree.Element("name", {"name": name})
    element.text = name
    read = ElementTree.fromstring(ElementTree.tostring(element))
    assert (read.text, read.get("name")) == (name, name)
    assert not {unicodedata.category(letter) for letter in printable(name)} & {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}
