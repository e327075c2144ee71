"""From a harness to the scan map of a build: the fewest transactions, and their costs.

Units stay together, such as the ports behind one channel of a mux. A unit is a port, or a row of units without anything
in between. Costs are wire times in integer nanoseconds, so that sums do not depend on order.
"""

from collections.abc import Sequence
from typing import Union

from msgspec.structs import replace

from ..errors import HarnessError
from ..harness.wiring import Harness
from ..names import list_names
from .ports import whole_scan
from .scanmap import Port, ScanMap
from .timing import mux_of, port_us, reading_of, select_us, selections

Unit = Union[int, Sequence["Unit"]]  # noqa: UP007 (an alias of itself has to be quoted)


def ports_in(unit: Unit) -> tuple[int, ...]:
    """Return the ports of a unit, in order."""
    return (unit,) if isinstance(unit, int) else tuple(port for each in unit for port in ports_in(each))


# A channel of a mux, a whole mux, or a port that needs none.
_Room = tuple[int, ...]


class Costs:
    """The costs of `ports`, by their numbers.

    units holds all of them as nested tuples: the ports behind one channel stay together, and if a bus has several
    muxes, those behind one mux.
    """

    def __init__(self, ports: Sequence[Port], harness: Harness) -> None:
        self._ns, rooms = list[int](), set(selections(ports, harness))
        opened: dict[_Room, tuple[int, int]] = {}
        nested: dict[_Room, dict[_Room, list[int]]] = {}
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
        self._rooms = tuple(opened.values())
        self.units: tuple[Unit, ...] = tuple(tuple(map(tuple, inside.values())) for inside in nested.values())

    def after(self, read: int, port: int) -> int:
        """Return the time to read `port` after the ports `read`: the first behind a channel must select it."""
        return self._ns[port] + sum(ns for room, ns in self._rooms if room >> port & 1 and not read & room)

    def of(self, unit: Unit) -> int:
        """Return the time to read a unit, with the selections that it alone needs."""
        ports = ports_in(unit)
        inside = sum(1 << port for port in ports)
        own = sum(self._ns[port] for port in ports)
        return own + sum(ns for room, ns in self._rooms if not room & ~inside)

    def shares(self) -> list[float]:
        """Return the nanoseconds of each port: its time, and its share of the common time of its unit."""
        shares = [0.0] * len(self._ns)
        for unit in self.units:
            ports = ports_in(unit)
            # Read after all other ports, a port of a shared channel costs only its own time.
            everything = sum(1 << port for port in ports)
            alone = [self.after(everything, port) for port in ports]
            common = (self.of(unit) - sum(alone)) / len(ports)
            for port, ns in zip(ports, alone, strict=True):
                shares[port] = ns + common
        return shares


def plan_scan(switch_names: Sequence[str], harness: Harness) -> ScanMap:
    """Return the scan map that reads a build's switches, named in the build's order, in `harness`.

    For every chip it takes the fewest transactions, and no more selections than channels: ports behind one channel stay
    together. Raises HarnessError if a switch is wired to nothing.
    """
    if lacking := unwired(harness, switch_names):
        raise HarnessError(
            f"harness {harness.name!r} has no pin or column for {list_names(lacking)}, which the build keeps: "
            "add what is missing to its file, or let ``propose`` write one"
        )
    scan = whole_scan(harness, switch_names)
    return replace(scan, ports=tuple(scan.ports[port] for port in ports_in(Costs(scan.ports, harness).units)))


def check_harness(scan: ScanMap, harness: Harness, switch_names: Sequence[str]) -> None:
    """Raise HarnessError unless `scan` was made for `harness`; ports, devices and clocks may have changed since.

    Every port is then a reading of an existing chip, and every bit and column is the switch of the build, by its name.
    """
    if scan.harness != harness.fingerprint:
        raise HarnessError(
            f"the build's scan map was made for another wiring than harness {harness.name!r}: "
            "compile again with ``glove``"
        )
    # A sealed map may still hold anything its author wanted.
    wired = whole_scan(harness, switch_names)
    where = {
        (port.bus, port.chip, pin): (switch, port.closed_high)
        for port in wired.ports
        for pin, switch in _pins(port, harness)
    }
    conversions = {(port.bus, port.chip, port.reading): port for port in wired.ports if port.levels}
    right = scan.streams == wired.streams and all(
        conversions.get((port.bus, port.chip, port.reading)) == port
        if port.levels
        else bool(pins := _pins(port, harness))
        and all(where.get((port.bus, port.chip, pin)) == (switch, port.closed_high) for pin, switch in pins)
        for port in scan.ports
    )
    if not right:
        raise HarnessError(
            f"the build's scan map reads other pins or columns than harness {harness.name!r} has switches on: "
            "compile again with ``glove``"
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
