"""The benchmark of initial contact: rows by force, and pads that tell a grasp before a switch of 1 N closes."""

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import own

PADS, TYPES = 4, ("cup", "pen", "rod", "key")


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "benchmarks"))
    return import_module("initialcontact")


def pressed(forces_n: tuple[float, ...], trials: int = 48) -> GraspSet:
    """Grasps that press one pad each, a frame at each force; two subjects."""
    frames = len(forces_n)
    label = np.repeat(np.arange(trials) % 4, frames)
    force = np.tile(forces_n, trials)
    noise = np.random.default_rng(0).integers(0, 20, (len(label), PADS))
    codes = np.where(label[:, None] == np.arange(PADS), (1000 * force)[:, None], 0) + noise
    return GraspSet(
        switches=np.zeros((len(label), 0), bool),
        switch_names=(),
        codes=np.zeros((len(label), 0), np.uint16),
        joints=(),
        grasps=np.array(TYPES)[label],
        taxonomy=own(TYPES),
        subjects=np.array(["A", "B"])[np.repeat(np.arange(trials) // 4 % 2, frames)],
        objects=np.full(len(label), "thing"),
        trials=np.repeat(np.arange(trials), frames),
        taxels=codes.astype(np.uint16),
        taxel_columns=tuple(Joint(f"pad{n}", "N", 0, 0.0, 1000, 1.0) for n in range(PADS)),
    )


def test_levels_tell_a_grasp_where_a_switch_of_one_newton_is_still_open(bench: Any) -> None:
    grasp_set = pressed((*bench.FORCES_N, 2.0))
    assert {element.code for element in bench.switches_of(grasp_set)} == {1000}
    levels, switches = (bench.rates(grasp_set, bench.right(grasp_set, PADS, levels=each)) for each in (True, False))
    assert [rate.total for rate in levels] == [48] * 12
    assert all(rate.mean == 1.0 for rate in levels[2:])
    assert all(rate.mean <= 0.3 for rate in (levels[0], *switches[:10]))
    assert switches[-1].mean == 1.0
