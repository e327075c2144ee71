import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thenar.cli import run
from thenar.cli.kept_files import kept_names
from thenar.compiler import GraspSet
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.scanning.propose import propose_harness

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def crowd_file(small_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    rows = small_set.rows(np.tile(np.arange(60), 4))
    path = tmp_path_factory.mktemp("crowd") / "crowd.grasps"
    replace(rows, subjects=np.repeat([f"p{number:02}" for number in range(12)], 20)).save(path)
    return path


@pytest.mark.parametrize("method", ["elimination", "cmim", "id3-ccp"])
def test_a_method_keeps_so_many_switches_in_its_order(
    set_file: Path, tmp_path: Path, method: str, capsys: pytest.CaptureFixture[str]
) -> None:
    stored = tmp_path / "placement.json"
    assert run(["place", str(set_file), "--method", method, "--keep", "3", "--json", "-o", str(stored)]) == 0
    choice = json.loads(capsys.readouterr().out)
    assert json.loads(stored.read_text()) == choice
    assert kept_names(stored) == tuple(kept["name"] for kept in choice["switches"])
    assert (choice["method"], choice["parameter"], choice["n_switches"], choice["exact"]) == (method, 3, 6, None)
    assert 0 < len(choice["switches"]) <= 3


def glove_of(names: tuple[str, ...], folder: Path) -> Path:
    """Write a harness of eight switches a chip, the last of `names` on a chip of its own."""
    path, others = folder / "glove.toml", [f"other {number}" for number in range(9 - len(names))]
    path.write_text(harness_to_toml(propose_harness([*names[:-1], *others, names[-1]], "mcp23008")))
    return path


@pytest.mark.parametrize("wired", [False, True], ids=["no harness", "harness"])
def test_a_method_that_heeds_cost_chooses_as_compile_does(
    small_set: GraspSet, set_file: Path, tmp_path: Path, wired: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    how = ["--glove", str(glove_of(small_set.switch_names, tmp_path))] if wired else []
    assert run(["place", str(set_file), "--method", "id3-cost", "--keep", "3", "--json", *how]) == 0
    chosen = [kept["name"] for kept in json.loads(capsys.readouterr().out)["switches"]]
    built = ["--placement", "id3-cost", "--keep", "3", "--inputs", "switches", "--rounds", "5", "--no-report", "--json"]
    assert run(["compile", str(set_file), "-o", str(tmp_path / "build"), *built, *how]) == 0
    assert [switch["name"] for switch in json.loads(capsys.readouterr().out)["switches"]] == chosen


def test_a_glove_that_lacks_switches_says_nothing_of_their_cost(
    small_set: GraspSet, set_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    reduced = str(glove_of(small_set.switch_names[1:], tmp_path))
    assert run(["place", str(set_file), "--method", "id3-cost", "--keep", "3", "--glove", reduced]) == 2
    assert "lacks switches of" in capsys.readouterr().err


def test_the_paper_s_placement_is_held_beside_the_best_of_as_many(
    set_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["place", str(set_file), "--prune", "25", "--exact", "--json"]) == 0
    choice = json.loads(capsys.readouterr().out)
    exact = choice["exact"]
    assert (choice["method"], choice["parameter"]) == ("id3", 25)
    assert exact["pairs"] == 1200  # 3 types of 20 rows
    assert exact["alike"] >= exact["best_found"] >= exact["least"]
    assert len(exact["best"]) == len(choice["switches"])


def test_people_read_how_far_a_placement_is_from_the_best(set_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["place", str(set_file), "--method", "random", "--keep", "2", "--exact"]) == 0
    said = capsys.readouterr().out
    for words in ("2 of 6 switches", "of 1,200 pairs of rows", "which is proved", "points from the best"):
        assert words in said


def test_a_standard_placement_is_printed_stored_and_drawn(
    crowd_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored, drawn = tmp_path / "crowd.json", tmp_path / "crowd.svg"
    ask = ["place", str(crowd_file), "--crowd", "--keep", "3", "--method", "cmim", "--jobs", "1"]
    assert run([*ask, "-o", str(stored), "--draw", str(drawn)]) == 0
    said = capsys.readouterr().out
    for words in ("Standard placement", "Recognition of 2 held-out subjects", "worst tenth, %", "of all 12 subjects"):
        assert words in said
    placement = json.loads(stored.read_text())
    assert len(kept_names(stored)) == 3
    assert [point["subjects"] for point in placement["study"]["curve"]] == [2, 2, 2, 5, 5, 5, 10, 10, 10]
    assert drawn.read_text().startswith("<?xml")
    assert run([*ask, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == placement


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--method", "elimination"], "tell this method how many switches to --keep"),
        (["--keep", "3"], "ID3 takes --prune S"),
        (["--method", "cmim", "--keep", "3", "--prune", "4"], "--prune is for ID3"),
        (["--method", "elimintion", "--keep", "3"], "there is no placement method 'elimintion': there are id3"),
        (["--method", "cmim", "--keep", "3", "--tree"], "--tree prints the tree of the paper's ID3"),
        (["--method", "cmim", "--keep", "3", "--draw", "a.svg"], "--draw draws ID3's tree, or a --crowd"),
        (["--crowd", "--keep", "3", "--exact"], "--exact judges one placement"),
        (["--crowd", "--method", "id3", "--keep", "3"], "--crowd takes a method that is told"),
        (["--crowd", "--keep", "3"], "the set has 1 subject(s)"),
        (["--joints"], "--joints is for the methods"),
    ],
)
def test_what_does_not_go_together_is_one_sentence_and_code_two(
    set_file: Path, options: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["place", str(set_file), *options]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert reason in said
    assert "Traceback" not in said


def test_help_shows_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["place", "--help"]) == 0
    assert "thenar place set.grasps --method elimination --keep 16 --exact" in capsys.readouterr().out
