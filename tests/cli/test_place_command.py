import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thenar.cli import run
from thenar.compiler import GraspSet, grow_id3


def test_the_placement_is_printed_for_people(set_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["place", str(set_file)]) == 0
    said = capsys.readouterr().out
    for words in ("cumulative share", "s4", "0.6008", "37.9%", "of 6 switches", "of 1.585 bits"):
        assert words in said


def test_the_placement_is_printed_for_machines_and_stored(
    set_file: Path, small_set: GraspSet, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored = tmp_path / "placement.json"
    assert run(["place", str(set_file), "--prune", "5", "--json", "-o", str(stored)]) == 0
    placement = json.loads(capsys.readouterr().out)
    assert json.loads(stored.read_text()) == placement
    tree = grow_id3(small_set.switches, small_set.grasps, min_samples=5)
    assert [chosen["number"] for chosen in placement["switches"]] == list(tree.inputs)
    assert [chosen["name"] for chosen in placement["switches"]] == [f"s{number}" for number in tree.inputs]
    assert [chosen["gain_bits"] for chosen in placement["switches"]] == list(tree.gains)
    assert placement["switches"][-1]["cumulative_share"] == pytest.approx(sum(tree.gains) / np.log2(3))
    assert (placement["prune"], placement["n_elements"], placement["rows"]) == (5, 6, 60)
    assert placement["fingerprint"] == small_set.fingerprint()


def test_the_tree_is_printed_with_the_names_of_switches_and_grasps(
    set_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["place", str(set_file), "--tree"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("s4?  60 rows, gain 0.6008 bits")
    assert "pen  2 rows" in said


def test_the_tree_is_drawn(set_file: Path, tmp_path: Path) -> None:
    assert run(["place", str(set_file), "--draw", str(tmp_path / "tree.svg")]) == 0
    assert "<!-- s4" in (tmp_path / "tree.svg").read_text()


def test_nodes_at_which_nothing_gains_are_said(
    small_set: GraspSet, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bits = np.array([[0, 0], [0, 1], [1, 0], [1, 1]], bool)
    replace(small_set.rows([0, 1, 4, 3]), switches=bits, switch_names=("a", "b")).save(tmp_path / "xor.grasps")
    assert run(["place", str(tmp_path / "xor.grasps")]) == 0
    assert "at 1 node no switch gains anything alone" in capsys.readouterr().out


def test_a_set_without_switches_is_refused(
    small_set: GraspSet, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    replace(small_set, switches=small_set.switches[:, :0], switch_names=()).save(tmp_path / "joints.grasps")
    assert run(["place", str(tmp_path / "joints.grasps")]) == 2
    assert capsys.readouterr().err == "thenar: there are no switches to place: the set holds joints only\n"


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--draw", "tree.pdf"], "tree.pdf: the name of the output file must end in .svg or .png"),
        (["--draw", "no/such/tree.svg"], "There is no folder 'no/such'"),
        (["--tree", "--json"], "--tree is for people and --json for machines"),
        (["--prune", "-1"], "-1 is not in the range x>=0"),
    ],
)
def test_a_mistake_is_one_sentence_and_code_two(
    set_file: Path, options: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["place", str(set_file), *options]) == 2
    assert reason in capsys.readouterr().err


@pytest.mark.parametrize(
    ("grasps", "options", "remark"),
    [
        (["cup", "cup"], [], "all rows are of one grasp type: there is nothing to distinguish"),
        (["cup", "pen"], ["--prune", "3"], "no decision was made: the 2 rows are fewer than S = 3"),
        (["cup", "pen"], [], "at 1 leaf rows of several classes agree in every switch"),
    ],
)
def test_a_placement_of_no_switch_says_why(
    small_set: GraspSet,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    grasps: list[str],
    options: list[str],
    remark: str,
) -> None:
    two = replace(small_set.rows([0, 0]), grasps=np.array(grasps))
    two.save(tmp_path / "two.grasps")
    assert run(["place", str(tmp_path / "two.grasps"), *options]) == 0
    said = capsys.readouterr().out
    assert "0 of 6 switches" in said
    assert remark in said
    assert sum(words in said for words in ("one grasp type:", "no decision was made", "agree in every switch")) == 1
