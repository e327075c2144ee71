from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.frontier.cache import Cache, Store
from thenar.compiler.frontier.finalists import (
    Screened,
    papers_tables,
    recipes_to_mark,
    select_finalists,
    worthwhile,
)
from thenar.compiler.frontier.find import find_frontier
from thenar.compiler.frontier.points import FrontierError
from thenar.compiler.frontier.price import Classified, PricedTables
from thenar.compiler.frontier.search import SHAPES, Search, placed, tabled
from thenar.compiler.frontier.survey import TrialAccuracy
from thenar.compiler.frontier.wirings import ScanTimes
from thenar.compiler.placement.elements import Element
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.recordings.graspset import GraspSet
from thenar.runtime.recipe import PAPERS_TRAINER, Inputs, Recipe

from .conftest import survey_of


def judged(rate: float) -> TrialAccuracy:
    return TrialAccuracy(Rate.counted((round(10_000 * rate),), 10_000, of="pooled"), np.arange(1), 1)


def _screened(size: int, rate: float, frame_us: float, inputs: Inputs = "switches", method: str = "id3") -> Screened:
    recipe = placed(method, size, PAPERS_TRAINER, inputs)
    return Screened(recipe, tuple(map(Element, range(size))), judged(rate), frame_us)


def test_the_best_and_the_smallest_that_is_level_come_first() -> None:
    best, level, between = _screened(40, 0.99, 300), _screened(16, 0.986, 200), _screened(8, 0.9, 100)
    assert select_finalists([between, level, best], [], 2) == (level, best)


def test_kinds_of_inputs_share_evenly() -> None:
    switches = [_screened(size, rate, size) for size, rate in ((40, 0.9), (20, 0.85), (10, 0.8))]
    both = [_screened(size, rate, 1000 + size, "both") for size, rate in ((40, 0.99), (20, 0.98), (10, 0.95))]
    chosen = select_finalists([*switches, *both], [], 4)
    assert [one.recipe.inputs for one in chosen] == ["switches"] * 2 + ["both"] * 2


def test_what_others_beat_is_no_finalist() -> None:
    best, beaten = _screened(8, 0.9, 100), _screened(9, 0.8, 110)
    assert select_finalists([best, beaten], [], 5) == (best,)


def test_what_is_wanted_is_among_them_however_bad() -> None:
    best, bad = _screened(8, 0.9, 100), _screened(9, 0.1, 300)
    assert select_finalists([best, bad], [bad.recipe], 1) == (best, bad)


def test_equal_placements_count_once() -> None:
    one, same = _screened(8, 0.9, 100), _screened(8, 0.9, 100, method="id3-cost")
    assert select_finalists([one, same], [], 2) == (one,)


CHOICE = placed("id3", 62, PAPERS_TRAINER, "both")


def rates_of(shape: Recipe, *rates: tuple[int, float]) -> dict[Recipe, TrialAccuracy]:
    return {tabled(CHOICE, rounds, shape): judged(rate) for rounds, rate in rates}


def test_every_shape_is_priced_at_its_fewest_equivalent_rounds() -> None:
    wide, narrow = SHAPES[0], SHAPES[5]
    rates = rates_of(wide, (10, 0.8), (30, 0.9), (100, 0.9002)) | rates_of(narrow, (10, 0.7), (30, 0.6))
    assert worthwhile(rates) == (tabled(CHOICE, 30, wide), tabled(CHOICE, 10, narrow))


def test_the_papers_tables_have_at_most_a_hundred_rounds() -> None:
    searches = [Search(methods=("id3",), rounds=most) for most in (300, 100, 50, 1)]
    assert [papers_tables(CHOICE, search).rounds for search in searches] == [100, 100, 50, 1]
    assert all(papers_tables(CHOICE, search).rounds in search.tabled for search in searches)


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


def test_the_papers_placements_are_marked_with_all_inputs_that_there_are(grasp_set: GraspSet, tmp_path: Path) -> None:
    papers, every = ("id3", 62, PAPERS_TRAINER), ("elimination", 14, PAPERS_TRAINER)
    bare = replace(grasp_set, codes=grasp_set.codes[:, :0], joints=())
    with Store(tmp_path / "store.sqlite", "test") as store:
        cache = Cache(store, lambda _done, _all: None, jobs=1)
        assert recipes_to_mark(survey_of(grasp_set, cache)) == {
            placed(*papers, "switches"): "paper, S = 62",
            placed(*every, "switches"): "all of 14",
            placed(*papers, "both"): "paper, S = 62, joints",
            placed(*every, "both"): "all of 14, joints",
        }
        assert list(recipes_to_mark(survey_of(bare, cache))) == [
            placed(*papers, "switches"),
            placed(*every, "switches"),
        ]
        joints_alone = replace(grasp_set, switches=grasp_set.switches[:, :0], switch_names=())
        assert recipes_to_mark(survey_of(joints_alone, cache)) == {}


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
