"""I2C buses of a harness, their ports read in the order of a scan map."""

import time
from abc import abstractmethod
from collections.abc import Iterator, Sequence

from thenar.drivers.i2c.bus import I2cBus, PlacedPort, Scan
from thenar.drivers.i2c.chips import Converter
from thenar.drivers.i2c.supervisor import PlacedChip, Route
from thenar.drivers.spi.chips import SpiChip

from ..frames import PERIODS, BitRemap, Mask, SwitchFrame, now_us
from ..harness.wiring import Harness
from ..published import Count
from ..scanning.scanmap import SCHEMA, Port, ScanMap
from ..scanning.timing import reading_of, scan_us
from ..taxels import LiveTaxel, TaxelCalibration
from .base import Source, SourceKind, debouncer_of, paced_us


class PortReader:
    """The switches `targets` of a port, debounced: bits of its replies, some of them inverted, or levels of the taxel
    that a conversion measures.

    taxel, place  of a conversion: its taxel, and the place among the harness's
    """

    def __init__(self, port: Port, harness: Harness, calibration: TaxelCalibration | None) -> None:
        self._debouncer = debouncer_of(harness.debounce)
        self._inverted = 0 if port.closed_high else sum(1 << bit for bit, _ in port.switches)
        self._switches = BitRemap(port.switches)
        self.targets, self.taxel, self.place = self._switches.targets, None, -1
        wired = harness.wires[port.bus].chips[port.chip]
        if isinstance(wired.chip, Converter | SpiChip):
            channel = [reading.name for reading in wired.chip.readings].index(port.reading)
            name = wired.numbered_pins[channel]
            self.place = harness.taxel_names.index(name)
            self.taxel = LiveTaxel(name, port.levels, calibration, wired.chip.highest)
            self.targets = self.taxel.owned

    def states(self, reply: int | None) -> tuple[Mask, Mask]:
        """Return the closed and the lost switches from a reply that came now; None: none came."""
        if self.taxel is not None:
            closed, lost = self.taxel.read(reply)
        else:
            closed, lost = (0, self.targets) if reply is None else (self._switches(reply ^ self._inverted), 0)
        if self._debouncer is None or reply is None:
            return closed, lost
        return self._debouncer.update(now_us(), closed, self.targets & ~lost) & ~lost, lost


class PortScanner(Source):
    """A device whose ports are read in a scan: those of `ports`, bus number `bus` of a scan map."""

    def __init__(self, harness: Harness, bus: int, ports: Sequence[Port], calibration: TaxelCalibration | None) -> None:
        self._ports = [PortReader(port, harness, calibration) for port in ports]
        self.owned: Mask = sum(port.targets for port in self._ports)
        self.taxels = tuple(port.taxel for port in self._ports if port.taxel is not None)
        self._wire_us = scan_us(ScanMap(SCHEMA, tuple(ports)), harness).us
        self._everything = len(harness.taxel_names)
        self._every_s, self._due_s, self._held_up = 1.0 / harness.wires[bus].rate_hz, 0.0, 0

    @property
    def wire_us(self) -> float:
        """The time of a scan."""
        return self._wire_us

    @abstractmethod
    def replies(self) -> Sequence[int | None]:
        """Read all ports; return the reply of each, None for those that gave none."""

    def read(self, timeout_s: float) -> SwitchFrame | None:
        """Scan once, when it is due."""
        left_s = self._due_s - time.monotonic()
        if left_s > 0.0:
            time.sleep(min(left_s, timeout_s))
        if left_s > timeout_s:
            return None
        # No scan makes up for a late one.
        now_s, next_s = time.monotonic(), self._due_s + self._every_s
        self._due_s = next_s if next_s > now_s else now_s + self._every_s
        began_us, closed, lost = now_us(), 0, 0
        codes: list[int | None] = [None] * self._everything
        for port, reply in zip(self._ports, self.replies(), strict=True):
            shut, silent = port.states(reply)
            closed, lost = closed | shut, lost | silent
            if port.taxel is not None:
                codes[port.place] = reply
        time_us = now_us()
        if time_us - began_us > self.longest_us:
            # A chip held the bus: the readings before that are out of date.
            self._held_up += 1
            return SwitchFrame(time_us, 0, self.owned)
        taxels = tuple(codes) if any(code is not None for code in codes) else None
        return SwitchFrame(time_us, closed, lost, taxels=taxels)


class I2cDevice(PortScanner):
    """Bus number `number` of a harness, scanned as in `scan`, whose levels are limits in counts; only its chips are
    accessed.
    """

    def __init__(self, harness: Harness, number: int, scan: ScanMap, taxels: TaxelCalibration | None = None) -> None:
        wiring = harness.buses[number]
        ports = [port for port in scan.ports if port.bus == number]
        self.name = f"i2c at {wiring.device}"
        self.period_us = max(paced_us(wiring.rate_hz), round(scan_us(scan, harness).us))
        self.longest_us = PERIODS * self.period_us
        chips = sorted({port.chip for port in ports})
        placed = {chip: _placed(harness, number, chip, ports) for chip in chips}
        self.bus = I2cBus(wiring.device, tuple(placed.values()))
        # Conversions that are waited for come last: what is read together stays together.
        reads = [(PlacedPort(placed[port.chip], reading_of(port, harness)), port) for port in ports]
        reads.sort(key=lambda each: each[0].slow)
        self._reads = [each for each, _ in reads]
        self._scan: Scan | None = None
        super().__init__(harness, number, [port for _, port in reads], taxels)

    @property
    def part(self) -> str:  # type: ignore[override]
        """How reads are batched."""
        return f"reads {self.bus.way}"

    def open(self) -> None:
        """Open the bus and set up its chips."""
        self.bus.open()
        self._scan = self.bus.prepare(self._reads)

    def replies(self) -> Sequence[int | None]:
        """Read all ports."""
        assert self._scan is not None
        return self._scan.read()

    def counts(self) -> tuple[Count, ...]:
        """Return the numbers of transfers, of scans too slow to count, and of each chip's failures."""
        failures = (
            Count(f"failures of {chip.chip.name} at 0x{chip.address:02X}", chip.errors) for chip in self.bus.chips
        )
        return (Count("transfers", self.bus.transfers), Count("held up", self._held_up), *failures)

    def fault_message(self) -> str:
        """Return the fault of the bus, or the absent chips; "" if there is none."""
        absent = (chip.last_error for chip in self.bus.chips if not chip.present)
        return self.bus.fault_message or "; ".join(filter(None, (*absent, self.taxel_faults())))

    def close(self) -> None:
        """Close the bus."""
        self.bus.close()


def _placed(harness: Harness, bus: int, number: int, ports: list[Port]) -> PlacedChip:
    chip = harness.buses[bus].chips[number]
    shown = [(reading_of(port, harness), port) for port in ports if port.chip == number]
    used = frozenset(reading.pins[bit] for reading, port in shown for bit in ([b for b, _ in port.switches] or [0]))
    route = None if chip.mux is None else Route(chip.mux.address, chip.mux.channel)
    return PlacedChip(chip.chip, chip.address, used, route)


def _sources(
    harness: Harness, _names: Sequence[str], scan: ScanMap, taxels: TaxelCalibration | None
) -> Iterator[Source]:
    buses = sorted({port.bus for port in scan.ports if port.bus < len(harness.buses)})
    return (I2cDevice(harness, bus, scan, taxels) for bus in buses)


MEMBER = SourceKind("i2c", _sources, rank=1)
