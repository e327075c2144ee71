"""From a harness to the scan map of a build: the fewest transactions."""

from collections.abc import Sequence
from itertools import chain

from msgspec.structs import replace

from ..errors import HarnessError
from ..harness.wiring import Harness
from ..names import list_names
from .ports import whole_scan
from .scanmap import Port, ScanMap
from .timing import mux_of, selections

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


def unwired(harness: Harness, switch_names: Sequence[str]) -> list[str]:
    """Return the names that are wired to nothing: neither switches nor levels of taxels of the harness."""
    read = set(whole_scan(harness, switch_names).switches)
    return [name for number, name in enumerate(switch_names) if number not in read]
