"""A trainer of somebody else's: on the command line, in a build, held against its bounds, and run."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler.trainers.base import Training
from thenar.runtime.recipe import Recipe

from .conftest import sixty

pytestmark = pytest.mark.slow

TYPES = ("cup", "pen", "plate")


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    random, labels = np.random.default_rng(5), np.arange(60) % len(TYPES)
    closed = np.array([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 0]], bool)[labels] ^ (random.random((60, 4)) < 0.1)
    codes = np.clip(60 * labels[:, None] + random.normal(60, 15, (60, 2)), 0, 255)
    sixty(closed, codes, ("thumb", "index"), TYPES).save(tmp_path / "set.grasps")
    return tmp_path / "set.grasps"


@pytest.fixture
def installed(install: Callable[[str, str], Any]) -> Any:
    return install("trainer.py", "thenar.trainers")


def test_a_foreign_trainer_is_chosen_by_name_and_builds(installed: Any, recordings: Path, tmp_path: Path) -> None:
    build = tmp_path / "build"
    words = " ".join(installed.thenar("compile", "--help").split())
    assert "--trainer TRAINER What trains the model: logitboost (" in words
    assert "(naive Bayes: inputs are independent within a grasp type)" in words
    assert "--joint-bins INTEGER RANGE Into how many bins naive Bayes cuts a joint. [default: 8] [x>=2]" in words

    given = ("--trainer", "naive-bayes", "--joint-bins", "5", "--folds", "3")
    installed.thenar("compile", str(recordings), "-o", str(build), *given)
    document = json.loads((build / "build.json").read_bytes())
    assert document["options"]["trainer"] == "naive-bayes"
    assert document["options"]["settings"] == {"smoothing": 1.0, "joint_bins": 5.0}
    training, nested = (rate["correct"] / rate["total"] for rate in document["rates"])
    assert training >= nested > 0.8
    assert re.search(r"--trainer naive-bayes .*--smoothing 1 --joint-bins 5", (build / "report.html").read_text())

    found = json.loads(installed.thenar("verify", str(build), str(recordings), "--json"))
    assert found["holds"]
    assert found["collapse_difference"] == 0 < found["integer_difference"] <= found["integer_bound"]
    replayed = installed.thenar("run", str(build), "--replay", str(recordings)).splitlines()
    assert {line.get("grasp") for line in map(json.loads, replayed)} >= set(TYPES)


def test_the_trainer_is_evaluated_as_the_papers_is(installed: Any, recordings: Path) -> None:
    given = ("--trainer", "naive-bayes", "--tables", "compositions", "--protocol", "nested", "--repeats", "1")
    study = json.loads(installed.thenar("evaluate", str(recordings), *given, "--json"))
    assert study["options"]["recipe"]["trainer"] == "naive-bayes"
    (table,) = study["tables"]
    assert table["rows"][0]["rate"]["mean"] > 0.8


def test_a_foreign_trainers_frontier_has_one_stage_and_builds(installed: Any, recordings: Path, tmp_path: Path) -> None:
    words = " ".join(installed.thenar("frontier", "--help").split())
    of_trainer = words[words.index("--trainer TRAINER What trains the model: ") :].partition(" --")[0]
    assert "naive-bayes (" in of_trainer
    assert "--joint-bins INTEGER RANGE Into how many bins naive Bayes cuts a joint. [default: 8] [x>=2]" in words

    folder, build = tmp_path / "frontier", tmp_path / "build"
    given = ("frontier", str(recordings), "-o", str(folder), "--trainer", "naive-bayes")
    few = ("--methods", "elimination", "--repeats", "1", "--finalists", "2", "--jobs", "1")
    found = json.loads(installed.thenar(*given, "--joint-bins", "5", *few, "--json"))
    settings = [point["setting"] for point in found["points"]]
    assert {(each["trainer"], each["rounds"]) for each in settings} == {("naive-bayes", None)}
    assert all(each["settings"] == {"joint_bins": 5.0} for each in settings)
    assert {each["rounds"] for each in found["tried"]} == {None}
    header, *lines = (folder / "frontier.csv").read_text().splitlines()
    assert header.endswith(",trainer,settings")
    assert all(line.endswith(",naive-bayes,joint-bins 5") for line in lines)
    assert "--rounds is not a setting of --trainer naive-bayes" in installed.thenar(*given, "--rounds", "9", code=2)

    point = max(found["points"], key=lambda each: each["rate"]["mean"])
    chosen = ("--from", str(folder / "frontier.json"), "--point", str(point["number"]))
    made = ("compile", str(recordings), "-o", str(build), *chosen)
    assert "--trainer is set by the point" in installed.thenar(*made, "--trainer", "logitboost", code=2)
    installed.thenar(*made)
    document = json.loads((build / "build.json").read_bytes())
    assert document["options"]["trainer"] == "naive-bayes"
    assert document["options"]["settings"]["joint_bins"] == 5.0
    assert [switch["name"] for switch in document["switches"]] == point["switches"]
    assert f"Point {point['number']}: " in (build / "report.html").read_text()
    assert "naive-bayes, joint-bins 5" in (build / "report.html").read_text()


def test_a_setting_selects_its_trainer_and_others_refuse_it(installed: Any, recordings: Path, tmp_path: Path) -> None:
    given = ("compile", str(recordings), "-o", str(tmp_path / "build"), "--no-report", "--folds", "0")
    assert "--rounds is not a setting" in installed.thenar(*given, "--trainer", "naive-bayes", "--rounds", "5", code=2)
    assert "no trainer has all of rounds, smoothing" in installed.thenar(
        *given, "--smoothing", "2", "--rounds", "5", code=2
    )
    assert not (tmp_path / "build").exists()
    assert "trainer: naive-bayes, smoothing 2, joint-bins 8" in installed.thenar(*given, "--smoothing", "2")
    # It takes part where the trainer is chosen.
    alone = len(Training.candidates(Recipe()))
    assert f" inner folds: {alone + 1} fits in " in installed.thenar(*given)
