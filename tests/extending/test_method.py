"""A placement method of another package is one like any other."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sklearn.feature_selection import chi2

from thenar.compiler import GraspSet
from thenar.compiler.recordings.taxonomy import own

pytestmark = pytest.mark.slow
Install = Callable[[str, str], Any]


@pytest.fixture(scope="module")
def small_set() -> GraspSet:
    random = np.random.default_rng(4)
    labels = np.arange(60) % 3
    patterns = np.array([[0, 0, 1, 1, 0, 1], [0, 1, 0, 1, 1, 0], [1, 0, 0, 1, 1, 1]], bool)
    return GraspSet(
        switches=patterns[labels] ^ (random.random((60, 6)) < 0.1),
        switch_names=tuple(f"s{number}" for number in range(6)),
        codes=np.zeros((60, 0), np.uint16),
        joints=(),
        grasps=np.array(["cup", "pen", "rod"])[labels],
        taxonomy=own(["cup", "pen", "rod"]),
        subjects=np.full(60, "A"),
        objects=np.full(60, "thing"),
        trials=np.arange(60),
    )


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
    settled = ("--trainer", "logitboost", "--shrinkage", "1", "--max-bins", "65536", "--ties", "least-used")
    found = json.loads(
        there.thenar(
            *("frontier", str(file), "-o", str(tmp_path / "found"), "--methods", "chi2", "--baselines", "none"),
            *quick,
            *settled,
        )
    )
    assert {point["setting"]["placement"]["method"] for point in found["points"]} == {"chi2"}
    assert [curve["method"] for curve in found["curves"]] == ["chi2"]

    study = json.loads(
        there.thenar(
            *("evaluate", str(file), "--tables", "baselines", "--baselines", "chi2", "--folds", "2", "--repeats", "1"),
            *("--rounds", "2", "--json"),
        )
    )
    assert [row["name"] for row in study["tables"][0]["rows"]] == ["ID3", "chi2", "random"]


def test_a_wrong_name_lists_it(install: Install, small_set: GraspSet, tmp_path: Path) -> None:
    file = tmp_path / "set.grasps"
    small_set.save(file)
    said = install("method.py", "thenar.methods").thenar("place", str(file), "--method", "chi", "--keep", "4", code=2)
    assert "there is no method 'chi' (did you mean 'chi2' or 'cmim'?)" in said
