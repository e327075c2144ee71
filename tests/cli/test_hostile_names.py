"""Files with names that would move a terminal's cursor, set its title or reorder its text: messages only quote them."""

import io
import json
import re
import shutil
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from thenar.cli import run
from thenar.compiler.hand import load_layout
from thenar.compiler.recordings.columns import read_columns
from thenar.drivers.errors import ThenarError
from thenar.runtime import Build
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.preshape import load_preshapes
from thenar.runtime.toml_source import read_source
from thenar.simulator import load_scene

# Escape sequences of one and of two bytes, and marks that reverse the order of letters.
EVIL = "\x1b]0;x\x07\x9b31m\u202e\u2066\x7fa"
QUOTED = json.dumps(EVIL).replace("\x7f", "\\u007f")
UNSAFE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")
GLOVE = 'name = "bench"\n[[stream]]\nport = "/dev/none"\nswitches = ["a"]\n'
TABLE = f"grasp,{EVIL},b\ncup,1,0\npen,0,1\n"

FIELD = json.dumps({EVIL: 1}, ensure_ascii=False)

# A file by its name, its text, and the command that reads it: {file}, {build}, {set}, {new}.
FILES = {
    "key of a glove": ("glove.toml", f"{GLOVE}{QUOTED} = 1\n", "run {build} --glove {file}"),
    "name of a glove": ("glove.toml", f"name = {QUOTED}\n", "run {build} --glove {file}"),
    "switch of a glove": ("glove.toml", GLOVE.replace('"a"', QUOTED), "run {build} --glove {file}"),
    "port of a glove": ("glove.toml", GLOVE.replace('"/dev/none"', QUOTED), "doctor {file} --seconds 0.1"),
    "glove that is no TOML": ("glove.toml", f"{EVIL}\n", "emulate quick --glove {file} -- true"),
    "key of columns": ("columns.toml", f"{QUOTED} = 1\n", "import {set}.csv --columns {file} -o {new}"),
    "role of columns": ("columns.toml", f"label = {QUOTED}\n", "import {set}.csv --columns {file} -o {new}"),
    "head of a table": ("table.csv", TABLE, "import {file} --yes -o {new}"),
    "label of a table": ("table.csv", f"grasp,a\n{EVIL},1\ncup,0\n", "import {file} --yes -o {new}"),
    "key of preshapes": ("hand.toml", f"{QUOTED} = 1\n", "run {build} --glove {good} --preshapes {file}"),
    "key of a scene": ("scene.toml", f"{QUOTED} = 1\n", "simulate {file} -o {new}"),
    "effect of a scene": ("scene.toml", f"[effects]\n{QUOTED} = 1\n", "simulate {file} -o {new}"),
    "key of a layout": ("layout.toml", f"{QUOTED} = 1\n", "draw {set} --layout {file} -o {new}.svg"),
    "key of a board": ("board.toml", f"{QUOTED} = 1\n", "firmware {build} --board {file} -o {new}"),
    "objects": ("objects.toml", f"{QUOTED} = [1]\n", "record --glove {good} --subject A --objects {file} -o {new}"),
    "frontier": ("frontier.json", FIELD, "compile {set} --from {file} -o {new}"),
    "recording": ("a.mcap", EVIL, "segment {build} {file}"),
    "set": ("a.grasps", EVIL, "info {file}"),
    "name of a file": (f"{EVIL}.grasps", "", "info {file}"),
    "name of no file": ("unused", "", f"info none{EVIL}"),
    "name of a folder": (f"{EVIL}.grasps", "", "verify {file} {set}"),
}


@pytest.mark.parametrize("kind", FILES)
def test_a_command_never_prints_what_a_terminal_executes(
    kind: str, set_file: Path, build_folder: Path, tmp_path: Path
) -> None:
    name, text, line = FILES[kind]
    (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "good.toml").write_text(GLOVE)
    shutil.copy(set_file, tmp_path / "set.grasps")
    (tmp_path / "set.grasps.csv").write_text("grasp,a\ncup,1\npen,0\n")
    places = {"file": tmp_path / name, "good": tmp_path / "good.toml", "set": tmp_path / "set.grasps"}
    places |= {"build": build_folder, "new": tmp_path / "new.grasps"}
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = run([word.format_map({key: str(path) for key, path in places.items()}) for word in line.split()])
    said = out.getvalue() + err.getvalue()
    assert not UNSAFE.search(said), ascii(said)
    assert "bug in thenar" not in said
    assert code == 2 or kind == "label of a table"


def _build(path: Path) -> object:
    folder = path.parent / "build"
    manifest = json.loads((folder / "build.json").read_text())
    (folder / "build.json").write_text(json.dumps({**manifest, EVIL: 1}, ensure_ascii=False))
    return Build.load(folder)


LOADERS: dict[str, Callable[[Path], object]] = {
    "key of a glove": load_harness,
    "glove that is no TOML": lambda path: read_source(path, HarnessError).tables(),
    "key of columns": read_columns,
    "key of preshapes": load_preshapes,
    "effect of a scene": lambda path: load_scene(str(path)),
    "key of a layout": load_layout,
    "field of a build": _build,
}


@pytest.mark.parametrize("kind", LOADERS)
def test_an_error_of_the_library_is_safe_to_print(kind: str, build_folder: Path, tmp_path: Path) -> None:
    name, text, _ = FILES.get(kind, ("unused", "", ""))
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(ThenarError) as found:
        LOADERS[kind](tmp_path / name)
    assert not UNSAFE.search(str(found.value)), ascii(str(found.value))
    assert "x1b" in str(found.value) or "U+001B" in str(found.value) or "line 1" in str(found.value)
