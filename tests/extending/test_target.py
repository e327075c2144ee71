"""A firmware target of somebody else's: listed, written, and what it wrote compiled and asked."""

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler import compile_build
from thenar.runtime.build import Build

from ..conftest import tool
from .conftest import sixty

TYPES = ("cup", "pen", "plate")
MAIN = """\
#define THENAR_GLOVE_IMPLEMENTATION
#include "thenar_glove.hpp"
#include <iostream>

int main()
{
    static std::uint16_t memory[THENAR_GLOVE_MEMORY];
    static thenar hand;
    thenar_init(&hand, &thenar_glove_model, memory);
    for (unsigned closed, code; std::cin >> closed >> code;) {
        for (unsigned i = 0; i < THENAR_GLOVE_SWITCHES; ++i)
            thenar_set_switch(&hand, static_cast<std::uint16_t>(i), (closed >> i & 1u) != 0);
        thenar_set_code(&hand, 0, static_cast<std::uint16_t>(code));
        char name[THENAR_GLOVE_NAME_BYTES];
        thenar_name(&thenar_glove_model, thenar_decide(&hand, thenar_classify(&hand)), name, sizeof name);
        std::cout << name;
        for (unsigned k = 0; k < THENAR_GLOVE_CLASSES; ++k)
            std::cout << ' ' << hand.scores[k];
        std::cout << '\\n';
    }
}
"""
# C leaves members that are not named at zero.
STRICT = (
    *("-std=c++20", "-Wall", "-Wextra", "-Wno-missing-field-initializers", "-Werror"),
    "-fsanitize=address,undefined",
)


@pytest.fixture
def build(tmp_path: Path) -> Build:
    random, labels = np.random.default_rng(3), np.arange(60) % len(TYPES)
    closed = np.array([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 0]], bool)[labels] ^ (random.random((60, 4)) < 0.1)
    made = sixty(closed, 60 * labels[:, None] + random.integers(30, 90, (60, 1)), ("thumb",), TYPES)
    return Build.load(compile_build(made, tmp_path / "build", rounds=10, folds=0).folder)


def test_a_foreign_target_is_listed_and_its_firmware_matches_python(
    install: Callable[[str, str], Any], build: Build, tmp_path: Path
) -> None:
    compiler = tool("g++")
    made = tmp_path / "made"
    installed = install("target.py", "thenar.targets")
    assert "one header for C++20" in installed.thenar("firmware", "--help")
    told = installed.thenar("firmware", str(tmp_path / "build"), "--target", "cpp", "-o", str(made))
    assert not told.startswith("cost for")
    assert told.endswith(f"firmware for cpp; copy {made}/*.hpp to where your compiler finds it\n")
    assert {path.name for path in made.iterdir()} == {"thenar_glove.hpp", "SHA256SUMS"}

    (made / "main.cpp").write_text(MAIN)
    (made / "other.cpp").write_text('#include "thenar_glove.hpp"\n')
    subprocess.run([compiler, *STRICT, "main.cpp", "other.cpp", "-o", "main"], cwd=made, check=True, timeout=120)
    frames = [(closed, code) for closed in range(1 << len(build.manifest.switches)) for code in range(0, 256, 5)]
    asked = "".join(f"{closed} {code}\n" for closed, code in frames)
    said = subprocess.run([made / "main"], input=asked, capture_output=True, text=True, check=True, timeout=60).stdout
    for (closed, code), line in zip(frames, said.splitlines(), strict=True):
        bits = [bool(closed >> number & 1) for number in range(len(build.manifest.switches))]
        assert line.split() == [build.classify(bits, [code]), *map(str, build.scores(bits, [code]))]


@pytest.mark.usefixtures("build")
def test_what_nothing_runs_is_neither_verified_nor_timed(install: Callable[[str, str], Any], tmp_path: Path) -> None:
    installed = install("target.py", "thenar.targets")
    refused = installed.thenar("firmware", str(tmp_path / "build"), "--target", "cpp", "--measure", code=2)
    assert "firmware for cpp cannot be measured here: thenar has no simulator of a cpp" in refused
    assert "cpp" not in installed.thenar("frontier", "--help") + installed.thenar("verify", "--help")
