from thenar.compiler.frontier.closeup import papers_tables, worthwhile
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
