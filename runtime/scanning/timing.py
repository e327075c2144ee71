"""Reading times on the wire, predicted from clocks and baud rates.

A transaction takes its SCL periods plus the time for which the bus must be free before the next START, which the
standard gives by speed: 4.7, 1.3 and 0.5 us up to 100 kHz, 400 kHz and above.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from math import fsum

from msgspec import Struct

from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chips import Conversion, Reading
from thenar.drivers.serial_line import sending_us
from thenar.drivers.spi.chips import SELECT_US, Transfer

from ..harness.wiring import GloveWiring, Harness, MuxChannel
from .ports import whole_scan
from .scanmap import Port, ScanMap

_FREE_US = ((100_000, 4.7), (400_000, 1.3))
_FREE_FASTEST_US = 0.5


class ScanTime(Struct, frozen=True):
    """The time of a whole scan in microseconds, and the writes to muxes in it.

    full_us is a scan of all switches and taxels that are wired to chips, kept or not, for comparison.
    """

    selects: int
    us: float
    full_us: float

    @property
    def share(self) -> float:
        """The scan's time as a share of the full scan's."""
        return self.us / self.full_us if self.full_us else 0.0


def free_us(clock_hz: int) -> float:
    """Return the time for which a bus of this clock must be free between a STOP and the next START."""
    return next((us for clock, us in _FREE_US if clock_hz <= clock), _FREE_FASTEST_US)


def port_us(reading: Reading, clock_hz: int) -> float:
    """Return the time of one reading, in microseconds; a conversion includes the transfer that begins it, and the wait
    for its result.
    """
    us = reading.scl_periods * 1e6 / clock_hz
    if isinstance(reading, Transfer):
        return us + SELECT_US
    if isinstance(reading, Conversion) and reading.start:
        us += reading.start_periods * 1e6 / clock_hz + free_us(clock_hz) + reading.us
    return us + free_us(clock_hz)


def select_us(clock_hz: int) -> float:
    """Return the wire time of selecting a channel of a mux, in microseconds."""
    return tca9548a.SCL_PERIODS * 1e6 / clock_hz + free_us(clock_hz)


def mux_of(port: Port, harness: Harness) -> MuxChannel | None:
    """Return the channel that a port is behind."""
    return harness.wires[port.bus].chips[port.chip].mux


def reading_of(port: Port, harness: Harness) -> Reading:
    """Return the transaction that `port` names. Raises KeyError if its chip has none of that name."""
    readings = harness.wires[port.bus].chips[port.chip].chip.readings
    return {reading.name: reading for reading in readings}[port.reading]


def scan_us(scan: ScanMap, harness: Harness) -> ScanTime:
    """Return the time of a scan of the map with all ports."""
    everything = whole_scan(harness, harness.switches, every_taxel=True).ports
    us, full_us = (_reading_us(ports, harness) for ports in (scan.ports, everything))
    return ScanTime(len(selections(scan.ports, harness)), us, full_us)


def _reading_us(ports: Sequence[Port], harness: Harness) -> float:
    """Return the time to read these ports. fsum: in another order, the same to the last bit."""
    chosen = (select_us(harness.wires[bus].clock_hz) for bus, *_ in selections(ports, harness))
    reads = (port_us(reading_of(port, harness), harness.wires[port.bus].clock_hz) for port in ports)
    return fsum((*chosen, *reads))


def selections(ports: Iterable[Port], harness: Harness) -> tuple[tuple[int, ...], ...]:
    """Return the writes to muxes in a scan: (bus, mux, channel) to select a channel, (bus, mux) to leave another mux
    for this one.

    A bus on which only one channel is read stays on it.
    """
    places = [(port.bus, mux_of(port, harness)) for port in ports]
    channels = dict.fromkeys((bus, mux.address, mux.channel) for bus, mux in places if mux is not None)
    rooms: list[tuple[int, ...]] = [*channels, *dict.fromkeys((bus, mux) for bus, mux, _ in channels)]
    alike = Counter((room[0], len(room)) for room in rooms)
    return tuple(room for room in rooms if alike[room[0], len(room)] > 1)


def glove_us(glove: GloveWiring, sensors: int) -> float:
    """Return the shortest period of a CyberGlove's records of `sensors` sensors, in microseconds.

    It is the vendor's formula (`shortest_us`), and no less than the requested period.
    """
    from thenar.drivers.cyberglove_protocol import shortest_us  # for gloves with one

    us = shortest_us(sensors, glove.baud, status=True, filtered=bool(glove.filter))
    return max(us, 1e6 / glove.rate_hz if glove.rate_hz else 0.0)


# A row of a board without its switches and readings: name, sequence number, clock, checksum, end of line. A reading has
# at most five digits.
_ROW_BYTES, _READING_BYTES = len("$row,65535,4294967295,*00\r\n"), len(",65535")


def row_us(switches: int, readings: int, baud: int) -> float:
    """Return the time of a board's row on a serial line, in microseconds."""
    return sending_us(_ROW_BYTES + -(-switches // 4) + readings * _READING_BYTES, baud)
