"""From a harness and a build's tables to its scan map: the fewest transactions, in the order that decides earliest."""

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from ..errors import HarnessError
from ..harness.wiring import Harness
from ..names import list_names
from ..tables import IntegerTables
from .costs import Costs
from .decided import Decided, reach_of
from .order import Order, Unit, arranged, ports_in
from .scanmap import Port, ScanMap
from .whole import whole_scan

# Of more recorded frames than this, evenly spaced ones decide on the order.
FRAMES = 5000


def plan_scan(
    switch_names: Sequence[str],
    tables: IntegerTables,
    harness: Harness,
    bits: NDArray[np.bool_] | None = None,
    codes: NDArray[np.uint16] | None = None,
) -> ScanMap:
    """Return the scan map that reads a build's switches, named in the build's order, in `harness`.

    Of every chip it takes the fewest transactions, and as few selections as channels; what is behind one channel stays
    together. bits (n, s) and codes (n, j), where given, are recorded frames: the order is then the one that takes the
    least wire time until a scan may stop, on average over them (exactly up to order.EXACT ports). Without frames, what
    can change scores most per microsecond comes first. Raises HarnessError if a switch is wired to nothing.
    """
    wired = set(harness.switches)
    lacking = [name for name in switch_names if name not in wired]
    if lacking:
        raise HarnessError(
            f"harness {harness.name!r} has no pin or key for {list_names(lacking)}, which the build keeps: "
            "add what is missing to its file, or let --propose write one"
        )
    scan = whole_scan(harness, switch_names)
    ports = [[switch for _, switch in port.switches] for port in scan.ports]
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

    Every port is then a reading of a chip that there is, and every bit and key the switch of the build, by its name.
    """
    if scan.harness != harness.fingerprint:
        raise HarnessError(
            f"the build's scan map was made for another wiring than that of harness {harness.name!r}: "
            "compile again with --glove"
        )
    # Whoever sealed the map may have written into it what he wanted.
    wired = whole_scan(harness, switch_names)
    where = {
        (port.bus, port.chip, pin): (switch, port.closed_high)
        for port in wired.ports
        for pin, switch in _pins(port, harness)
    }
    right = scan.scanners == wired.scanners and all(
        0 <= port.bus < len(harness.buses)
        and port.chip < len(harness.buses[port.bus].chips)
        and _pins(port, harness)
        and all(
            where.get((port.bus, port.chip, pin)) == (switch, port.closed_high) for pin, switch in _pins(port, harness)
        )
        for port in scan.ports
    )
    if not right:
        raise HarnessError(
            f"the build's scan map reads other pins or keys than harness {harness.name!r} has switches on: "
            "compile again with --glove"
        )


def _pins(port: Port, harness: Harness) -> list[tuple[int, int]]:
    """Return the pins that a port's bits show, each with its switch; nothing if there is no such reading or bit."""
    readings = harness.buses[port.bus].chips[port.chip].chip.readings
    pins = next((reading.pins for reading in readings if reading.name == port.reading), ())
    return [] if any(bit >= len(pins) for bit, _ in port.switches) else [(pins[bit], n) for bit, n in port.switches]


def _by_reach(unit: Unit, reaches: Sequence[int], costs: Costs) -> Order:
    """Return the ports of a unit by how far they carry scores per time, the furthest first, its own units likewise."""
    if isinstance(unit, int):
        return (unit,)

    def pace(each: Unit) -> Fraction:
        return Fraction(sum(reaches[port] for port in ports_in(each)), costs.of(each))

    return tuple(port for each in sorted(unit, key=pace, reverse=True) for port in _by_reach(each, reaches, costs))
