"""Every degenerate set through every command: an answer or a sentence, never a warning or a traceback."""

import io
import json
import re
import sys
import warnings
from pathlib import Path

import pytest

from thenar.cli import run
from thenar.stability.cases import degenerate
from thenar.stability.inputs.small_sets import make_set, parity

FRAMES = [[0, 0], [0, 1], [1, 0], [1, 1]] * 4
SUBJECTS = ["A"] * 8 + ["B"] * 8
# Each lacks something on one side of a split.
LOPSIDED = {
    "subjects of one class each": make_set(["a"] * 8 + ["b"] * 8, FRAMES, subjects=SUBJECTS),
    "a subject that lacks a class": make_set(["a", "b"] * 4 + ["a", "b", "c", "c"] * 2, FRAMES, subjects=SUBJECTS),
    "a class of one row in four folds": make_set(["a", "b"] * 7 + ["a", "c"], FRAMES),
    "a class in one block of four": make_set(["a", "b"] * 6 + ["c"] * 4, FRAMES),
}

SETS = {
    **degenerate.UNSOLVABLE,
    **degenerate.SOLVABLE,
    "no row": degenerate.SOLVABLE["a class of one row"].rows([]),
    "XOR": parity(2),
    **LOPSIDED,
}
SOLVED = set(degenerate.SOLVABLE)
TRAINABLE = SOLVED | {"XOR", *LOPSIDED}


def command(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """Run `thenar` here, warnings being errors, and return its exit code, output and complaints."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        code = run(list(map(str, words)))
    said = capsys.readouterr()
    assert code in (0, 2)
    assert (code == 2) == said.err.startswith("thenar: ")
    return code, said.out, said.err


@pytest.fixture(params=SETS)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def path(name: str, tmp_path: Path) -> Path:
    SETS[name].save(tmp_path / "set.grasps")
    return tmp_path / "set.grasps"


@pytest.mark.slow
def test_info_tells_what_is_there(name: str, path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = command(capsys, "info", path)
    assert code == 0
    assert SETS[name].size in out
    summary = json.loads(command(capsys, "info", path, "--json")[1])
    assert summary["frames"] == len(SETS[name])


def test_place_chooses_or_says_why_not(name: str, path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, complaint = command(capsys, "place", path, "--tree")
    if not SETS[name].switch_names or not len(SETS[name]):
        assert code == 2
        assert "no switches to place" in complaint or "there are no rows" in complaint
    elif " 0 of " in out or out.startswith("0 of "):
        assert "one grasp type" in out or "agree in every switch" in out


CUTS = (["--by", "subject"], ["--by", "object"])
QUICK = ["--tables", "compositions", "--trainer", "logitboost"]


@pytest.mark.parametrize(
    "cut", [[], *([*cut, *QUICK] for cut in CUTS), *(pytest.param(cut, marks=pytest.mark.slow) for cut in CUTS)]
)
def test_evaluate_gives_rates_or_a_reason(
    name: str, path: Path, cut: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    out = path.with_suffix(".json")
    code, _, _ = command(capsys, "evaluate", path, *cut, "--rounds", 2, "--repeats", 1, "--jobs", 1, "-o", out)
    if code == 0:
        for table in json.loads(out.read_bytes())["tables"]:
            for row in table["rows"]:
                assert 0 <= row["rate"]["low"] <= row["rate"]["mean"] <= row["rate"]["high"] <= 1


@pytest.mark.slow
@pytest.mark.parametrize("folds", [0, 2])
def test_a_build_is_made_verified_and_run_or_refused(
    name: str, path: Path, folds: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    build = path.parent / "build"
    code, _, complaint = command(capsys, "compile", path, "-o", build, "--rounds", 20, "--folds", folds)
    fold = re.search("in fold (.+?): ", complaint)
    names = {"1", "2", *SETS[name].subjects.tolist()}
    assert code == 0 or (folds and fold is not None and fold[1] in names) or name not in TRAINABLE
    if code:
        assert not build.exists()
        return
    assert command(capsys, "verify", build, path)[1].rstrip().endswith("holds")
    lines = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(lines))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert run(["run", str(build), "--replay", str(path)]) == 0
    found = [json.loads(line) for line in lines.getvalue().splitlines()]
    assert len(found) == len(SETS[name])
    if name in SOLVED:
        assert all(line["grasp"] == line["recorded"] for line in found)


def test_an_exclusive_or_is_placed_explained_and_built(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "xor.grasps"
    parity(2).save(path)
    tree, table = command(capsys, "place", path, "--tree")[1].split("Placement", 1)
    assert "s0?  4 rows, no input gains anything alone" in tree
    assert "2 of 2 switches" in table
    assert "at 1 node no switch gains anything alone" in table
    _, made, warned = command(capsys, "compile", path, "-o", tmp_path / "build", "--folds", 0)
    assert "for every row: no single input distinguishes grasp types" in " ".join(warned.split())
    assert "no switch alone gains anything" in made
    assert json.loads((tmp_path / "build" / "build.json").read_bytes())["zero_gain_nodes"] == 1
