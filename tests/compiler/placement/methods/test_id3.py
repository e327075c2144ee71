"""The family of ID3: beside the trees themselves, and cost-aware growth beside its definition written out, with gains
as exact products of whole numbers.
"""

import heapq
from collections import Counter
from fractions import Fraction
from math import prod

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler import grow_id3
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.placement.methods.id3 import cost_aware_order
from thenar.compiler.placement.ports import PortCosts
from thenar.compiler.samples import Samples

Bits = npt.NDArray[np.bool_]
Labels = npt.NDArray[np.int64]


@st.composite
def learnings(draw: st.DrawFn) -> Samples:
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, s = draw(st.integers(1, 60)), draw(st.integers(1, 10))
    labels = random.integers(0, 4, n)
    switches = (random.random((4, s)) < 0.5)[labels] ^ (random.random((n, s)) < random.choice([0.0, 0.2]))
    # Class 4 is never met: numbers of the tree's classes are not those of the labels.
    return Samples(switches, np.zeros((n, 0), np.uint16), labels + (labels > 1), tuple("01234"))


@given(learnings(), st.integers(0, 61))
def test_one_tree_answers_for_every_s_as_the_papers_pruned_tree_does(samples: Samples, s: int) -> None:
    assert METHODS["id3"].chooser(samples)(s) == grow_id3(samples.switches, samples.labels, min_samples=s).inputs


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


def order_of(X: Bits, y: Labels, ports: PortCosts) -> tuple[int, ...]:
    return cost_aware_order(Samples(X, np.zeros((len(y), 0), np.uint16), y, tuple("0123")), ports)


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
    assert order_of(X, y, ports) == order_by_definition(X, y, ports)


@given(data(), st.integers(0, 20))
def test_at_equal_costs_every_pruned_tree_begins_the_order(drawn: tuple[Bits, Labels], s: int) -> None:
    X, y = drawn
    order = order_of(X, y, PortCosts((0,) * X.shape[1], (0.0,)))
    pruned = grow_id3(X, y, min_samples=s).inputs
    assert set(order[: len(pruned)]) == set(pruned)
