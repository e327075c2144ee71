"""From a harness to the scan map of a build: the fewest transactions."""

from collections.abc import Sequence
from itertools import chain

from msgspec.structs import replace

from ..errors import HarnessError
from ..harness.wiring import Harness
from ..names import list_names
from .ports import whole_scan
from .scanmap import Port, ScanMap
from .timing import mux_of, reading_of, selections

Room = tuple[int, ...]


def rooms_of(port: Port, harness: Harness) -> tuple[Room, ...]:
    """Return the mux that a port is behind, (bus, address), and the channel, (bus, address, channel), if any."""
    mux = mux_of(port, harness)
    return () if mux is None else ((port.bus, mux.address), (port.bus, mux.address, mux.channel))


def units_of(ports: Sequence[Port], harness: Harness) -> tuple[tuple[int, ...], ...]:
    """Return the numbers of ports that are read one after the other: those behind one channel, and if a bus has several
    muxes, those behind one mux; a port that needs no selection is alone.
    """
    rooms = set(selections(ports, harness))
    nested: dict[Room, dict[Room, list[int]]] = {}
    for number, port in enumerate(ports):
        way = [room for room in rooms_of(port, harness) if room in rooms] or [(number,)]
        nested.setdefault(way[0], {}).setdefault(way[-1], []).append(number)
    return tuple(tuple(chain(*inside.values())) for inside in nested.values())


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
    return replace(scan, ports=tuple(scan.ports[port] for port in chain(*units_of(scan.ports, harness))))


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
