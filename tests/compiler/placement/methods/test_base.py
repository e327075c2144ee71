"""Every method, by its name, keeps to what all have promised."""

import numpy as np
import pytest

from thenar.compiler.placement.methods.base import METHODS, Method, usual
from thenar.compiler.placement.ports import PortCosts
from thenar.compiler.samples import Samples, TrainingError

OURS = [name for name, method in METHODS.items() if method.ours]
BY_NUMBER = [name for name in OURS if METHODS[name].by_number]


def learning(switches: int = 14) -> Samples:
    random = np.random.default_rng(11)
    labels = np.arange(150) % 5
    bits = (random.random((5, switches)) < 0.4)[labels] ^ (random.random((150, switches)) < 0.15)
    bits[:, :1] = True
    return Samples(bits, np.zeros((150, 0), np.uint16), labels, tuple("01234"))


def test_the_papers_ours_and_the_baselines_are_there() -> None:
    assert OURS == ["elimination", "elimination-cost", "id3", "id3-cost"]
    assert [name for name in METHODS if name not in OURS] == ["cmim", "mutual-information", "random"]
    assert all(method.name == name and method.help for name, method in METHODS.items())
    assert [name for name, method in METHODS.items() if not method.by_number] == ["id3"]
    assert {name for name, method in METHODS.items() if method.uses_joints} == {name for name in OURS if "elim" in name}
    assert [name for name, method in METHODS.items() if method.uses_ports] == ["elimination-cost", "id3-cost"]


def test_what_a_frontier_tries_hangs_on_whether_the_wiring_is_known() -> None:
    assert usual() == ("elimination", "id3", "id3-cost")
    assert usual(wired=True) == ("elimination", "elimination-cost", "id3", "id3-cost")


def test_a_ladder_ends_at_all_switches_where_a_method_says_so() -> None:
    assert METHODS["elimination"].ladder(12) == (1, 2, 3, 4, 6, 8, 10, 12)
    assert METHODS["cmim"].ladder(12) == (4, 8)
    assert METHODS["id3"].ladder(12)[:3] == (0, 10, 13)


def test_a_parameter_is_one_of_two() -> None:
    with pytest.raises(TrainingError, match="method 'odd': its parameter is 'switches' or 'S', not 'lambda'"):
        Method(name="odd", help="", learn=METHODS["cmim"].learn, parameter="lambda")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", BY_NUMBER)
def test_methods_keep_at_most_the_requested_varying_switches(name: str) -> None:
    choose = METHODS[name].chooser(learning(), PortCosts(tuple(i // 4 for i in range(14)), (30.0, 40.0, 30.0, 40.0)))
    for most in (0, 1, 2, 5, 14, 40):
        kept = choose(most)
        assert len(set(kept)) == len(kept) <= most
        assert set(kept) <= set(range(1, 14))
        assert all(type(column) is int for column in kept)
    assert choose(3.9) == choose(3)
    assert choose(-1) == ()


@pytest.mark.parametrize("name", [name for name in BY_NUMBER if "cost" not in name])
def test_methods_that_do_not_heed_time_are_not_swayed_by_it(name: str) -> None:
    ports = PortCosts(tuple(range(14)), tuple(float(i) for i in range(14)))
    assert METHODS[name].chooser(learning(), ports)(5) == METHODS[name].chooser(learning())(5)


@pytest.mark.parametrize("name", ["id3-cost", "elimination-cost"])
def test_methods_that_heed_time_read_fewer_ports(name: str) -> None:
    ports = PortCosts(tuple(i // 2 for i in range(14)), (50.0,) * 7)
    heeding, heedless = METHODS[name].chooser(learning(), ports), METHODS[name].chooser(learning())
    read = [[len({column // 2 for column in choose(most)}) for most in range(2, 9)] for choose in (heeding, heedless)]
    assert all(with_cost <= without for with_cost, without in zip(*read, strict=True))
    assert sum(read[0]) < sum(read[1])


def test_there_must_be_switches_and_ports_for_each() -> None:
    with pytest.raises(TrainingError, match="joints only"):
        METHODS["id3"].chooser(learning(0))
    with pytest.raises(TrainingError, match="2 switches, the set has 14"):
        METHODS["elimination"].chooser(learning(), PortCosts((0, 0), (1.0,)))
