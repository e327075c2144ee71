"""What reading each port takes on the wire, in integer nanoseconds, so that sums have no order; and what that makes
belong together.
"""

from collections.abc import Sequence

from ..harness.wiring import Harness
from .decided import Decided
from .order import Cost, Unit, ports_in
from .scanmap import Port
from .timing import port_us, reading_of, select_us, selections

# A channel of a mux, a whole mux, or a port that needs none.
_Room = tuple[int, ...]


class Costs:
    """The costs of `ports`, by their numbers.

    units are all of them as nested tuples: what is behind one channel stays together, and where a bus has more muxes
    than one, what is behind one mux.
    """

    def __init__(self, ports: Sequence[Port], harness: Harness) -> None:
        self._ns, rooms = list[int](), set(selections(ports, harness))
        opened: dict[_Room, tuple[int, int]] = {}
        nested: dict[_Room, dict[_Room, list[int]]] = {}
        for number, port in enumerate(ports):
            bus = harness.buses[port.bus]
            mux = bus.chips[port.chip].mux
            channel = (port.bus, mux.address, mux.channel) if mux else ()
            way: list[_Room] = [room for room in (channel[:2], channel) if room in rooms]
            for room in way:
                opened[room] = (opened.get(room, (0, 0))[0] | 1 << number, round(1000 * select_us(bus.clock_hz)))
            outer, inner = (way[0], way[-1]) if way else ((number,), (number,))
            nested.setdefault(outer, {}).setdefault(inner, []).append(number)
            self._ns.append(round(1000 * port_us(reading_of(port, harness), bus.clock_hz)))
        self._rooms = tuple(opened.values())
        self.units: tuple[Unit, ...] = tuple(tuple(map(tuple, inside.values())) for inside in nested.values())

    def after(self, read: int, port: int) -> int:
        """Return what reading `port` takes after the ports `read`: the first behind a channel needs it selected."""
        return self._ns[port] + sum(ns for room, ns in self._rooms if room >> port & 1 and not read & room)

    def of(self, unit: Unit) -> int:
        """Return what reading a unit takes, with the selections that it alone needs."""
        ports = ports_in(unit)
        inside = sum(1 << port for port in ports)
        return sum(self._ns[port] for port in ports) + sum(ns for room, ns in self._rooms if not room & ~inside)

    def expected(self, frames: Decided) -> Cost:
        """Return the time that reading a port takes over all `frames` that are not decided before.

        The first counts in every frame, because nothing stops a scan before it.
        """

        def cost(read: int, port: int) -> int:
            return self.after(read, port) * (frames.undecided(read) if read else len(frames))

        return cost
