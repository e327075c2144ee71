"""Every method, by its name, keeps to what all have promised."""

import numpy as np
import pytest

from thenar.compiler.placement.baselines import RIVALS
from thenar.compiler.placement.costaware import PortCosts
from thenar.compiler.placement.errors import PlacementError
from thenar.compiler.placement.ways import METHODS, chooser
from thenar.compiler.samples import Samples

OURS = [name for name, method in METHODS.items() if method.ours]
BY_NUMBER = [name for name in OURS if METHODS[name].parameter == "switches"]


def learning(switches: int = 14) -> Samples:
    random = np.random.default_rng(11)
    labels = np.arange(150) % 5
    bits = (random.random((5, switches)) < 0.4)[labels] ^ (random.random((150, switches)) < 0.15)
    bits[:, :1] = True
    return Samples(bits, np.zeros((150, 0), np.uint16), labels, tuple("01234"))


def test_the_papers_ours_and_the_rivals_are_there() -> None:
    assert OURS == ["id3", "id3-cost", "id3-ccp", "id3-rep", "elimination", "elimination-cost", "elimination-boosted"]
    assert [name for name in METHODS if name not in OURS] == list(RIVALS)
    assert all(method.name == name and method.what for name, method in METHODS.items())
    assert {name for name, method in METHODS.items() if method.parameter == "S"} == {"id3"}


@pytest.mark.parametrize("name", BY_NUMBER)
def test_as_many_switches_as_asked_for_at_most_and_only_those_that_vary(name: str) -> None:
    choose = chooser(name, learning(), PortCosts(tuple(i // 4 for i in range(14)), (30.0, 40.0, 30.0, 40.0)))
    for most in (0, 1, 2, 5, 14, 40):
        kept = choose(most)
        assert len(set(kept)) == len(kept) <= most
        assert set(kept) <= set(range(1, 14))
        assert all(type(column) is int for column in kept)
    assert choose(3.9) == choose(3)
    assert choose(-1) == ()


@pytest.mark.parametrize("name", OURS)
def test_asked_again_a_method_answers_the_same(name: str) -> None:
    assert chooser(name, learning())(6) == chooser(name, learning())(6)


@pytest.mark.parametrize("name", [name for name in BY_NUMBER if "cost" not in name])
def test_methods_that_do_not_heed_time_are_not_swayed_by_it(name: str) -> None:
    ports = PortCosts(tuple(range(14)), tuple(float(i) for i in range(14)))
    assert chooser(name, learning(), ports)(5) == chooser(name, learning())(5)


@pytest.mark.parametrize("name", ["id3-cost", "elimination-cost"])
def test_methods_that_heed_time_read_fewer_ports(name: str) -> None:
    ports = PortCosts(tuple(i // 2 for i in range(14)), (50.0,) * 7)
    heeding, heedless = chooser(name, learning(), ports), chooser(name, learning())
    times = [[ports.scan_us(choose(most)) for most in range(2, 9)] for choose in (heeding, heedless)]
    assert all(with_cost <= without for with_cost, without in zip(*times, strict=True))
    assert sum(times[0]) < sum(times[1])


def test_a_method_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(PlacementError, match=r"'id4'.*id3, id3-cost"):
        chooser("id4", learning())


def test_there_must_be_switches_and_ports_for_each() -> None:
    with pytest.raises(PlacementError, match="joints only"):
        chooser("id3", learning(0))
    with pytest.raises(PlacementError, match="2 switches, the set has 14"):
        chooser("elimination", learning(), PortCosts((0, 0), (1.0,)))
