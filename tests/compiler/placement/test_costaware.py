"""Cost-aware ID3 beside its definition written out, with gains as exact products of whole numbers."""

import heapq
from collections import Counter
from fractions import Fraction
from math import prod

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler import grow_id3
from thenar.compiler.placement.costaware import PortCosts, cost_aware_order
from thenar.compiler.placement.errors import PlacementError

Bits = npt.NDArray[np.bool_]
Labels = npt.NDArray[np.int64]


@st.composite
def data(draw: st.DrawFn) -> tuple[Bits, Labels]:
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, d, classes = draw(st.integers(1, 20)), draw(st.integers(1, 6)), draw(st.integers(1, 4))
    return random.random((n, d)) < random.choice([0.2, 0.5]), random.integers(0, classes, n)


@st.composite
def data_and_ports(draw: st.DrawFn) -> tuple[Bits, Labels, PortCosts]:
    X, y = draw(data())
    us = draw(st.lists(st.sampled_from([0.0, 1.0, 2.0, 3.0]), min_size=1, max_size=3))
    port_of = draw(st.lists(st.integers(0, len(us) - 1), min_size=X.shape[1], max_size=X.shape[1]))
    return X, y, PortCosts(tuple(port_of), tuple(us))


def power(*columns: npt.NDArray[np.generic]) -> int:
    return prod(m**m for m in Counter(zip(*(column.tolist() for column in columns), strict=True)).values())


def gain(x: Bits, y: Labels) -> Fraction:
    """Return e to the power of n * gain."""
    return Fraction(power(x, y) * len(y) ** len(y), power(x) * power(y))


def order_by_definition(X: Bits, y: Labels, ports: PortCosts) -> tuple[int, ...]:
    found: list[int] = []
    waiting = [(-len(y), 0, tuple(range(len(y))))]
    made = 1
    while waiting:
        rows = list(heapq.heappop(waiting)[2])
        varying = [c for c in range(X.shape[1]) if 0 < X[rows, c].sum() < len(rows)]
        if len(set(y[rows].tolist())) < 2 or not varying:
            continue
        read = {ports.port_of[c] for c in found}
        # In whole microseconds, over the sum of all ports' times.
        costs = [int(sum(ports.us) + len(ports.us) * ports.us[p] * (p not in read)) or 1 for p in ports.port_of]
        best = min(varying, key=lambda c: (costs[c], c))
        for c in sorted(varying, key=lambda c: (costs[c], c)):
            if gain(X[rows, c], y[rows]) ** costs[best] > gain(X[rows, best], y[rows]) ** costs[c]:
                best = c
        if best not in found:
            found.append(best)
        for value in (False, True):
            part = tuple(row for row in rows if X[row, best] == value)
            heapq.heappush(waiting, (-len(part), made, part))
            made += 1
    return tuple(found)


@given(data_and_ports())
def test_switches_are_found_as_defined(drawn: tuple[Bits, Labels, PortCosts]) -> None:
    X, y, ports = drawn
    assert cost_aware_order(X, y, ports) == order_by_definition(X, y, ports)


@given(data(), st.integers(0, 20))
def test_where_all_cost_alike_every_s_of_the_papers_tree_is_a_beginning(drawn: tuple[Bits, Labels], s: int) -> None:
    X, y = drawn
    order = cost_aware_order(X, y, PortCosts((0,) * X.shape[1], (0.0,)))
    pruned = grow_id3(X, y, min_samples=s).inputs
    assert set(order[: len(pruned)]) == set(pruned)


def test_a_switch_on_a_port_that_is_read_anyway_is_preferred() -> None:
    y = np.repeat(np.arange(4), 6)
    whole = np.isin(y, [0, 1])
    best, nearly = np.isin(y, [0, 2]), np.isin(y, [0, 2])
    nearly[0] = False
    X = np.stack([whole, best, nearly], axis=1)
    assert cost_aware_order(X, y, PortCosts((0, 1, 0), (0.0, 0.0)))[:2] == (0, 1)
    assert cost_aware_order(X, y, PortCosts((0, 1, 0), (40.0, 40.0)))[:2] == (0, 2)


def test_half_the_gain_at_half_the_cost_is_as_good_and_the_cheaper_wins() -> None:
    y = np.repeat(np.arange(4), 2)
    one_bit, half_a_bit = y < 2, np.array([0, 0, 1, 1, 0, 1, 0, 1], bool)
    X = np.stack([one_bit, half_a_bit], axis=1)
    assert cost_aware_order(X, y, PortCosts((0, 1), (5.0, 1.0)))[0] == 1
    assert cost_aware_order(X, y, PortCosts((0, 1), (4.999, 1.0)))[0] == 0


def test_reading_a_port_costs_once() -> None:
    ports = PortCosts((0, 0, 1, 2), (10.0, 20.0, 40.0))
    assert [ports.scan_us(kept) for kept in ((), (0,), (0, 1), (1, 3), (3, 2, 1, 0))] == [0.0, 10.0, 10.0, 50.0, 70.0]


def test_a_port_is_shared_out_over_those_kept_on_it() -> None:
    ports = PortCosts((0, 0, 1, 1), (10.0, 30.0))
    assert ports.shares([0, 1, 3]).tolist() == [0.25, 0.25, 1.5]
    assert PortCosts((0,), (0.0,)).shares([0]).tolist() == [0.0]


@pytest.mark.parametrize(("port_of", "us"), [((1,), (1.0,)), ((-1,), (1.0,)), ((0,), (-1.0,)), ((0,), (float("nan"),))])
def test_ports_must_be_there_and_take_some_time(port_of: tuple[int, ...], us: tuple[float, ...]) -> None:
    with pytest.raises(PlacementError):
        PortCosts(port_of, us)


def test_ports_of_other_switches_are_refused() -> None:
    with pytest.raises(PlacementError, match="2 switches"):
        cost_aware_order([[0], [1]], [0, 1], PortCosts((0, 0), (1.0,)))
