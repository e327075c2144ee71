import json
from pathlib import Path

import numpy as np
import pytest

from thenar.cli import run
from thenar.cli.kept import kept_names
from thenar.compiler.glove.propose import propose_harness
from thenar.runtime.harness.writing import harness_to_toml

from ..sets import grasp_set_of
from .conftest import refusal, works

Captured = pytest.CaptureFixture[str]


@pytest.mark.parametrize("method", ["elimination", "cmim", "id3-cost"])
def test_a_method_keeps_so_many_switches_in_its_order(set_file: Path, tmp_path: Path, method: str) -> None:
    stored = tmp_path / "placement.json"
    choice = json.loads(works("place", set_file, "--method", method, "--keep", "3", "--json", "-o", stored).stdout)
    assert json.loads(stored.read_text()) == choice
    assert kept_names(stored) == tuple(kept["name"] for kept in choice["switches"])
    assert (choice["method"], choice["parameter"], choice["n_elements"]) == (method, 3, 6)
    assert 0 < len(choice["switches"]) <= 3


@pytest.fixture(scope="module")
def near_and_far(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Store four types that two bits tell apart: s0 is the one, s8 the other, and s1 the other but for one row."""
    types = np.arange(80) % 4
    switches = np.zeros((80, 10), bool)
    switches[:, 0], switches[:, 1], switches[:, 8] = types & 1, (types >> 1) ^ (np.arange(80) == 27), types >> 1
    path = tmp_path_factory.mktemp("near and far") / "set.grasps"
    grasp_set_of(["cup", "pen", "rod", "key"], types, switches=switches).save(path)
    return path


@pytest.mark.parametrize(
    ("order", "kept"),
    [(None, ["s0", "s1"]), ((0, 8, 2, 3, 4, 5, 6, 7, 1, 9), ["s0", "s8"])],
    ids=["as the names stand", "wired otherwise"],
)
def test_place_and_compile_prefer_switches_on_ports_already_read(
    near_and_far: Path, tmp_path: Path, order: tuple[int, ...] | None, kept: list[str]
) -> None:
    how = ["--keep", "2"]
    if order is not None:
        harness = propose_harness([f"s{number}" for number in order], "mcp23008")  # eight switches a chip
        (tmp_path / "glove.toml").write_text(harness_to_toml(harness))
        how += ["--glove", str(tmp_path / "glove.toml")]
    done = works("place", near_and_far, "--method", "id3-cost", "--json", *how)
    assert sorted(switch["name"] for switch in json.loads(done.stdout)["switches"]) == kept
    how += ["--method", "id3-cost", "--inputs", "switches", "--rounds", "5", "--folds", "0", "--no-report", "--json"]
    done = works("compile", near_and_far, "-o", tmp_path / "build", *how)
    assert sorted(switch["name"] for switch in json.loads(done.stdout)["switches"]) == kept


def test_a_glove_that_lacks_a_switch_says_nothing_of_its_cost(near_and_far: Path, tmp_path: Path) -> None:
    (tmp_path / "glove.toml").write_text(harness_to_toml(propose_harness([f"s{number}" for number in range(9)])))
    how = ["--keep", "2", "--glove", str(tmp_path / "glove.toml")]
    assert "does not wire 's9'" in " ".join(refusal("place", near_and_far, "--method", "id3-cost", *how).split())


def test_the_kept_switches_of_a_choice_of_sensors_can_be_drawn(set_file: Path, tmp_path: Path) -> None:
    placed = tmp_path / "placed.json"
    assert run(["place", str(set_file), "--sensors", "8", "--jobs", "1", "-o", str(placed)]) == 0
    chosen = json.loads(placed.read_text())["chosen"]
    assert {row["kind"] for row in chosen} == {"switch", "joint"}
    assert list(kept_names(placed)) == [row["name"] for row in chosen if row["kind"] == "switch"]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--method", "elimination"], "method 'elimination' needs --keep M"),
        (["--keep", "3"], "method 'id3' takes --prune S and no --keep"),
        (["--method", "cmim", "--keep", "3", "--prune", "4"], "method 'cmim' takes --keep M and no --prune"),
        (["--method", "cmim", "--keep", "3", "--tree"], "--tree prints the tree of the paper's ID3"),
        (
            ["--method", "cmim", "--keep", "3", "--draw", "a.svg"],
            "--draw draws what sensors are worth: leave --method and its options out",
        ),
        (["--inputs", "joints", "--prune", "2"], "there are no switches to place"),
        (["--trainer", "logit", "--prune", "2"], "--trainer is for an accuracy, which evaluate measures"),
        (["--by", "trial", "--prune", "2"], "--by is for an accuracy, which evaluate measures"),
        (["--glove", "GLOVE"], "--glove gives scan costs, and sensors are chosen without"),
        (["--glove", "GLOVE", "--prune", "2"], "--glove gives the scan costs"),
        (["--method", "elimination", "--keep", "3", "--glove", "GLOVE"], "weighs them: elimination-cost, id3-cost"),
    ],
)
def test_what_does_not_go_together_is_one_sentence_and_code_two(
    set_file: Path, tmp_path: Path, options: list[str], reason: str
) -> None:
    (tmp_path / "glove.toml").touch()
    given = [str(tmp_path / "glove.toml") if option == "GLOVE" else option for option in options]
    said = " ".join(refusal("place", set_file, *given).split())
    assert reason in said


@pytest.mark.parametrize(
    "options",
    [
        ["--prune", "8"],
        ["--method", "elimination", "--keep", "3"],
        ["--method", "elimination", "--keep", "3", "--inputs", "switches", "--never", "s1"],
        ["--method", "elimination", "--keep", "3", "--keep-joints", "1", "--robust"],
    ],
    ids=" ".join,
)
def test_place_keeps_what_compile_keeps(set_file: Path, tmp_path: Path, options: list[str]) -> None:
    placed = json.loads(works("place", set_file, *options, "--json").stdout)
    made = ["compile", str(set_file), "-o", str(tmp_path / "build"), *options, "--trainer", "logitboost"]
    manifest = json.loads(works(*made, "--rounds", "2", "--folds", "0", "--no-report", "--json").stdout)
    assert [switch["name"] for switch in manifest["switches"]] == [switch["name"] for switch in placed["switches"]]
    if "kept_joints" in placed:
        assert [joint["name"] for joint in manifest["joints"]] == placed["kept_joints"]
