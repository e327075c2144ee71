import numpy as np
import pytest

from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.frontier.finalists import Screened, depth_of, papers_tables, select_finalists, worthwhile
from thenar.compiler.frontier.search import SHAPES, Search, placed, tabled
from thenar.compiler.frontier.survey import FoldHits, TrialAccuracy
from thenar.compiler.placement.elements import Element
from thenar.runtime.recipe import PAPERS_TRAINER, Inputs, Recipe


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
    one, same = _screened(8, 0.9, 100), _screened(8, 0.9, 100, method="id3-ccp")
    assert select_finalists([one, same], [], 2) == (one,)


CHOICE = placed("id3", 62, PAPERS_TRAINER, "both")


def rates_of(shape: Recipe, *rates: tuple[int, float]) -> dict[Recipe, TrialAccuracy]:
    return {tabled(CHOICE, rounds, shape): judged(rate) for rounds, rate in rates}


def test_every_shape_is_priced_at_its_fewest_equivalent_rounds() -> None:
    wide, narrow = SHAPES[0], SHAPES[5]
    rates = rates_of(wide, (10, 0.8), (30, 0.9), (100, 0.9002)) | rates_of(narrow, (10, 0.7), (30, 0.6))
    assert worthwhile(rates) == (tabled(CHOICE, 30, wide), tabled(CHOICE, 10, narrow))


def test_the_papers_tables_have_at_most_a_hundred_rounds() -> None:
    searches = [Search(methods=("id3",), baselines=(), rounds=most) for most in (300, 100, 50, 1)]
    assert [papers_tables(CHOICE, search).rounds for search in searches] == [100, 100, 50, 1]
    assert all(papers_tables(CHOICE, search).rounds in search.tabled for search in searches)


def right(count: int) -> bytes:
    return np.packbits(np.arange(500) < count).tobytes()


@pytest.mark.parametrize(("late", "rounds"), [(0, 100), (2, 100), (3, 300)])
def test_further_rounds_are_followed_if_they_win_a_fifth_percent(late: int, rounds: int) -> None:
    search = Search(methods=("id3",), baselines=())
    correct = [450 + (late if stage > 100 else 0) for stage in search.stages]
    fits = [FoldHits(tuple(map(right, counts)), (), ()) for counts in (correct, [450] * len(correct))]
    assert depth_of(search, fits, 1000).rounds == rounds
