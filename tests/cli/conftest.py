"""A small set of grasps as a file, and a build of it, for the sub-commands to work on."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copytree
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from thenar.cli import run
from thenar.compiler import GraspSet, compile_build
from thenar.compiler.recordings.graspset import Joint

from ..sets import grasp_set_of


@contextmanager
def _redirected(name: str, number: int, path: Path) -> Iterator[None]:
    """Let a standard stream, of this process and of those that it starts, lead to a file."""
    before, kept = getattr(sys, name), os.dup(number)
    before.flush()
    try:
        with path.open("w+", encoding="utf-8") as file:
            os.dup2(file.fileno(), number)
            setattr(sys, name, file)
            yield
    finally:
        setattr(sys, name, before)
        os.dup2(kept, number)
        os.close(kept)


def thenar(*arguments: object) -> "subprocess.CompletedProcess[str]":
    """Run `thenar` in this process, which spares the start of Python and all imports."""
    words = list(map(str, arguments))
    with TemporaryDirectory() as folder, Path(os.devnull).open() as nothing, pytest.MonkeyPatch.context() as changed:
        out, err = Path(folder, "out"), Path(folder, "err")
        changed.setattr(sys, "stdin", nothing)
        with _redirected("stdout", 1, out), _redirected("stderr", 2, err):
            code = run(words)
        return subprocess.CompletedProcess(words, code, out.read_text("utf-8"), err.read_text("utf-8"))


def works(*arguments: object) -> "subprocess.CompletedProcess[str]":
    """Run `thenar`, which does as it is told."""
    done = thenar(*arguments)
    assert done.returncode == 0, done.stderr
    return done


def refusal(*arguments: object) -> str:
    """Return why `thenar` refuses: the user is mistaken, and nothing was printed but what is wrong."""
    done = thenar(*arguments)
    assert (done.returncode, done.stdout, "Traceback" in done.stderr) == (2, "", False), done.stderr
    return done.stderr


@pytest.fixture(scope="session")
def small_set() -> GraspSet:
    random = np.random.default_rng(4)
    labels = np.arange(60) % 3
    centres = np.array([[60, 90], [120, 70], [100, 160]])
    closed = np.array([[0, 0, 1, 1, 0, 1], [0, 1, 0, 1, 1, 0], [1, 0, 0, 1, 1, 1]], bool)
    switches = closed[labels] ^ (random.random((60, 6)) < 0.1)
    codes = centres[labels] + random.integers(-20, 20, (60, 2))
    return grasp_set_of(["cup", "pen", "rod"], labels, switches=switches, codes=codes)


@pytest.fixture(scope="session")
def set_file(small_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings") / "set.grasps"
    small_set.save(path)
    return path


@pytest.fixture
def grasps(tmp_path: Path) -> Path:
    """Store four rows of two types, two people and two objects."""
    four = grasp_set_of(
        ["mug", "ball"],
        [0, 1, 0, 1],
        switches=[[0, 1], [1, 1], [0, 1], [1, 1]],
        switch_names=("thumb", "palm"),
        codes=[[3], [5], [3], [6]],
        joints=(Joint("index", "deg", 0, 10.0, 1, 10.5),),
        subjects=np.array(["A", "B", "A", "A"]),
        objects=np.array(["x", "x", "y", "x"]),
    )
    four.save(tmp_path / "set.grasps")
    return tmp_path / "set.grasps"


@pytest.fixture(scope="session")
def small_build(small_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_build(small_set, tmp_path_factory.mktemp("small") / "build", rounds=10, folds=0).folder


@pytest.fixture
def build_folder(small_build: Path, tmp_path: Path) -> Path:
    return copytree(small_build, tmp_path / "build")


@pytest.fixture
def importing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in a folder of its own, and without a terminal."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(os, "isatty", lambda descriptor: False)


def columns_toml() -> Path:
    """Return the file of the detected columns."""
    (path,) = Path().glob("*columns.toml")
    return path


def imported(*arguments: str, output: str = "set.grasps") -> GraspSet:
    """Import with the detected columns, and again with those that were written: the sets are the same."""
    words = ["import", *arguments, "-o", output, "--overwrite"]
    assert run([*words, "--yes"]) == 0
    found = Path(output).read_bytes()
    assert run([*words, "--columns", str(Path(output).with_suffix(".columns.toml"))]) == 0
    assert Path(output).read_bytes() == found
    return GraspSet.load(output)


def refused(*arguments: str) -> str:
    """Return the sentence by which an import is refused, after what it has found."""
    done = thenar("import", *arguments, "-o", "set.grasps", "--overwrite")
    said = done.stderr
    assert (done.returncode, said[:8], said.count("\n"), "Traceback" in said) == (2, "thenar: ", 1, False)
    return said
