from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thenar.compiler.frontier.finalists import recipes_to_mark
from thenar.compiler.frontier.find import find_frontier
from thenar.compiler.frontier.points import FrontierError
from thenar.compiler.frontier.price import Classified, PricedTables
from thenar.compiler.frontier.search import Search, placed
from thenar.compiler.frontier.wirings import ScanTimes
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.recordings.graspset import GraspSet
from thenar.runtime.recipe import PAPERS_TRAINER, Recipe

QUICK = Classified(40.0, "model", 900, 30)


def priced(*scans_us: float, classified: Classified | None = QUICK) -> PricedTables:
    scans = tuple(ScanTimes("mcp23017", 400_000, us, 1, 1, "wire") for us in scans_us)
    return PricedTables(Recipe(rounds=12), b"", classified, scans)


def test_a_choice_is_as_fast_as_its_fastest_wiring() -> None:
    assert priced(900.0, 300.0).fastest_us(0) == 340.0
    assert priced(900.0, 300.0).fastest_us(1800.0) == 1840.0
    assert priced().fastest_us(1800.0) == 1840.0


def test_what_fits_no_flash_has_no_time() -> None:
    assert priced(900.0, classified=None).fastest_us(0) is None


@pytest.mark.parametrize(("elements", "sizes"), [(9, [1, 2, 3, 4, 6, 8, 9]), (8, [1, 2, 3, 4, 6, 8]), (1, [1])])
def test_elimination_is_tried_at_every_size_up_to_all_switches(elements: int, sizes: list[int]) -> None:
    assert [*METHODS["elimination"].ladder(elements)] == sizes


def surveyed(elements: int, joints: int) -> Any:
    """What marks ask a survey for."""
    inputs = SimpleNamespace(n_joints=joints)
    return SimpleNamespace(search=Search(), levels=(None,), size=lambda _levels: elements, inputs=inputs)


def test_the_papers_placements_are_marked_with_all_inputs_that_there_are() -> None:
    papers, every = ("id3", 62, PAPERS_TRAINER), ("elimination", 14, PAPERS_TRAINER)
    assert recipes_to_mark(surveyed(14, 3)) == {
        placed(*papers, "switches"): "paper, S = 62",
        placed(*every, "switches"): "all of 14",
        placed(*papers, "both"): "paper, S = 62, joints",
        placed(*every, "both"): "all of 14, joints",
    }
    assert list(recipes_to_mark(surveyed(14, 0))) == [placed(*papers, "switches"), placed(*every, "switches")]
    assert recipes_to_mark(surveyed(0, 3)) == {}


def test_one_type_leaves_nothing_to_tell_apart(grasp_set: GraspSet) -> None:
    with pytest.raises(FrontierError, match="nothing to distinguish"):
        find_frontier(grasp_set.rows(np.arange(0, 96, 4)))


def test_frames_that_are_numbered_as_trials_are_refused(grasp_set: GraspSet) -> None:
    rows = grasp_set.rows(np.repeat(np.arange(96), 10))
    leaking = replace(rows, trials=np.arange(960), objects=np.repeat(np.arange(96) // 24, 10).astype(str))
    with pytest.raises(FrontierError, match="the rows that count as trials"):
        find_frontier(leaking)


def test_a_search_for_nothing_is_refused() -> None:
    with pytest.raises(FrontierError, match="at least"):
        Search(methods=())
