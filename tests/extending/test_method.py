"""A placement method of another package is one like any other."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sklearn.feature_selection import chi2

from thenar.compiler import GraspSet

from .conftest import sixty

pytestmark = pytest.mark.slow
Install = Callable[[str, str], Any]


@pytest.fixture(scope="module")
def small_set() -> GraspSet:
    patterns = np.array([[0, 0, 1, 1, 0, 1], [0, 1, 0, 1, 1, 0], [1, 0, 0, 1, 1, 1]], bool)
    return sixty(patterns[np.arange(60) % 3] ^ (np.random.default_rng(4).random((60, 6)) < 0.1))


def test_a_method_of_another_package_is_listed_chosen_by_and_compared(
    install: Install, small_set: GraspSet, tmp_path: Path
) -> None:
    file = tmp_path / "set.grasps"
    small_set.save(file)
    there = install("method.py", "thenar.methods")

    for command in ("place", "compile", "frontier", "evaluate"):
        said = " ".join(there.thenar(command, "--help").split())
        assert "Those that depend most on the grasp type, alone, by Pearson's chi-squared (baseline)." in said

    bits = small_set.switches
    closed, opened = (chi2(values, small_set.labels)[0] for values in (bits, ~bits))
    placed = json.loads(there.thenar("place", str(file), "--method", "chi2", "--keep", "4", "--json"))
    assert [kept["number"] for kept in placed["switches"]] == np.argsort(-(closed + opened), kind="stable")[:4].tolist()

    quick = ("--rounds", "2", "--finalists", "1", "--repeats", "1", "--jobs", "1", "--json")
    settled = ("--trainer", "logitboost", "--shrinkage", "1", "--max-bins", "65536")
    found = json.loads(
        there.thenar(
            *("frontier", str(file), "-o", str(tmp_path / "found"), "--methods", "chi2"),
            *quick,
            *settled,
        )
    )
    assert {point["setting"]["placement"]["method"] for point in found["points"]} == {"chi2"}

    study = json.loads(
        there.thenar(
            *("evaluate", str(file), "--tables", "baselines", "--baselines", "chi2", "--folds", "2", "--repeats", "1"),
            *("--rounds", "2", "--json"),
        )
    )
    assert [row["name"] for row in study["tables"][0]["rows"]] == ["ID3", "chi2", "random"]


def test_a_fault_of_a_method_names_its_module(install: Install, small_set: GraspSet, tmp_path: Path) -> None:
    file = tmp_path / "set.grasps"
    small_set.save(file)
    there = install("method.py", "thenar.methods")
    asked, module = ("place", str(file), "--method", "chi2", "--keep", "4"), there.folder / "somebody_elses_method.py"
    sound = module.read_text()
    ranking = 'return [int(column) for column in np.argsort(-chi2, kind="stable")]'
    assert ranking in sound
    module.write_text(sound.replace(ranking, "return {}[0]"))
    said = there.thenar(*asked, code=2)
    assert said.startswith("thenar: unexpected KeyError in somebody_elses_method: this is a bug; ")
    for columns in ("[2, 1, 2, 2]", "[1, 9]"):
        module.write_text(
            sound.replace("learn=ranked(by_chi2)", f"learn=lambda samples, ports: lambda most: {columns}")
        )
        said = there.thenar(*asked, code=2)
        assert f"method 'chi2' chose the columns ({columns[1:-1]}) of 6: each may be chosen once" in said
