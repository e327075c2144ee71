import numpy as np
import pytest

from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.frontier.finalists import depth_of, finalists, papers_tables, worthwhile
from thenar.compiler.frontier.points import PlacementChoice
from thenar.compiler.frontier.price import Tabled
from thenar.compiler.frontier.screen import Screened
from thenar.compiler.frontier.search import Candidate, Search, Shape
from thenar.compiler.frontier.survey import FoldHits, TrialAccuracy
from thenar.compiler.placement.elements import Element
from thenar.runtime.recipe import Inputs


def judged(rate: float) -> TrialAccuracy:
    return TrialAccuracy(Rate.counted((round(10_000 * rate),), 10_000, of="pooled"), np.arange(1), 1)


def _screened(size: int, rate: float, frame_us: float, inputs: Inputs = "switches", method: str = "id3") -> Screened:
    choice = Candidate(PlacementChoice(method, float(size)), inputs)
    return Screened(choice, tuple(map(Element, range(size))), judged(rate), frame_us)


def test_the_best_and_the_smallest_that_is_level_come_first() -> None:
    best, level, between = _screened(40, 0.99, 300), _screened(16, 0.986, 200), _screened(8, 0.9, 100)
    assert finalists([between, level, best], [], 2) == (level, best)


def test_kinds_of_inputs_share_evenly() -> None:
    switches = [_screened(size, rate, size) for size, rate in ((40, 0.9), (20, 0.85), (10, 0.8))]
    both = [_screened(size, rate, 1000 + size, "both") for size, rate in ((40, 0.99), (20, 0.98), (10, 0.95))]
    chosen = finalists([*switches, *both], [], 4)
    assert [one.choice.inputs for one in chosen] == ["switches"] * 2 + ["both"] * 2


def test_what_others_beat_is_no_finalist() -> None:
    best, beaten = _screened(8, 0.9, 100), _screened(9, 0.8, 110)
    assert finalists([best, beaten], [], 5) == (best,)


def test_what_is_wanted_is_among_them_however_bad() -> None:
    best, bad = _screened(8, 0.9, 100), _screened(9, 0.1, 300)
    assert finalists([best, bad], [bad.choice], 1) == (best, bad)


def test_equal_placements_count_once() -> None:
    one, same = _screened(8, 0.9, 100), _screened(8, 0.9, 100, method="id3-ccp")
    assert finalists([one, same], [], 2) == (one,)


def rates_of(shape: Shape, *rates: tuple[int, float]) -> dict[Tabled, TrialAccuracy]:
    return {Tabled(rounds, shape): judged(rate) for rounds, rate in rates}


def test_every_shape_is_priced_at_its_fewest_equivalent_rounds() -> None:
    wide, narrow = Shape(16), Shape(4)
    rates = rates_of(wide, (10, 0.8), (30, 0.9), (100, 0.9002)) | rates_of(narrow, (10, 0.7), (30, 0.6))
    assert worthwhile(rates) == (Tabled(30, wide), Tabled(10, narrow))


def test_the_papers_tables_have_at_most_a_hundred_rounds() -> None:
    rounds = [papers_tables(Search(methods=("id3",), baselines=(), rounds=most)).rounds for most in (300, 100, 50)]
    assert rounds == [100, 100, 50]
    for most in (300, 100, 50, 1):
        search = Search(methods=("id3",), baselines=(), rounds=most)
        assert papers_tables(search).rounds in search.tabled


def right(count: int) -> bytes:
    return np.packbits(np.arange(500) < count).tobytes()


@pytest.mark.parametrize(("late", "rounds"), [(0, 100), (2, 100), (3, 300)])
def test_further_rounds_are_followed_if_they_win_a_fifth_percent(late: int, rounds: int) -> None:
    search = Search(methods=("id3",), baselines=())
    correct = [450 + (late if stage > 100 else 0) for stage in search.stages]
    fits = [FoldHits(tuple(map(right, counts)), (), ()) for counts in (correct, [450] * len(correct))]
    assert depth_of(search, fits, 1000).rounds == rounds
