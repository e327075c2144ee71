import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.words import check_name, comment, inputs_in_words, markdown, string

ANY_TEXT = st.text(max_size=60)


@given(st.from_regex(r"[a-z][a-z0-9_]{0,31}", fullmatch=True))
def test_a_name_is_an_identifier_of_c_in_lower_case(text: str) -> None:
    check_name(text)


@given(ANY_TEXT.filter(lambda text: not re.fullmatch(r"[a-z][a-z0-9_]{0,31}", text)))
def test_any_other_name_is_refused(text: str) -> None:
    with pytest.raises(FirmwareError, match="lower-case letters a to z, digits and _, a letter first, at most 32"):
        check_name(text)


@pytest.mark.parametrize("name", ["", "Hand", "9", "_a", "../x", "left hand", "hänsel", "a" * 33, "a\n"])
def test_names_are_not_rewritten_but_refused(name: str) -> None:
    with pytest.raises(FirmwareError) as refused:
        check_name(name)
    assert str(refused.value).startswith(f"{name!r} cannot be the name: ")


@pytest.mark.parametrize(
    ("counts", "words"),
    [
        ((31, 0), "31 switches"),
        ((0, 16), "16 joints"),
        ((31, 16), "31 switches and 16 joints"),
        ((1, 1), "1 switch and 1 joint"),
    ],
)
def test_inputs_that_there_are_none_of_are_left_out(counts: tuple[int, int], words: str) -> None:
    assert inputs_in_words(*counts) == words


@given(ANY_TEXT)
def test_a_comment_is_one_line_of_ascii_that_neither_ends_nor_opens_one(text: str) -> None:
    said = comment(text)
    assert said.isascii()
    assert said.isprintable()
    assert not any(mark in said for mark in ("*/", "/*", "??/"))


def test_a_comment_escapes_what_is_not_ascii() -> None:
    assert comment("Griff ü 手 🖐\n*/") == "Griff \\xfc \\u624b \\U0001f590\\x0a* /"


@given(ANY_TEXT)
def test_a_text_in_markdown_is_one_line_in_which_every_mark_is_escaped(text: str) -> None:
    said = markdown(text)
    assert said.isascii()
    assert said.isprintable()
    assert re.fullmatch(r"(\\[\\`*_{}\[\]<>()#!|&~]|[^\\`*_{}\[\]<>()#!|&~])*", said)
    assert re.sub(r"\\(.)", r"\1", said) == comment(text)


def test_a_version_stays_as_it_is_in_markdown() -> None:
    assert markdown("0.1.0-rc.1+g12ab") == "0.1.0-rc.1+g12ab"
    assert markdown("1 <img src=x> [a](b)") == r"1 \<img src=x\> \[a\]\(b\)"


def test_a_literal_is_the_text_in_utf_8(tool: Callable[[str], str], tmp_path: Path) -> None:
    texts = ["Lat", 'quo"ted', "back\\slash", "手 grasp", "what??/", "tab\t1", "ü7", ""]
    source = "#include <stdio.h>\nint main(void)\n{\n" + "".join(f"    puts({string(t)});\n" for t in texts) + "}\n"
    (tmp_path / "say.c").write_text(source)
    strict = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    subprocess.run([tool("gcc"), *strict, "say.c", "-o", "say"], cwd=tmp_path, check=True)
    said = subprocess.run([tmp_path / "say"], check=True, capture_output=True).stdout
    assert said.decode().split("\n")[:-1] == texts
