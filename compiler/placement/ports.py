"""Costs of reading switches, port by port, on the glove that grasps are recorded with."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import fsum

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.cyberglove_protocol import SENSORS, sensors_with
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.wiring import GloveWiring, Harness
from thenar.runtime.scanning.plan import Room, rooms_of, units_of, unwired
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.scanmap import Port
from thenar.runtime.scanning.timing import glove_us, port_us, reading_of, select_us, selections

from ..glove.propose import propose_harness
from ..samples import TrainingError


class WireTimes:
    """The times of `ports` on the wire, by their numbers: integer nanoseconds, so that sums do not depend on order."""

    def __init__(self, ports: Sequence[Port], harness: Harness) -> None:
        self._ns, rooms = list[int](), set(selections(ports, harness))
        opened: dict[Room, tuple[int, int]] = {}
        for number, port in enumerate(ports):
            clock_hz = harness.wires[port.bus].clock_hz
            for room in rooms.intersection(rooms_of(port, harness)):
                opened[room] = (opened.get(room, (0, 0))[0] | 1 << number, round(1000 * select_us(clock_hz)))
            self._ns.append(round(1000 * port_us(reading_of(port, harness), clock_hz)))
        self._rooms, self._units = tuple(opened.values()), units_of(ports, harness)

    def after(self, read: int, port: int) -> int:
        """Return the time to read `port` after the ports `read`: the first behind a channel must select it."""
        return self._ns[port] + sum(ns for room, ns in self._rooms if room >> port & 1 and not read & room)

    def of(self, unit: Sequence[int]) -> int:
        """Return the time to read some ports, with the selections that they alone need."""
        inside = sum(1 << port for port in unit)
        return sum(self._ns[port] for port in unit) + sum(ns for room, ns in self._rooms if not room & ~inside)

    def shares(self) -> list[float]:
        """Return the nanoseconds of each port: its time, and its share of the common time of its unit."""
        shares = [0.0] * len(self._ns)
        for unit in self._units:
            # Read after all other ports, a port of a shared channel costs only its own time.
            everything = sum(1 << port for port in unit)
            alone = [self.after(everything, port) for port in unit]
            common = (self.of(unit) - sum(alone)) / len(unit)
            for port, ns in zip(unit, alone, strict=True):
                shares[port] = ns + common
        return shares


@dataclass(frozen=True, slots=True)
class PortCosts:
    """Scan time by port: reading port p takes us[p] once, however many of its switches are kept.

    port_of  (s,) the port of every switch, an index of `us`
    us       (ports,) microseconds, >= 0

    Raises TrainingError if a switch is on an unknown port, or a time is negative or not finite.
    """

    port_of: tuple[int, ...]
    us: tuple[float, ...]

    def __post_init__(self) -> None:
        if any(not 0 <= port < len(self.us) for port in self.port_of):
            raise TrainingError(f"every switch must be on one of the {len(self.us)} ports with a given time")
        if any(not 0 <= us < float("inf") for us in self.us):
            raise TrainingError("the time that reading a port takes must be finite and at least 0 µs")

    def shares(self, kept: Iterable[int]) -> NDArray[np.float64]:
        """Return each kept switch's share of its port's time, split evenly among the port's kept switches, as a
        multiple of the mean time of a port; 0 if no port takes any time.
        """
        on = np.array([self.port_of[column] for column in kept], dtype=np.intp)
        us = np.array(self.us)
        mean = fsum(self.us) / len(self.us) if any(self.us) else 1.0
        shares: NDArray[np.float64] = us[on] / (np.bincount(on, minlength=len(us))[on] * mean)
        return shares

    def marginal_costs(self, kept: Iterable[int]) -> NDArray[np.int64]:
        """Return, for every switch, sum of all ports' times + number of ports * time that it adds to `kept`.

        Integer nanoseconds, so that comparisons are exact; all 1 if no port takes any time.
        """
        times = np.array([round(us * 1000) for us in self.us], dtype=np.int64)
        if not times.any():
            return np.ones(len(self.port_of), dtype=np.int64)
        left = times * len(times)
        left[sorted({self.port_of[column] for column in kept})] = 0
        costs: NDArray[np.int64] = times.sum() + left[np.array(self.port_of, dtype=np.intp)]
        return costs


def ports_of_whole_glove(harness: Harness | None, names: Sequence[str], taxels: int = 0) -> PortCosts | None:
    """Return the costs of the ports with all switches `names`, the last `taxels` of which are taxels: in `harness`, or
    without one, on as few MCP23017 and converters as suffice, in the order of the names.

    None if a harness lacks switches, as that of a reduced glove does, or if they do not fit.
    """
    if not names or (harness is not None and unwired(harness, names)):
        return None
    try:
        switches = len(names) - taxels
        return port_costs(harness or propose_harness(names[:switches], taxels=names[switches:]), names)
    except HarnessError:
        return None


def record_times_us(joints: Sequence[str], glove: GloveWiring | None = None) -> tuple[float, ...]:
    """Return the times of a CyberGlove's records of one, of two, ... and of all of these joints; () for other joints.

    The record is that of `glove`, whose mask may let all sensors through, or of one at 115200 baud.
    """
    own = glove is not None and set(joints) <= set(glove.joints)
    sensors = glove.all_sensors if glove is not None and own else sensors_with(joints)
    if sensors is None or not joints:
        return ()
    glove = glove or GloveWiring(port="-", sensors=22 if sensors > SENSORS else None)
    return tuple(glove_us(glove, count if glove.mask else sensors) for count in range(1, len(joints) + 1))


def port_costs(harness: Harness, names: Sequence[str]) -> PortCosts:
    """Return the cost of reading each port, with all switches `names` on the ports of a whole scan.

    The cost of selecting a mux channel is shared evenly by the ports that need it. A port is charged as a whole even if
    a shorter read would return the one kept switch. A board's keys are one port, since it always sends them all. Each
    of its taxels is one: its conversion, its bytes, and its share of the frame overhead. Raises HarnessError if a
    switch is not wired.
    """
    scan = whole_scan(harness, names)
    ports = scan.ports
    us = [ns / 1000 for ns in WireTimes(ports, harness).shares()]
    port_of: dict[int, int] = {}
    for number, port in enumerate(ports):
        port_of |= dict.fromkeys(port.elements, number)
    for stream, read in zip(harness.streams, scan.streams, strict=True):
        port_of |= {pair[-1]: len(us) for pair in (*read.switches, *read.levels)}
        us.append(float(stream.period_us))
    lacking = next((name for number, name in enumerate(names) if number not in port_of), None)
    if lacking is not None:
        raise HarnessError(
            f"harness {harness.name!r} has no pin or column for {lacking!r}: add it to its file, or leave ``glove`` out"
        )
    return PortCosts(tuple(port_of[number] for number in range(len(names))), tuple(us))
