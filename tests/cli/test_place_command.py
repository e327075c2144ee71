import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.cli import run
from thenar.compiler import GraspSet, grow_id3

from .conftest import refusal, works


def test_the_placement_is_printed_for_people(set_file: Path) -> None:
    said = works("place", set_file, "--method", "id3").stdout
    for words in ("cumulative share", "s4", "0.6008", "37.9%", "of 6 switches", "of 1.585 bits"):
        assert words in said


def test_the_placement_is_printed_for_machines_and_stored(set_file: Path, small_set: GraspSet, tmp_path: Path) -> None:
    stored = tmp_path / "placement.json"
    placement = json.loads(works("place", set_file, "--prune", "5", "--json", "-o", stored).stdout)
    assert json.loads(stored.read_text()) == placement
    tree = grow_id3(small_set.switches, small_set.grasps, min_samples=5)
    assert [chosen["number"] for chosen in placement["switches"]] == list(tree.inputs)
    assert [chosen["name"] for chosen in placement["switches"]] == [f"s{number}" for number in tree.inputs]
    assert [chosen["gain_bits"] for chosen in placement["switches"]] == list(tree.gains)
    assert placement["switches"][-1]["cumulative_share"] == pytest.approx(sum(tree.gains) / np.log2(3))
    assert (placement["prune"], placement["n_elements"], placement["rows"]) == (5, 6, 60)
    assert placement["fingerprint"] == small_set.fingerprint()


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--tree", "--json"], "--tree is for people and --json for machines"),
        (["--prune", "-1"], "-1 is not in the range x>=0"),
    ],
)
def test_a_mistake_is_one_sentence_and_code_two(set_file: Path, options: list[str], reason: str) -> None:
    assert reason in refusal("place", set_file, *options)


@pytest.mark.parametrize(
    ("grasps", "options", "remark"),
    [
        (["cup", "cup"], ["--method", "id3"], "all rows are of one grasp type: there is nothing to distinguish"),
        (["cup", "pen"], ["--prune", "3"], "no decision was made: the 2 rows are fewer than S = 3"),
        (["cup", "pen"], ["--method", "id3"], "at 1 leaf rows of several classes agree in every switch"),
    ],
)
def test_a_placement_of_no_switch_says_why(
    small_set: GraspSet,
    tmp_path: Path,
    grasps: list[str],
    options: list[str],
    remark: str,
) -> None:
    two = replace(small_set.rows([0, 0]), grasps=np.array(grasps))
    two.save(tmp_path / "two.grasps")
    said = works("place", tmp_path / "two.grasps", *options).stdout
    assert "0 of 6 switches" in said
    assert remark in said
    assert sum(words in said for words in ("one grasp type:", "no decision was made", "agree in every switch")) == 1


PRICES = """
[[part]]
name = "snap-action switch"
price = 1.5
sensors = ["s?"]

[[part]]
name = "flex sensor"
price = 11
sensors = ["*"]
"""


def sensors(*asked: object) -> dict[str, Any]:
    """Return the JSON document of `thenar place` of sensors."""
    found: dict[str, Any] = json.loads(works("place", *asked, "--json", "--jobs", "1").stdout)
    return found


def test_the_curve_is_printed_and_drawn(set_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["place", str(set_file), "--draw", str(tmp_path / "curve.svg"), "--jobs", "1"]) == 0
    said = capsys.readouterr()
    for words in ("What sensors are worth", "worth of the last", "as many by ID3", "chosen in folds", "of 8 sensors"):
        assert words in said.out
    assert "rough, from the first of 4 folds: 1: " in said.err
    assert (tmp_path / "curve.svg").read_text().startswith("<?xml")


def test_what_is_there_what_is_missed_least_and_what_replaces(set_file: Path) -> None:
    best = [row["name"] for row in sensors(set_file, "--sensors", 3)["chosen"]]
    kept = sensors(set_file, "--sensors", 3, "--have", "s2")
    assert kept["chosen"][0]["name"] == "s2"
    dropped = sensors(set_file, "--drop", 2)
    assert len(dropped["chosen"]) == 6
    assert len(dropped["left_out"]) == 2
    other = sensors(set_file, "--sensors", 3, "--instead-of", best[0])
    names = [row["name"] for row in other["chosen"]]
    assert {*best[1:]} < {*names}
    assert names[-1] not in best
    alone = sensors(set_file, "--have", ",".join(best), "--instead-of", best[0])
    assert alone["chosen"] == other["chosen"]


@pytest.mark.slow
def test_a_price_is_kept_to_and_parts_are_named(set_file: Path, tmp_path: Path) -> None:
    prices = tmp_path / "prices.toml"
    prices.write_text(PRICES)
    found = sensors(set_file, "--price", 14, "--prices", prices)
    assert sum(row["price"] for row in found["chosen"]) <= 14
    said = works("place", set_file, "--sensors", "2", "--prices", prices, "--jobs", "1").stdout
    assert "snap-action switch" in said or "flex sensor" in said
    assert "2 of 8 sensors, price" in said


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--price", "5"], "--price: the price of s0, s1, s2, s3, s4 and 3 more is unknown: add it to --prices"),
        (["--sensors", "2", "--keep", "3"], "choose among switches, pads and joints alike: leave --keep out"),
        (["--sensors", "2", "--method", "cmim"], "leave --method out"),
        (["--sensors", "1", "--have", "s0,s1"], "--have names 2, --sensors allows 1: keep more"),
        (["--drop", "8"], "--drop 8: there are 8 sensors, and one has to be left"),
        (["--drop", "1", "--sensors", "2"], "--drop says how many sensors are left"),
        (["--sensors", "2", "--instead-of", "s9"], "s9 is not among the chosen sensors"),
        (["--drop", "1", "--method", "id3"], "--drop and --instead-of are for sensors"),
        (["--sensors", "2", "--prices", "prices.toml"], "prices.toml has no part for 's0'"),
        (["--sensors", "2", "--have", "s9"], "there is no input 's9'"),
    ],
)
def test_a_mistake_with_sensors_is_one_sentence(
    set_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    options: list[str],
    reason: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "prices.toml").write_text('[[part]]\nname = "flex"\nprice = 1\nsensors = ["j*"]\n')
    said = refusal("place", set_file, *options)
    assert (reason in said, said.count("\n")) == (True, 1), said
