import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import GraspSet

from .conftest import refusal, works


def test_a_set_is_described_for_people(grasps: Path) -> None:
    said = works("info", grasps).stdout
    for words in (
        "4 trials of 4 frames, 2 grasp types (own); subjects 2, objects 2, switches 2, joints 1",
        "50.0%",
        "balance (rarest type over commonest): 1.00",
        "subjects: A (3), B (1)",
        "warning: 1 switches never change: palm",
    ):
        assert words in said


def test_rows_in_which_nothing_is_held_are_shown_last(grasps: Path) -> None:
    found = GraspSet.load(grasps)
    replace(found, grasps=np.array(["mug", "ball", "none", "none"]), times_us=np.array([0, 0, 10_000, 20_000])).save(
        grasps
    )
    said = works("info", grasps).stdout
    assert "4 trials (2 grasps, 2 rests) of 4 frames, 2 grasp types (own); subjects 2" in said
    assert "movements 4, 0.0 s" in said
    assert [line.split()[1] for line in said.splitlines() if line.endswith("% │")] == ["mug", "ball", "none"]


def test_a_set_is_described_for_machines(grasps: Path) -> None:
    summary = json.loads(works("info", grasps, "--json").stdout)
    assert summary["fingerprint"] == GraspSet.load(grasps).fingerprint()
    assert summary["grasps"] == {"mug": 2, "ball": 2}


def test_too_little_memory_is_one_sentence(grasps: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def too_much(path: Path) -> GraspSet:
        raise MemoryError("Unable to allocate 7 TiB")

    monkeypatch.setattr(GraspSet, "load", too_much)
    said = "thenar: not enough memory (Unable to allocate 7 TiB): use fewer rows or columns\n"
    assert refusal("info", grasps) == said
