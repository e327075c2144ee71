"""A kind of term of somebody else's: trained, quantised, proved, drawn, stored, and in C."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.runtime.model.integers import tables_from_bytes

from .conftest import sixty

pytestmark = pytest.mark.slow


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    """Return a set in which one type alone bends both joints, by which the others are bent one at a time."""
    random, labels = np.random.default_rng(5), np.arange(60) % 3
    bent = np.array([[1, 0], [0, 1], [1, 1]])[labels]
    codes = np.clip(100 * bent + random.normal(60, 15, (60, 2)), 0, 255)
    sixty(random.random((60, 3)) < 0.5, codes, ("thumb", "index"), ("cup", "pen", "plate")).save(
        tmp_path / "set.grasps"
    )
    return tmp_path / "set.grasps"


def test_a_foreign_term_is_trained_proved_drawn_and_in_c(
    install: Callable[..., Any], recordings: Path, tmp_path: Path
) -> None:
    installed, build = install("term.py", "thenar.trainers", others={"thenar.terms": "KIND"}), tmp_path / "build"
    installed.thenar("compile", str(recordings), "-o", str(build), "--trainer", "logit-corner", "--folds", "3")
    tables = tables_from_bytes((build / "tables.bin").read_bytes())
    (grid,) = tables.grids
    assert grid.joints == (0, 1)
    assert [len(steps) for steps in grid.thresholds] == [1, 1]
    assert grid.rows[1, 1].any()
    assert not grid.rows[0].any()
    assert re.search(r"<text [^>]*>thumb and index, grid [0-9.]+</text>", (build / "report.html").read_text())

    # The stored model has the corner, and gives the scores of its tables, its integers, and its compiled C.
    found = json.loads(installed.thenar("verify", str(build), str(recordings), "--firmware", "host", "--json"))
    assert found["holds"]
    assert 0 < found["collapse_bound"] < 1e-9
    assert found["collapse_difference"] <= found["collapse_bound"]
    assert 0 < found["integer_difference"] <= found["integer_bound"]


def test_a_build_runs_without_the_package_but_is_not_verified(
    install: Callable[..., Any], recordings: Path, tmp_path: Path
) -> None:
    installed, build = install("term.py", "thenar.trainers", others={"thenar.terms": "KIND"}), tmp_path / "build"
    installed.thenar("compile", str(recordings), "-o", str(build), "--trainer", "logit-corner", "--folds", "0")
    for path in installed.folder.glob("*.dist-info/*.txt"):
        path.unlink()
    replayed = installed.thenar("run", str(build), "--replay", str(recordings)).splitlines()
    assert {line.get("grasp") for line in map(json.loads, replayed)} >= {"cup", "pen", "plate"}
    refused = installed.thenar("verify", str(build), str(recordings), code=2)
    assert "there is no kind of term 'corner'" in refused


def test_a_kind_that_is_no_class_of_terms_is_refused(
    install: Callable[..., Any], recordings: Path, tmp_path: Path
) -> None:
    installed, build = install("term.py", "thenar.trainers", others={"thenar.terms": "MEMBER"}), tmp_path / "build"
    installed.thenar("compile", str(recordings), "-o", str(build), "--trainer", "logit-corner", "--folds", "0")
    refused = installed.thenar("verify", str(build), str(recordings), code=2)
    assert "is not a class derived from Term: docs/how-to/extend.md says what to define" in " ".join(refused.split())
