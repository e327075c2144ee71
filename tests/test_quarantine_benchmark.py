"""What the benchmark of faults finds, on a small scene, and on the build that the documents measure."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from thenar.cli import run
from thenar.compiler import GraspSet, compile_build
from thenar.runtime import Build

from .sets import grasp_set_of


@pytest.fixture
def faults(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "benchmarks"))
    return import_module("quarantine")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., GraspSet]:
    folder = tmp_path_factory.mktemp("quarantine")

    def made(name: str, *options: str) -> GraspSet:
        path = folder / f"{name}.grasps"
        assert run(["simulate", name, *options, "-o", str(path)]) == 0
        return GraspSet.load(path)

    return made


def build_of(grasp_set: GraspSet, folder: Path, prune: int) -> Build:
    made = compile_build(grasp_set, folder, inputs="switches", prune=prune, rounds=60, folds=0)
    return Build.load(made.folder)


def drawn(seed: int) -> GraspSet:
    """Return grasps of two subjects, of four types that each close three switches of twelve nearly always."""
    random, kinds = np.random.default_rng(seed), ("a", "b", "c", "d")
    label = random.integers(0, 4, 600)
    often = np.where(np.arange(12) // 3 == label[:, np.newaxis], 0.9, 0.05)
    people = np.array(["A", "B"])[np.arange(600) % 2]
    return grasp_set_of(kinds, label, switches=random.random((600, 12)) < often, subjects=people)


def test_a_switch_that_sticks_is_found_and_none_without_a_fault(faults: ModuleType, tmp_path: Path) -> None:
    build, fresh = build_of(drawn(1), tmp_path / "build", 8), drawn(2)
    alarms, grasps = faults.false_alarms(build, fresh, 2)
    assert (alarms, grasps) == (0, len(fresh))
    found = faults.cost(build, fresh, True, 3, 0)
    assert found.name == build.manifest.switches[0].name
    assert all(delay is not None and delay < 12 for delay in found.delays)
    assert found.quarantined[1] <= min(found.without[1], 12, found.lost[1] + 1)


@pytest.mark.slow
def test_stuck_switches_and_healthy_gloves_of_other_men_are_counted(
    faults: ModuleType, scene: Callable[..., GraspSet], tmp_path: Path
) -> None:
    """39 switches of three men, on three other men: at most a point more than the switch costs as lost, and eight in
    the first 30 grasps.
    """
    build, others = build_of(scene("kamakura"), tmp_path / "build", 62), scene("kamakura-def")
    alarms, grasps = faults.false_alarms(build, others, 3)
    assert alarms == 0 < grasps
    for switch in range(build.tables.n_switches):
        found = faults.cost(build, others, True, 3, switch)
        assert found.quarantined[0] <= found.lost[0] + 8, found
        assert found.quarantined[1] <= found.lost[1] + 1, found
        assert None not in found.delays or found.without[1] <= 12, found
