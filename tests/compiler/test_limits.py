"""What is too large is refused in one sentence, and before the work."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.artifact import CompileError
from thenar.compiler.evaluation.folds import EvaluationError
from thenar.compiler.evaluation.study import Study, StudyDesign, evaluate
from thenar.compiler.frontier.find import find_frontier
from thenar.compiler.frontier.points import FrontierError
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.placement.placement import place
from thenar.compiler.recogniser import check_inputs
from thenar.compiler.samples import Samples, TrainingError
from thenar.compiler.trainers.logitboost import boost
from thenar.compiler.workers import check_memory
from thenar.drivers.errors import ThenarError
from thenar.runtime.recipe import Recipe

from ..conftest import calls, peak_bytes
from .conftest import make_set


@pytest.fixture(scope="module")
def many_types() -> GraspSet:
    return make_set(rows=20_000, types=10_000, switches=64)


@pytest.mark.parametrize(
    ("work", "error"),
    [
        (lambda grasps, folder: compile_build(grasps, folder / "build"), TrainingError),
        (lambda grasps, _: find_frontier(grasps), FrontierError),
        (lambda grasps, _: evaluate(grasps), EvaluationError),
        (lambda grasps, _: place(grasps), TrainingError),
        (lambda grasps, _: Samples.of(grasps), TrainingError),
    ],
    ids=["compile", "frontier", "evaluate", "place", "place --method"],
)
def test_more_grasp_types_than_a_build_holds_are_refused_before_the_work(
    many_types: GraspSet, tmp_path: Path, work: Callable[[GraspSet, Path], object], error: type[ThenarError]
) -> None:
    def refused() -> None:
        with pytest.raises(error, match="10000 grasp types, a build has at most 1024: join types"):
            work(many_types, tmp_path)

    # A training makes thousands of calls a type.
    assert calls(refused) < 10 * len(many_types)
    assert not (tmp_path / "build").exists()


@pytest.mark.parametrize(
    ("types", "switches", "joints", "said"),
    [
        (2, 4097, 0, "4097 switches, a build has at most 4096: keep fewer"),
        (2, 0, 257, "257 joints, a build has at most 256"),
        (1024, 4096, 0, "tables of 1024 grasp types, 4096 switches and 0 joints need 16779280 bytes at least"),
    ],
)
def test_inputs_for_which_tables_have_no_room_are_refused(types: int, switches: int, joints: int, said: str) -> None:
    with pytest.raises(CompileError, match=said):
        check_inputs(types, switches, joints, CompileError)


def test_the_largest_tables_that_there_is_room_for_are_not_refused() -> None:
    check_inputs(1024, 4094, 0, CompileError)
    check_inputs(1000, 4096, 96, CompileError)


def test_joints_beyond_what_a_build_holds_are_refused_before_the_training(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match="300 joints, a build has at most 256"):
        compile_build(make_set(joints=300), tmp_path / "build", folds=0)


def test_more_switches_than_a_build_holds_are_refused_early(tmp_path: Path) -> None:
    wide = make_set(switches=5000)
    with pytest.raises(FrontierError, match="5000 switches, a build has at most 4096"):
        find_frontier(wide)
    with pytest.raises(CompileError, match="4097 switches, a build has at most 4096"):
        compile_build(wide, tmp_path / "build", placement="elimination", keep=4097, folds=0)
    assert compile_build(wide, tmp_path / "build", rounds=2, folds=0).manifest.source.switches == 5000


def test_more_stumps_than_an_ensemble_holds_are_refused_before_the_training(
    grasp_set: GraspSet, tmp_path: Path
) -> None:
    with pytest.raises(CompileError, match="10000000 rounds of 4 grasp types are 40000000 stumps"):
        compile_build(grasp_set, tmp_path / "build", rounds=10_000_000)


def test_rows_that_do_not_fit_into_memory_are_refused_before_the_training() -> None:
    labels = np.arange(8_000_000) % 1024
    with pytest.raises(TrainingError, match=r"8000000 rows of 1024 grasp types needs some 983\.\d GB of memory"):
        boost((labels % 2 == 0)[:, np.newaxis], labels, 1024, rounds=1)


def test_a_training_that_fits_into_memory_is_not_refused() -> None:
    check_memory(1000, 33, CompileError, switches=160, joints=22)


@pytest.fixture(scope="module")
def wide() -> GraspSet:
    """All pairs of its switches, counted for each type, would be 1.6 GB."""
    few = make_set(rows=40, types=2, switches=1, joints=0)
    switches = np.random.default_rng(0).random((40, 9_999)) < 0.5
    return replace(few, switches=switches, switch_names=tuple(f"s{number}" for number in range(9_999)))


@pytest.mark.parametrize("method", ["cmim", "mutual-information"])
def test_of_many_switches_few_are_chosen_without_counting_all_pairs(wide: GraspSet, method: str) -> None:
    chooser, chosen = METHODS[method].chooser, list[tuple[int, ...]]()
    samples = Samples(wide.switches, wide.codes, wide.labels, tuple("01"))
    # 1 kB a switch; a byte for each pair would be 10 kB.
    assert peak_bytes(lambda: chosen.append(tuple(chooser(samples)(5)))) < 1000 * wide.switches.shape[1]
    assert len(set(chosen[0])) == 5


def test_the_baselines_of_an_evaluation_take_a_set_of_many_switches(wide: GraspSet) -> None:
    recipe, studies = Recipe(trainer="logitboost", folds=2, rounds=1), list[Study]()
    design = StudyDesign(recipe, repeats=1, protocols=("nested",), tables=("baselines",))
    assert peak_bytes(lambda: studies.append(evaluate(wide, design, jobs=1))) < 10_000 * wide.switches.shape[1]
    assert [row.name for row in studies[0].tables[0].rows] == ["ID3", "CMIM", "top-k", "random"]


def test_switches_beyond_memory_are_refused_before_placement(wide: GraspSet, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.sysconf", {"SC_PHYS_PAGES": 200, "SC_PAGE_SIZE": 4096}.__getitem__)
    monkeypatch.setattr("thenar.compiler.evaluation.study.Planner", None)
    with pytest.raises(
        EvaluationError, match=r"30 rows of 2 grasp types needs some 0\.0 GB of memory.*fewer rows or columns"
    ):
        evaluate(wide, jobs=1, repeats=1)
