import re
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.words import check_name, comment, markdown, string

from ...conftest import tool

ANY_TEXT = st.text(max_size=60)


@given(st.from_regex(r"[a-z][a-z0-9_]{0,31}", fullmatch=True))
def test_a_name_is_an_identifier_of_c_in_lower_case(text: str) -> None:
    check_name(text)


@given(ANY_TEXT.filter(lambda text: not re.fullmatch(r"[a-z][a-z0-9_]{0,31}", text)))
def test_any_other_name_is_refused(text: str) -> None:
    with pytest.raises(FirmwareError, match="lower-case letters a to z, digits and _, a letter first, at most 32"):
        check_name(text)


@given(ANY_TEXT)
def test_a_comment_is_one_ascii_line_that_cannot_break_out(text: str) -> None:
    said = comment(text)
    assert said.isascii()
    assert said.isprintable()
    assert not any(mark in said for mark in ("*/", "/*", "??/"))


@given(ANY_TEXT)
def test_markdown_text_is_one_line_with_every_mark_escaped(text: str) -> None:
    said = markdown(text)
    assert said.isascii()
    assert said.isprintable()
    assert re.fullmatch(r"(\\[\\`*_{}\[\]<>()#!|&~]|[^\\`*_{}\[\]<>()#!|&~])*", said)
    assert re.sub(r"\\(.)", r"\1", said) == comment(text)


def test_a_version_stays_as_it_is_in_markdown() -> None:
    assert markdown("0.1.0-rc.1+g12ab") == "0.1.0-rc.1+g12ab"
    assert markdown("1 <img src=x> [a](b)") == r"1 \<img src=x\> \[a\]\(b\)"


def test_a_literal_is_the_text_in_utf_8(tmp_path: Path) -> None:
    texts = ["Lat", 'quo"ted', "back\\slash", "手 grasp", "what??/", "tab\t1", "ü7", ""]
    source = "#include <stdio.h>\nint main(void)\n{\n" + "".join(f"    puts({string(t)});\n" for t in texts) + "}\n"
    (tmp_path / "say.c").write_text(source)
    strict = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    subprocess.run([tool("gcc"), *strict, "say.c", "-o", "say"], cwd=tmp_path, check=True)
    said = subprocess.run([tmp_path / "say"], check=True, capture_output=True).stdout
    assert said.decode().split("\n")[:-1] == texts
