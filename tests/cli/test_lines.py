import json
import os
import subprocess
import sys
import unicodedata
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.cli.consoles import Text
from thenar.cli.printing import echo, err, out, print_json, table
from thenar.compiler import GraspSet, compile_build
from thenar.compiler.recordings.taxonomy import own
from thenar.drivers.names import shown

HOSTILE = ["\x1b[2J\x1b[31mred", "\x1b]0;title\x07", "\x9b31m", "a\rb", "a\x08b", "\u202egnp", "\u2028", "\x7f"]
TEXTS = st.text() | st.sampled_from(HOSTILE)


def sound(text: str) -> bool:
    """Return whether a terminal shows `text` and obeys nothing in it but line breaks and tabs."""
    found = {unicodedata.category(letter) for letter in text if letter not in "\n\t"}
    return not found & {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}


@given(TEXTS)
def test_shown_text_keeps_its_meaning_and_holds_no_terminal_commands(text: str) -> None:
    assert sound(shown(text))
    assert shown(shown(text)) == shown(text)
    assert text.isprintable() <= (shown(text) == text)


@pytest.mark.parametrize("text", HOSTILE)
def test_no_way_to_print_a_text_lets_a_terminal_obey_it(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    hostile = table([text], title=text)
    hostile.add_row(text)
    hostile.add_row(Text(text, "bold"))
    for console in (out(), err()):
        for printed in (text, Text(text), hostile):
            console.print(printed, soft_wrap=True)
    echo(text)
    echo(text, err=True)
    print_json({text: text})
    said = capsys.readouterr()
    assert sound(said.out + said.err)


def test_styles_are_still_seen_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    out().print(Text("\x1b[2Jred", "red"))
    assert capsys.readouterr().out == "\x1b[31m\\x1b[2Jred\x1b[0m\n"


def test_a_table_is_as_wide_as_what_is_escaped_in_it(capsys: pytest.CaptureFixture[str]) -> None:
    escaped = table(["name"])
    escaped.add_row("\x1b[2J")
    escaped.add_row("plain")
    out().print(escaped)
    lines = capsys.readouterr().out.splitlines()
    assert len({len(line) for line in lines}) == 1
    assert r"\x1b[2J" in "".join(lines)


@given(TEXTS)
def test_json_is_ascii_and_says_the_same(text: str) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdout", file := StringIO())
        print_json([text])
    escaped = file.getvalue()
    assert escaped.isascii()
    assert escaped.replace("\n", "").isprintable()
    assert json.loads(escaped) == [text]


@pytest.fixture(scope="module")
def odd(small_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a set and a build whose names no small encoding has."""
    folder = tmp_path_factory.mktemp("odd")
    types = {"cup": "Größe", "pen": "親指 👩\u200d🔬", "rod": "=1+1"}
    joints = tuple(replace(joint, name=f"ň{joint.name}") for joint in small_set.joints)
    grasp_set = replace(
        small_set,
        switch_names=tuple(f"指{number}" for number in range(6)),
        joints=joints,
        grasps=np.array([types[grasp] for grasp in small_set.grasps.tolist()]),
        taxonomy=own(types.values()),
        subjects=np.array(["Zoë"] * len(small_set)),
    )
    grasp_set.save(folder / "set.grasps")
    compile_build(grasp_set, folder / "build", rounds=5, prune=1)
    return folder


COMMANDS = [
    "info set.grasps",
    "info set.grasps --json",
    "place set.grasps --tree",
    "place set.grasps --json",
    "evaluate set.grasps --folds 2 --repeats 1 --rounds 2 --tables compositions",
    "compile set.grasps -o other --rounds 2 --no-report --folds 0",
    "verify build set.grasps",
    "verify build set.grasps --json",
    "spec build",
    "spec build --json",
    "firmware build --target host -o firmware --overwrite",
    "export set.grasps -o table.csv --columns columns.toml",
    "import table.csv --columns columns.toml -o again.grasps",
    "run build --replay set.grasps",
    "info 親指.grasps",
    "doctor 親指.toml",
]
ASCII = {"PYTHONIOENCODING": "ascii"}
BARE = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "environment"),
    [
        *((line, ASCII) for line in COMMANDS),
        *((COMMANDS[0], other) for other in (BARE, {"PYTHONIOENCODING": "latin-1"}, {"PYTHONIOENCODING": "cp1252"})),
        (COMMANDS[2], BARE),
    ],
)
def test_no_encoding_of_a_terminal_ends_a_command(odd: Path, line: str, environment: dict[str, str]) -> None:
    command = [sys.executable, "-m", "thenar.cli", *line.split()]
    done = subprocess.run(
        command, cwd=odd, env={**os.environ, **environment}, capture_output=True, timeout=300, check=False
    )
    assert b"UnicodeEncodeError" not in done.stderr
    assert b"Traceback" not in done.stderr
    assert done.returncode == (2 if "親指" in line else 0), done.stderr
    encoding = environment.get("PYTHONIOENCODING", "ascii")
    # Lines for machines are UTF-8; their names are as the build has them, joiners included.
    said = done.stdout.decode("utf-8" if "--replay" in line else encoding), done.stderr.decode(encoding)
    assert all(sound(text.replace("\u200d", "")) for text in said)
    if line in ("info set.grasps --json", "place set.grasps --json", "spec build --json"):
        assert "指" in json.dumps(json.loads(said[0]), ensure_ascii=False)
