"""From a harness and a build's tables to its scan map: the fewest transactions, in the order that decides earliest.

Units stay together, such as the ports behind one channel of a mux; the rest is ordered for the least expected cost. A
unit is a port, or a row of units without anything in between. Costs are wire times in integer nanoseconds, so that sums
do not depend on order; the cost of an order is the sum over its ports.
"""

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Union

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from ..errors import HarnessError
from ..harness.wiring import Harness
from ..names import list_names
from ..tables import IntegerTables
from .decided import Decided, reach_of
from .ports import whole_scan
from .scanmap import Port, ScanMap
from .timing import mux_of, port_us, reading_of, select_us, selections, waiting_us

# Up to this many ports every order is evaluated (2^n sets of ports); above, a heuristic searches for a good one.
EXACT = 10

Order = tuple[int, ...]
Unit = Union[int, Sequence["Unit"]]  # noqa: UP007 (an alias of itself has to be quoted)
# Cost of reading a port, the last argument, after a set of ports: bit p is port p.
Cost = Callable[[int, int], int]
# Cost and order of walking through item number i after a set of ports.
_Step = Callable[[int, int], tuple[int, Order]]


def arranged(units: Sequence[Unit], cost: Cost) -> Order:
    """Return all ports of all `units` in an order of low cost; the lowest up to EXACT ports."""
    best = _exact if len(ports_in(units)) <= EXACT else _searched

    def through(read: int, unit: Unit) -> tuple[int, Order]:
        if isinstance(unit, int):
            return cost(read, unit), (unit,)
        masks = [sum(1 << port for port in ports_in(each)) for each in unit]
        return best(read, masks, lambda seen, number: through(seen, unit[number]))

    return through(0, units)[1]


def ports_in(unit: Unit) -> Order:
    """Return the ports of a unit, in order."""
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

    It builds the order from the back: last comes the item that saves most by not being first. Then neighbours are
    exchanged while that helps.
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


# A channel of a mux, a whole mux, or a port that needs none.
_Room = tuple[int, ...]


class Costs:
    """The costs of `ports`, by their numbers.

    units holds all of them as nested tuples: the ports behind one channel stay together, and if a bus has several
    muxes, those behind one mux. A bus with slow conversions takes as long as its wire, or as the chip whose conversions
    together take longest: they go on while the bus reads other ports.
    """

    def __init__(self, ports: Sequence[Port], harness: Harness) -> None:
        self._ns, rooms = list[int](), set(selections(ports, harness))
        opened: dict[_Room, tuple[int, int]] = {}
        nested: dict[_Room, dict[_Room, list[int]]] = {}
        chips: dict[tuple[int, int], int] = {}
        self._waits: list[int] = []
        for number, port in enumerate(ports):
            clock_hz, reading = harness.line_of(port.bus).clock_hz, reading_of(port, harness)
            mux = mux_of(port, harness)
            channel = (port.bus, mux.address, mux.channel) if mux else ()
            way: list[_Room] = [room for room in (channel[:2], channel) if room in rooms]
            for room in way:
                opened[room] = (opened.get(room, (0, 0))[0] | 1 << number, round(1000 * select_us(clock_hz)))
            outer, inner = (way[0], way[-1]) if way else ((number,), (number,))
            nested.setdefault(outer, {}).setdefault(inner, []).append(number)
            self._ns.append(round(1000 * port_us(reading, clock_hz)))
            self._waits.append(round(1000 * waiting_us(reading)))
            chips[port.bus, port.chip] = chips.get((port.bus, port.chip), 0) | 1 << number
        self._rooms = tuple(opened.values())
        self.units: tuple[Unit, ...] = tuple(tuple(map(tuple, inside.values())) for inside in nested.values())
        self._slow: list[tuple[int, tuple[int, ...]]] = []  # of each bus with waiting times: its ports, chip by chip
        for bus in dict.fromkeys(bus for bus, _ in chips):
            mine = tuple(mask for (on, _), mask in chips.items() if on == bus)
            if any(self._waits[port] for port in range(len(ports)) if sum(mine) >> port & 1):
                self._slow.append((sum(mine), mine))

    def after(self, read: int, port: int) -> int:
        """Return the time to read `port` after the ports `read`: the first behind a channel must select it."""
        for every, chips in self._slow:
            if every >> port & 1:
                return self._elapsed((read | 1 << port) & every, chips) - self._elapsed(read & every, chips)
        return self._ns[port] + sum(ns for room, ns in self._rooms if room >> port & 1 and not read & room)

    def _elapsed(self, read: int, chips: Sequence[int]) -> int:
        """Return the time of a bus with these chips for the ports `read`, all of them its own."""
        wire = sum(self._ns[port] for port in _numbers(read)) + sum(ns for room, ns in self._rooms if room & read)
        slowest = max(sum(self._ns[port] + self._waits[port] for port in _numbers(read & chip)) for chip in chips)
        return max(wire, slowest)

    def of(self, unit: Unit) -> int:
        """Return the time to read a unit, with the selections that it alone needs."""
        ports = ports_in(unit)
        inside = sum(1 << port for port in ports)
        # Conversions count as if nothing were read in parallel.
        own = sum(self._ns[port] + self._waits[port] for port in ports)
        return own + sum(ns for room, ns in self._rooms if not room & ~inside)

    def expected(self, frames: Decided) -> Cost:
        """Return the time to read a port, summed over all `frames` that are not decided before.

        The first counts in every frame, because nothing stops a scan before it.
        """

        def cost(read: int, port: int) -> int:
            return self.after(read, port) * (frames.undecided(read) if read else len(frames))

        return cost


