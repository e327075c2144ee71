"""What `thenar compile` writes beside a build: report.html and spec/; and the options that choose the switches."""

import html
import json
import re
import shlex
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from thenar.compiler import GraspSet
from thenar.simulator.handmaps.handmap import hand_map

from .conftest import thenar

pytestmark = pytest.mark.slow

QUICK = ("--rounds", 3, "--folds", 0)
TAGS = re.compile(r"<[^>]*>")


def done(result: subprocess.CompletedProcess[str]) -> str:
    assert result.returncode == 0, result.stderr
    assert result.stderr == ""
    return result.stdout


def refused(result: subprocess.CompletedProcess[str]) -> str:
    assert result.returncode == 2
    assert "Traceback" not in result.stderr
    return " ".join(result.stderr.split())


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


def test_no_report_leaves_out_the_report_and_the_spec(gloved_file: Path, tmp_path: Path) -> None:
    done(thenar("compile", gloved_file, "-o", tmp_path / "build", *QUICK, "--no-report"))
    made = sorted(path.name for path in (tmp_path / "build").iterdir())
    assert made == ["build.json", "ensemble.bin", "firmware", "hand.json", "tables.bin"]


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
    compiled = thenar("compile", gloved_file, "-o", build, *QUICK, "--glove", glove)
    assert compiled.returncode == 0, compiled.stderr
    # Nobody knows how the set's own joints are wired: the proposed glove measures none.
    assert compiled.stderr.startswith("warning: nothing in 'glove' reads the build's joints")
    assert "A whole scan" in told(build)
    done(thenar("spec", build, "-o", spec))
    for path in spec.iterdir():
        assert path.read_bytes() == (build / "spec" / path.name).read_bytes(), path.name


def test_a_method_that_takes_a_number_keeps_it(gloved_file: Path, tmp_path: Path) -> None:
    build = tmp_path / "build"
    done(thenar("compile", gloved_file, "-o", build, *QUICK, "--method", "elimination", "--keep", 2))
    document = json.loads((build / "build.json").read_bytes())
    assert len(document["switches"]) == 2
    assert document["options"]["placement"] == "elimination"
    assert document["options"]["keep"] == 2
    assert "No tree: the switches were chosen by elimination." in told(build)


@pytest.mark.parametrize(
    ("given", "because"),
    [
        (("--method", "elimination"), "needs --keep"),
        (("--method", "elimination", "--keep", 2, "--prune", 3), "takes --keep M and no --prune"),
        (("--keep", 2), "takes --prune S and no --keep"),
        (("--method", "crystal-ball", "--keep", 2), "there is no method 'crystal-ball'"),
    ],
)
def test_a_method_gets_its_own_parameter(
    gloved_file: Path, tmp_path: Path, given: tuple[object, ...], because: str
) -> None:
    result = thenar("compile", gloved_file, "-o", tmp_path / "build", *QUICK, *given)
    assert because in refused(result)
    assert not (tmp_path / "build").exists()


def test_a_width_bounds_every_sum(gloved_file: Path, tmp_path: Path) -> None:
    bounds = []
    for width in (6, 16):
        build = tmp_path / str(width)
        done(thenar("compile", gloved_file, "-o", build, *QUICK, "--no-report", "--width", width))
        proof = json.loads((build / "build.json").read_bytes())["proof"]
        assert 0 < proof["bound"] <= 2 ** (width - 1) - 1
        bounds.append(proof["bound"])
    assert bounds[0] < bounds[1]


def test_the_commands_of_a_report_make_the_build_again(gloved_file: Path, tmp_path: Path) -> None:
    build, again = tmp_path / "build", tmp_path / "again"
    given = ("--rounds", 3, "--folds", 2, "--method", "elimination", "--keep", 3, "--width", 12, "--max-bins", 5)
    done(thenar("compile", gloved_file, "-o", build, *given))
    (said,) = re.findall(r"thenar compile SET\.grasps -o build/ --prune.*", (build / "report.html").read_text())
    words = {"SET.grasps": str(gloved_file), "build/": str(again)}
    done(thenar(*(words.get(word, word) for word in shlex.split(said)[1:])))
    for path in build.rglob("*"):
        if path.is_file():
            assert path.read_bytes() == (again / path.relative_to(build)).read_bytes(), path.name
