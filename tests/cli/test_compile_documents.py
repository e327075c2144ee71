"""What `thenar compile` writes beside a build: report.html and spec/; and the options that choose the switches."""

import html
import json
import re
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from thenar.compiler import GraspSet
from thenar.simulator.handmaps.handmap import hand_map

from .conftest import thenar, works

pytestmark = pytest.mark.slow

QUICK = ("--rounds", 3, "--folds", 0)
TAGS = re.compile(r"<[^>]*>")


def done(result: subprocess.CompletedProcess[str]) -> str:
    assert result.returncode == 0, result.stderr
    assert result.stderr == ""
    return result.stdout


def told(build: Path) -> str:
    """Return the words of a build's report, without its styles and scripts."""
    page = (build / "report.html").read_text()
    page = re.sub(r"<(style|script)\b.*?</\1>", "", page, flags=re.DOTALL)
    return " ".join(html.unescape(TAGS.sub(" ", page)).split())


@pytest.fixture(scope="module")
def gloved(small_set: GraspSet) -> GraspSet:
    """The small set, as if six switches of the shipped glove had recorded it."""
    return replace(small_set, switch_names=hand_map().names[::25][:6])


@pytest.fixture(scope="module")
def gloved_file(gloved: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("gloved") / "set.grasps"
    gloved.save(path)
    return path


def test_the_spec_in_a_build_is_what_spec_writes_of_it(gloved_file: Path, tmp_path: Path) -> None:
    build, spec = tmp_path / "build", tmp_path / "spec"
    done(thenar("compile", gloved_file, "-o", build, *QUICK))
    done(thenar("spec", build, "-o", spec))
    files = [{path.name: path.read_bytes() for path in folder.iterdir()} for folder in (build / "spec", spec)]
    assert files[0] == files[1]
    assert "right hand of 190 mm" in files[0]["cutting.svg"].decode()


def test_a_wiring_is_in_the_report_and_its_spec_agrees(gloved_file: Path, tmp_path: Path) -> None:
    build, spec, glove = tmp_path / "build", tmp_path / "spec", tmp_path / "glove.toml"
    done(thenar("compile", gloved_file, "-o", build, *QUICK, "--no-report", "--propose", glove))
    compiled = works("compile", gloved_file, "-o", build, *QUICK, "--glove", glove)
    # Nobody knows how the set's own joints are wired: the proposed glove measures none.
    assert compiled.stderr.startswith("warning: nothing in 'glove' reads the build's joints")
    assert "A whole scan" in told(build)
    done(thenar("spec", build, "-o", spec))
    for path in spec.iterdir():
        assert path.read_bytes() == (build / "spec" / path.name).read_bytes(), path.name


def test_a_width_bounds_every_sum(gloved_file: Path, tmp_path: Path) -> None:
    bounds = []
    for width in (6, 16):
        build = tmp_path / str(width)
        done(thenar("compile", gloved_file, "-o", build, *QUICK, "--no-report", "--width", width))
        proof = json.loads((build / "build.json").read_bytes())["proof"]
        assert 0 < proof["bound"] <= 2 ** (width - 1) - 1
        bounds.append(proof["bound"])
    assert bounds[0] < bounds[1]
