"""A small set of grasps as a file, and a build of it, for the sub-commands to work on."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest

from thenar.cli import run
from thenar.compiler import GraspSet, compile_build
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.recordings.taxonomy import own

Thenar = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="session")
def thenar_process() -> Thenar:
    """Run `thenar` in a process of its own: slower, for what a process has alone."""

    def in_process(*arguments: object) -> "subprocess.CompletedProcess[str]":
        command = [sys.executable, "-m", "thenar.cli", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    return in_process


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


@pytest.fixture(scope="session")
def thenar(tmp_path_factory: pytest.TempPathFactory) -> Thenar:
    """Run `thenar` in this process, which spares the start of Python and all imports."""
    folder = tmp_path_factory.mktemp("printed")

    def here(*arguments: object) -> "subprocess.CompletedProcess[str]":
        words, out, err = list(map(str, arguments)), folder / "out", folder / "err"
        with Path(os.devnull).open() as nothing, pytest.MonkeyPatch.context() as changed:
            changed.setattr(sys, "stdin", nothing)
            with _redirected("stdout", 1, out), _redirected("stderr", 2, err):
                code = run(words)
        return subprocess.CompletedProcess(words, code, out.read_text("utf-8"), err.read_text("utf-8"))

    return here


@pytest.fixture(scope="session")
def small_set() -> GraspSet:
    random = np.random.default_rng(4)
    labels = np.arange(60) % 3
    centres = np.array([[60, 90], [120, 70], [100, 160]])
    return GraspSet(
        switches=np.array([[0, 0, 1, 1, 0, 1], [0, 1, 0, 1, 1, 0], [1, 0, 0, 1, 1, 1]], bool)[labels]
        ^ (random.random((60, 6)) < 0.1),
        switch_names=tuple(f"s{number}" for number in range(6)),
        codes=(centres[labels] + random.integers(-20, 20, (60, 2))).astype(np.uint16),
        joints=tuple(Joint(f"j{number}", "deg", 0, 0.0, 255, 127.5) for number in range(2)),
        grasps=np.array(["cup", "pen", "rod"])[labels],
        taxonomy=own(["cup", "pen", "rod"]),
        subjects=np.full(60, "A"),
        objects=np.full(60, "thing"),
        trials=np.arange(60),
    )


@pytest.fixture(scope="session")
def set_file(small_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings") / "set.grasps"
    small_set.save(path)
    return path


@pytest.fixture(scope="session")
def small_build(small_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_build(small_set, tmp_path_factory.mktemp("small") / "build", rounds=10, folds=0).folder


@pytest.fixture
def build_folder(small_build: Path, tmp_path: Path) -> Path:
    return copytree(small_build, tmp_path / "build")
