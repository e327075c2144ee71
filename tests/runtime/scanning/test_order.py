"""The order of ports against all orders that there are."""

from collections.abc import Callable, Sequence
from itertools import permutations, product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.runtime.scanning import plan as order
from thenar.runtime.scanning.plan import Unit, arranged, ports_in

UNITS: list[tuple[Unit, ...]] = [
    (),
    (0,),
    (0, 1, 2, 3, 4),
    ((0, 1), 2, (3, 4, 5)),
    (((0, 1), (2,)), ((3, 4),)),
    ((((2, 0),), (1, 3)), 4),
]
Cost = Callable[[int, int], int]


@st.composite
def costs(draw: st.DrawFn) -> Cost:
    """Frames that are each decided once certain ports were read, and times of ports."""
    times = draw(st.lists(st.integers(1, 9), min_size=6, max_size=6))
    frames = draw(st.lists(st.tuples(st.integers(0, 63), st.integers(1, 5)), max_size=6))

    def cost(read: int, port: int) -> int:
        return times[port] * sum(weight for needed, weight in frames if needed & ~read)

    return cost


def all_orders(unit: Unit) -> list[tuple[int, ...]]:
    """Every order in which nothing comes between what belongs together."""
    if isinstance(unit, int):
        return [(unit,)]
    return [
        tuple(port for part in parts for port in part)
        for some in permutations(unit)
        for parts in product(*(all_orders(each) for each in some))
    ]


def total(ports: Sequence[int], cost: Cost) -> int:
    return sum(cost(sum(1 << before for before in ports[:place]), port) for place, port in enumerate(ports))


@pytest.mark.parametrize("units", UNITS, ids=str)
@settings(max_examples=40)
@given(cost=costs())
def test_up_to_ten_ports_no_order_is_better(units: tuple[Unit, ...], cost: Cost) -> None:
    found = arranged(units, cost)
    orders = all_orders(units)
    assert found in orders
    assert total(found, cost) == min(total(ports, cost) for ports in orders)


@pytest.mark.parametrize("units", UNITS, ids=str)
@given(cost=costs())
def test_above_it_is_an_order_too_which_no_change_of_neighbours_betters(units: tuple[Unit, ...], cost: Cost) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(order, "EXACT", -1)
        found = arranged(units, cost)
    assert found in all_orders(units)
    if all(isinstance(unit, int) for unit in units):
        for place in range(len(found) - 1):
            swapped = (*found[:place], found[place + 1], found[place], *found[place + 2 :])
            assert total(found, cost) <= total(swapped, cost)


def test_many_ports_are_arranged_in_time() -> None:
    ports = tuple(range(24))
    found = arranged(ports, lambda read, port: (port + 1) * (24 - read.bit_count()))
    assert sorted(found) == list(ports)
    assert found[:3] == (0, 1, 2)


def test_the_ports_of_a_unit_are_listed_as_they_stand() -> None:
    assert ports_in(((3, 1), 2, ((0,),))) == (3, 1, 2, 0)