def _numbers(ports: int) -> Iterator[int]:
    return (port for port in range(ports.bit_length()) if ports >> port & 1)


# With more recorded frames than this, evenly spaced ones decide the order.
FRAMES = 5000


def plan_scan(
    switch_names: Sequence[str],
    tables: IntegerTables,
    harness: Harness,
    bits: NDArray[np.bool_] | None = None,
    codes: NDArray[np.uint16] | None = None,
) -> ScanMap:
    """Return the scan map that reads a build's switches, named in the build's order, in `harness`.

    For every chip it takes the fewest transactions, and no more selections than channels; ports behind one channel stay
    together. bits (n, s) and codes (n, j), if given, are recorded frames: the order is then the one with the least
    average wire time until a scan may stop (exact up to EXACT ports). Without frames, the ports that can change scores
    most per microsecond come first. Raises HarnessError if a switch is wired to nothing.
    """
    if lacking := unwired(harness, switch_names):
        raise HarnessError(
            f"harness {harness.name!r} has no pin or key for {list_names(lacking)}, which the build keeps: "
            "add what is missing to its file, or let --propose write one"
        )
    scan = whole_scan(harness, switch_names)
    ports = [port.elements for port in scan.ports]
    costs = Costs(scan.ports, harness)
    if bits is None or not len(bits):
        order = _by_reach(costs.units, [reach_of(tables, port) for port in ports], costs)
    else:
        rows = np.linspace(0, len(bits) - 1, min(FRAMES, len(bits))).astype(np.intp)
        chosen = np.zeros((len(rows), 0), np.uint16) if codes is None else codes[rows]
        order = arranged(costs.units, costs.expected(Decided(tables, ports, bits[rows], chosen)))
    return replace(scan, ports=tuple(scan.ports[port] for port in order))


def check_harness(scan: ScanMap, harness: Harness, switch_names: Sequence[str]) -> None:
    """Raise HarnessError unless `scan` was made for `harness`; ports, devices and clocks may have changed since.

    Every port is then a reading of an existing chip, and every bit and key is the switch of the build, by its name.
    """
    if scan.harness != harness.fingerprint:
        raise HarnessError(
            f"the build's scan map was made for another wiring than harness {harness.name!r}: "
            "compile again with --glove"
        )
    # A sealed map may still hold anything its author wanted.
    wired = whole_scan(harness, switch_names)
    where = {
        (port.bus, port.chip, pin): (switch, port.closed_high)
        for port in wired.ports
        for pin, switch in _pins(port, harness)
    }
    conversions = {(port.bus, port.chip, port.reading): port for port in wired.ports if port.levels}
    boards = (wired.scanners, wired.taxels, wired.streams)
    right = (scan.scanners, scan.taxels, scan.streams) == boards and all(
        conversions.get((port.bus, port.chip, port.reading)) == port
        if port.levels
        else bool(pins := _pins(port, harness))
        and all(where.get((port.bus, port.chip, pin)) == (switch, port.closed_high) for pin, switch in pins)
        for port in scan.ports
    )
    if not right:
        raise HarnessError(
            f"the build's scan map reads other pins or keys than harness {harness.name!r} has switches on: "
            "compile again with --glove"
        )


def unwired(harness: Harness, switch_names: Sequence[str]) -> list[str]:
    """Return the names that are wired to nothing: neither switches nor levels of taxels of the harness."""
    read = set(whole_scan(harness, switch_names).switches)
    return [name for number, name in enumerate(switch_names) if number not in read]


def _pins(port: Port, harness: Harness) -> list[tuple[int, int]]:
    """Return the pins that a port's bits show, each with its switch; nothing if there is no such reading or bit."""
    try:
        pins = reading_of(port, harness).pins
    except LookupError:
        return []
    return [] if any(bit >= len(pins) for bit, _ in port.switches) else [(pins[bit], n) for bit, n in port.switches]


def _by_reach(unit: Unit, reaches: Sequence[int], costs: Costs) -> Order:
    """Return the ports of a unit by their reach per time, the furthest first, its inner units likewise."""
    if isinstance(unit, int):
        return (unit,)

    def pace(each: Unit) -> Fraction:
        return Fraction(sum(reaches[port] for port in ports_in(each)), costs.of(each))

    return tuple(port for each in sorted(unit, key=pace, reverse=True) for port in _by_reach(each, reaches, costs))
