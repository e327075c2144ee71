"""The order of ports: what belongs together stays together, and the rest is ordered for the least expected cost.

A unit is a port, or units in a row that nothing else may come between. A `Cost` is what reading a port costs when
certain others were read before, an integer that does not grow with these. The cost of an order is the sum over its
ports.
"""

from collections.abc import Callable, Sequence
from typing import Union

# Up to so many ports every order counts (2^n sets of ports); above, a good one is looked for.
EXACT = 10

Order = tuple[int, ...]
Unit = Union[int, Sequence["Unit"]]  # noqa: UP007 (an alias of itself has to be quoted)
# Cost of reading a port, the last argument, after a set of ports: bit p is port p.
Cost = Callable[[int, int], int]
# Cost and order of walking through item number i after a set of ports.
_Step = Callable[[int, int], tuple[int, Order]]


def arranged(units: Sequence[Unit], cost: Cost) -> Order:
    """Return all ports of all `units` in an order of low cost; of the lowest cost there is up to EXACT ports."""
    best = _exact if len(ports_in(units)) <= EXACT else _searched

    def through(read: int, unit: Unit) -> tuple[int, Order]:
        if isinstance(unit, int):
            return cost(read, unit), (unit,)
        masks = [sum(1 << port for port in ports_in(each)) for each in unit]
        return best(read, masks, lambda seen, number: through(seen, unit[number]))

    return through(0, units)[1]


def ports_in(unit: Unit) -> Order:
    """Return the ports of a unit, in the order in which they stand there."""
    return (unit,) if isinstance(unit, int) else tuple(port for each in unit for port in ports_in(each))


def _exact(read: int, items: Sequence[int], step: _Step) -> tuple[int, Order]:
    """Return the least cost of walking through all `items` (sets of ports) after `read`, and how (Held, Karp 1962)."""
    best: list[tuple[int, Order]] = [(0, ())]
    for some in range(1, 1 << len(items)):
        ways = []
        for last in (index for index in range(len(items)) if some >> index & 1):
            others = some ^ 1 << last
            seen = read | sum(item for index, item in enumerate(items) if others >> index & 1)
            (before, way), (further, ports) = best[others], step(seen, last)
            ways.append((before + further, way + ports))
        best.append(min(ways))
    return best[-1]


def _searched(read: int, items: Sequence[int], step: _Step) -> tuple[int, Order]:
    """Return a low cost of walking through all `items` after `read`, and how.

    From the back: last comes what is cheapest then against being first. Then neighbours change places while it helps.
    """
    left, order = list(range(len(items))), list[int]()
    while left:
        seen = read | sum(items[index] for index in left)
        last = min(left, key=lambda index: step(seen & ~items[index], index)[0] - step(read, index)[0])
        left.remove(last)
        order.insert(0, last)
    found = _walked(read, items, step, order)
    improved = True
    while improved:
        improved = False
        for place in range(len(order) - 1):
            other = [*order[:place], order[place + 1], order[place], *order[place + 2 :]]
            tried = _walked(read, items, step, other)
            if tried[0] < found[0]:
                order, found, improved = other, tried, True
    return found


def _walked(read: int, items: Sequence[int], step: _Step, order: Sequence[int]) -> tuple[int, Order]:
    total, ports = 0, Order()
    for index in order:
        further, way = step(read, index)
        total, ports = total + further, ports + way
        read |= items[index]
    return total, ports
