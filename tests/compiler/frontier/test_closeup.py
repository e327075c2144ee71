import pytest

from thenar.compiler.frontier.closeup import depth_of, papers_depth, papers_tables, worthwhile
from thenar.compiler.frontier.learnt import Fit
from thenar.compiler.frontier.points import Rate
from thenar.compiler.frontier.pricing import Tabled
from thenar.compiler.frontier.settings import Search, Shape


def rates_of(shape: Shape, *rates: tuple[int, float]) -> dict[Tabled, Rate]:
    return {Tabled(rounds, shape): Rate(rate, rate, rate) for rounds, rate in rates}


def test_of_every_shape_the_fewest_rounds_that_do_as_well_are_worth_a_price() -> None:
    wide, narrow = Shape(16), Shape(4)
    rates = rates_of(wide, (10, 0.8), (30, 0.9), (100, 0.9002)) | rates_of(narrow, (10, 0.7), (30, 0.6))
    assert worthwhile(rates) == (Tabled(30, wide), Tabled(10, narrow))


def test_the_papers_tables_have_a_hundred_rounds_or_as_many_as_there_are() -> None:
    rounds = [papers_tables(Search(methods=("id3",), rivals=(), rounds=most)).rounds for most in (300, 100, 50)]
    assert rounds == [100, 100, 50]
    for most in (300, 100, 50, 1):
        search = Search(methods=("id3",), rivals=(), rounds=most)
        assert papers_tables(search).rounds in search.tabled


@pytest.mark.parametrize(("late", "rounds"), [(0, 100), (2, 100), (3, 300)])
def test_rounds_beyond_the_papers_are_followed_where_they_win_more_than_a_fifth_of_a_percent(
    late: int, rounds: int
) -> None:
    search = Search(methods=("id3",), rivals=())
    correct = [450 + (late if stage > 100 else 0) for stage in search.stages]
    fits = [Fit(500, tuple(correct), ()), Fit(500, tuple(450 for _ in correct), ())]
    assert depth_of(search, fits).rounds == rounds


def test_a_search_of_few_rounds_is_followed_to_its_end() -> None:
    search = Search(methods=("id3",), rivals=(), rounds=50)
    assert depth_of(search, [Fit(10, tuple(range(len(search.stages))), ())]) == search


def test_what_is_followed_less_far_is_the_beginning_of_what_is() -> None:
    few, all_rounds = papers_depth(Search()), Search()
    assert all_rounds.stages[: len(few.stages)] == few.stages
    assert all_rounds.tabled[: len(few.tabled)] == few.tabled
