"""How long reading takes on the wire, predicted from clocks and baud rates.

A transaction takes its SCL periods and the time for which the bus must be free before the next START, which the
standard gives by speed: 4.7, 1.3 and 0.5 us up to 100 kHz, 400 kHz and above. Each transaction and each selection of a
mux's channel is one system call, whose cost is the machine's own and is given by the caller.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from math import fsum

from msgspec import Struct

from thenar.drivers import cyberglove_protocol as glove_protocol
from thenar.drivers.cyberglove_protocol import sending_us, shortest_us
from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chips import Reading
from thenar.drivers.scanner_protocol import OVERHEAD

from ..harness.wiring import GloveWiring, Harness, ScannerWiring
from .ports import ports_of
from .scanmap import Port, ScanMap

_FREE_US = ((100_000, 4.7), (400_000, 1.3))
_FREE_FASTEST_US = 0.5
_BAUD = 115_200


class ChipTime(Struct, frozen=True):
    """What one chip of a scan takes: harness.buses[bus].chips[chip], by name; its readings; how many kept switches they
    show; microseconds, system calls included, selections of its channel not.
    """

    bus: int
    chip: int
    device: str
    place: str
    readings: tuple[str, ...]
    switches: int
    us: float


class ScanTime(Struct, frozen=True):
    """What a whole scan takes: chip by chip in the order in which they are first read, selections, and all together.

    full_us is a scan of all the switches that are wired to chips, kept or not, for comparison.
    """

    chips: tuple[ChipTime, ...]
    selects: int
    select_us: float
    us: float
    full_us: float

    @property
    def share(self) -> float:
        """The scan's time as a share of the full one's."""
        return self.us / self.full_us if self.full_us else 0.0


def free_us(clock_hz: int) -> float:
    """Return for how long a bus of this clock must be free between a STOP and the next START."""
    return next((us for clock, us in _FREE_US if clock_hz <= clock), _FREE_FASTEST_US)


def port_us(reading: Reading, clock_hz: int) -> float:
    """Return what one reading takes on the wire, in microseconds."""
    return reading.scl_periods * 1e6 / clock_hz + free_us(clock_hz)


def select_us(clock_hz: int) -> float:
    """Return what selecting a channel of a mux takes on the wire, in microseconds."""
    return tca9548a.SCL_PERIODS * 1e6 / clock_hz + free_us(clock_hz)


def reading_of(port: Port, harness: Harness) -> Reading:
    """Return the transaction that `port` names."""
    chip = harness.buses[port.bus].chips[port.chip].chip
    return next(reading for reading in chip.readings if reading.name == port.reading)


def scan_us(scan: ScanMap, harness: Harness, ioctl_us: float = 0.0) -> ScanTime:
    """Return what a scan of the map takes, no port left out, with system calls of `ioctl_us` microseconds each."""
    chips = tuple(_chip_times(scan.ports, harness, ioctl_us))
    chosen = _selected_us(scan.ports, harness, ioctl_us)
    everything = ports_of(harness, {name: number for number, name in enumerate(harness.switches)})
    full = (*_selected_us(everything, harness, ioctl_us), *(t.us for t in _chip_times(everything, harness, ioctl_us)))
    # fsum: the same ports in another order take the same time to the last bit.
    us = fsum((*chosen, *(chip.us for chip in chips)))
    return ScanTime(chips, len(chosen), fsum(chosen), us, fsum(full))


def selections(ports: Iterable[Port], harness: Harness) -> tuple[tuple[int, ...], ...]:
    """Return what has to be written to muxes in a scan: (bus, mux, channel) to select a channel, (bus, mux) to leave
    another mux for this one.

    A bus on which only one channel is read stays on it.
    """
    places = [(port.bus, harness.buses[port.bus].chips[port.chip].mux) for port in ports]
    channels = dict.fromkeys((bus, mux.address, mux.channel) for bus, mux in places if mux is not None)
    rooms: list[tuple[int, ...]] = [*channels, *dict.fromkeys((bus, mux) for bus, mux, _ in channels)]
    alike = Counter((room[0], len(room)) for room in rooms)
    return tuple(room for room in rooms if alike[room[0], len(room)] > 1)


def glove_us(glove: GloveWiring, sensors: int, *, wire_only: bool = False) -> float:
    """Return the shortest period of a CyberGlove's records of so many sensors, in microseconds.

    It is the vendor's formula (`shortest_us`), in the proportion in which `record_us` was measured to it for all
    sensors; and no less than the period at which records are asked for. `wire_only` leaves out what the box takes to
    digitise. The rate is 115200 baud where it is to be found.
    """
    baud = _BAUD if glove.baud == "auto" else glove.baud
    if wire_only:
        return sending_us(sensors + glove_protocol.OVERHEAD + 1, baud)
    filtered = bool(glove.filter)
    us = shortest_us(sensors, baud, status=True, filtered=filtered)
    if glove.record_us is not None:
        us *= glove.record_us / shortest_us(glove.all_sensors, baud, status=True, filtered=filtered)
    return max(us, 1e6 / glove.rate_hz if glove.rate_hz else 0.0)


def scanner_us(scanner: ScannerWiring) -> float:
    """Return how long a board's full bitmap takes on its line, in microseconds."""
    return sending_us(-(-len(scanner.switches) // 8) + OVERHEAD, scanner.baud)


def _selected_us(ports: Iterable[Port], harness: Harness, ioctl_us: float) -> list[float]:
    return [select_us(harness.buses[bus].clock_hz) + ioctl_us for bus, *_ in selections(ports, harness)]


def _chip_times(ports: Iterable[Port], harness: Harness, ioctl_us: float) -> Iterator[ChipTime]:
    by_chip: dict[tuple[int, int], list[Port]] = {}
    for port in ports:
        by_chip.setdefault((port.bus, port.chip), []).append(port)
    for (bus, chip), group in by_chip.items():
        wiring = harness.buses[bus]
        yield ChipTime(
            bus=bus,
            chip=chip,
            device=wiring.device,
            place=wiring.chips[chip].place,
            readings=tuple(port.reading for port in group),
            switches=sum(len(port.switches) for port in group),
            us=sum(port_us(reading_of(port, harness), wiring.clock_hz) + ioctl_us for port in group),
        )
