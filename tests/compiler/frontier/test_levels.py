"""Taxels on a frontier: levels found inside each fold, several of a conversion, and points built as they were found."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.frontier.cache import Cache, Store
from thenar.compiler.frontier.find import FRONTIER_NAME, find_frontier
from thenar.compiler.frontier.picked import picked
from thenar.compiler.frontier.points import Frontier, FrontierPoint
from thenar.compiler.frontier.price import ClassifyModel, Equipment
from thenar.compiler.frontier.search import TAXEL_LEVELS, Search, placed
from thenar.compiler.frontier.survey import Cuts, Survey
from thenar.compiler.frontier.wirings import WIRE_ONLY
from thenar.compiler.frontier.words import inputs_of, summary
from thenar.compiler.placement.elements import bits_of, elements_of, ports_of
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.placement.ports import ports_of_whole_glove
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.samples import Samples
from thenar.runtime.names import taxel_and_code

SEARCH = Search(
    methods=("elimination-cost",), rounds=4, repeats=1, finalists=2, trainer="logitboost",
    settings={"shrinkage": 1.0, "max_bins": 65536},
)  # fmt: skip


def pads(grasp_set: GraspSet, taxels: int = 4) -> GraspSet:
    """Return the set with taxels, which tell its types apart by how hard they are pressed, and two switches alone."""
    random, names = np.random.default_rng(4), [f"pad{number}" for number in range(taxels)]
    firm = np.random.default_rng(5).integers(20, 230, (grasp_set.labels.max() + 1, taxels))
    codes = np.clip(firm[grasp_set.labels] + random.normal(0, 20, (len(grasp_set), taxels)), 0, 255)
    return replace(
        grasp_set,
        switches=grasp_set.switches[:, :2],
        switch_names=grasp_set.switch_names[:2],
        taxels=codes.astype(np.uint16),
        taxel_columns=tuple(Joint(name, "N", 0, 0.0, 255, 5.1) for name in names),
    )


@pytest.fixture(scope="module")
def pressed(grasp_set: GraspSet) -> GraspSet:
    return pads(grasp_set)


@pytest.fixture(scope="module")
def found(pressed: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Frontier]:
    folder = tmp_path_factory.mktemp("levels") / "out"
    return folder, find_frontier(pressed, folder, search=SEARCH, joint_us=900.0, jobs=1)


def conversions(point: FrontierPoint) -> set[str]:
    return {level[0] for name in point.switches if (level := taxel_and_code(name))}


@pytest.mark.slow
def test_points_keep_levels_and_pay_for_each_taxel_once(found: tuple[Path, Frontier], pressed: GraspSet) -> None:
    frontier = found[1]
    assert (frontier.n_switches, frontier.n_taxels) == (2, 4)
    kept = [point for point in frontier.points if point.setting.inputs != "joints"]
    assert {point.setting.levels for point in kept} <= set(TAXEL_LEVELS)
    assert any(len(point.switches) > len(conversions(point)) + 2 for point in kept)
    for point in kept:
        assert conversions(point) <= set(pressed.taxel_names)
        expanders = len(set(point.switches) & set(pressed.switch_names))
        if point.setting.wiring != "board":
            assert point.ports <= len(conversions(point)) + expanders
    assert {each.levels for each in frontier.tried if each.inputs != "joints"} == set(TAXEL_LEVELS)


@pytest.mark.slow
def test_a_point_is_built_with_the_same_levels(found: tuple[Path, Frontier], pressed: GraspSet, tmp_path: Path) -> None:
    folder, frontier = found
    for number in (1, len(frontier.points)):
        point = frontier.point(number)
        chosen = picked(folder / FRONTIER_NAME, number, pressed)
        options: dict[str, Any] = dict(chosen.options)
        made = compile_build(
            pressed, tmp_path / str(number), harness=chosen.wired(None), folds=0, **options
        )  # fmt: skip
        assert tuple(switch.name for switch in made.manifest.switches) == point.switches
        assert made.manifest.options.levels == point.setting.levels


@pytest.mark.slow
def test_words_name_levels_and_taxels(found: tuple[Path, Frontier]) -> None:
    frontier = found[1]
    point = next(point for point in frontier.points if point.setting.levels and len(conversions(point)) > 1)
    levels = len([name for name in point.switches if taxel_and_code(name)])
    assert f"{len(conversions(point))} of 4 pads ({levels} levels)" in inputs_of(frontier, point)
    assert " of 4 taxels" in summary(frontier) or "joints, read" in summary(frontier)


def test_levels_of_a_fold_come_from_its_training_rows_alone(pressed: GraspSet, tmp_path: Path) -> None:
    samples = Samples.of(pressed)
    cuts, ports = Cuts.of(samples, SEARCH), ports_of_whole_glove(None, pressed.element_names, 4)
    with Store(tmp_path / "store.sqlite", "test") as store:
        equipment = Equipment(ClassifyModel("avr328p"), (), WIRE_ONLY)
        cache = Cache(store, lambda _done, _all: None, jobs=1)
        survey = Survey(pressed, "set", samples, ports, SEARCH, cuts, equipment, cache)
        choice, fold = placed("elimination-cost", 5, "logitboost", "switches", 3), cuts.screening[0]
        survey.choose([choice], [fold])
        alone = samples.rows(fold.train).with_joints(())
        elements = elements_of(alone, 3)
        assert elements != elements_of(samples, 3)
        choose: Any = METHODS["elimination-cost"].chooser(bits_of(alone, elements), ports and ports_of(ports, elements))
        assert survey.elements(choice, fold) == tuple(elements[column] for column in choose(5.0))
