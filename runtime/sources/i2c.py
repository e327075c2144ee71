"""I2C buses of a harness, their ports read in the order of a scan map, to the end or until the rest cannot matter."""

import time
from collections.abc import Iterator, Sequence

from thenar.drivers.i2c.bus import ChipAt, I2cBus, PortRead, Scan

from ..calibration import Joints
from ..frames import PERIODS, GloveFrame, Mask, Newest, Rewired, SwitchFrame, now_us
from ..harness.wiring import Debounce, Harness
from ..published import Count
from ..scanning.decided import EarlyExit
from ..scanning.scanmap import Port, ScanMap
from ..scanning.timing import reading_of, scan_us
from .base import SHORTEST_US, ExitOf, Source, SourceKind, debouncer_of, pause_us

# A bus whose chips are all gone is not asked in a busy loop.
_NOBODY_THERE_S = 0.01


class _PortSwitches:
    """What the answer of a port says: which of its bits are inverted, the switches that they are, debounced."""

    def __init__(self, port: Port, debounce: Debounce) -> None:
        self._inverted = 0 if port.closed_high else sum(1 << bit for bit, _ in port.switches)
        self.switches = Rewired(port.switches)
        self._debounce, self._debouncer = debounce, debouncer_of(debounce)
        self._pause_us = pause_us(debounce)
        self._read_us = 0

    def closed(self, answer: int, time_us: int) -> Mask:
        """Return which switches are closed."""
        closed = self.switches(answer ^ self._inverted)
        if self._debouncer is not None and time_us - self._read_us > self._pause_us:
            self._debouncer = debouncer_of(self._debounce)
        self._read_us = time_us
        return closed if self._debouncer is None else self._debouncer.update(time_us, closed, self.switches.targets)


class I2cDevice(Source):
    """Bus number `number` of a harness, scanned as `scan` has it; only the chips that it names are touched."""

    def __init__(self, harness: Harness, number: int, scan: ScanMap) -> None:
        wiring = harness.buses[number]
        ports = [port for port in scan.ports if port.bus == number]
        self.name = f"i2c at {wiring.device}"
        self.period_us = _bus_period_us(scan, harness)
        self.longest_us = PERIODS * self.period_us
        self._ports = [_PortSwitches(port, harness.debounce) for port in ports]
        self.owned: Mask = sum(port.switches.targets for port in self._ports)
        chips = sorted({port.chip for port in ports})
        chips_at = [_chip_at(harness, number, chip, ports) for chip in chips]
        self.bus = I2cBus(wiring.device, chips_at, clock_hz=wiring.clock_hz)
        self._reads = [PortRead(chips.index(port.chip), reading_of(port, harness)) for port in ports]
        self._scans: list[Scan] = []
        self._early: tuple[EarlyExit, Joints, Newest[GloveFrame]] | None = None
        self._held_up = 0

    def end_early(self, exit_of: ExitOf, joints: Joints, glove: Newest[GloveFrame]) -> None:
        """Scan no further than until the ports not yet read cannot change the answer any more."""
        self._early = exit_of([port.switches.targets for port in self._ports]), joints, glove

    def open(self) -> None:
        """Open the bus and set up its chips."""
        self.bus.open()
        step = 1 if self._early else len(self._reads)
        self._scans = [self.bus.prepare(self._reads[at : at + step]) for at in range(0, len(self._reads), step)]

    def scan(self, chip: int | None = None) -> Scan:
        """Return what reads all ports, or those of the bus's chip of this number, once more."""
        return self.bus.prepare([read for read in self._reads if chip is None or read.chip == chip])

    def read(self, timeout_s: float) -> SwitchFrame | None:
        """Scan once."""
        began_us = now_us()
        frame = self._whole() if self._early is None else self._until_decided(*self._early)
        if frame.time_us - began_us > self.longest_us:
            # A chip held the bus up: what was read before it is no news any more.
            frame = SwitchFrame(frame.time_us, 0, self.owned)
            self._held_up += 1
        elif not self.owned & ~(frame.lost | frame.unread):
            time.sleep(min(timeout_s, _NOBODY_THERE_S))
        return frame

    def _until_decided(self, early: EarlyExit, joints: Joints, newest: Newest[GloveFrame]) -> SwitchFrame:
        # On demand, no scan ends by a record: what it leaves unread matters for none.
        glove = None if early.on_demand else newest.frame
        early.start(joints.codes(now_us(), glove))
        closed = lost = 0
        for number, scan in enumerate(self._scans):
            shut, silent = self._decoded(number, scan.read()[0])
            closed, lost = closed | shut, lost | silent
            if early.after(number, shut, silent):
                break
        return SwitchFrame(now_us(), closed, lost, early.unread(number), glove)

    def counts(self) -> tuple[Count, ...]:
        """Return how many transfers there were, how many scans were too slow to count, and each chip's failures."""
        failures = (
            Count(f"failures of {chip.chip.name} at 0x{chip.address:02X}", chip.errors) for chip in self.bus.chips
        )
        return (Count("transfers", self.bus.transfers), Count("held up", self._held_up), *failures)

    def trouble(self) -> str:
        """Return what is wrong with the bus, or with the chips that are absent; "" if nothing is."""
        absent = (chip.last_error for chip in self.bus.chips if not chip.present)
        return self.bus.trouble or "; ".join(absent)

    def close(self) -> None:
        """Close the bus."""
        self.bus.close()

    def _whole(self) -> SwitchFrame:
        closed = lost = 0
        for number, answer in enumerate(self._scans[0].read()):
            shut, silent = self._decoded(number, answer)
            closed, lost = closed | shut, lost | silent
        return SwitchFrame(now_us(), closed, lost)

    def _decoded(self, number: int, answer: int | None) -> tuple[Mask, Mask]:
        """Return which switches of port `number` are closed, and which are lost."""
        port = self._ports[number]
        return (0, port.switches.targets) if answer is None else (port.closed(answer, now_us()), 0)


def _chip_at(harness: Harness, bus: int, number: int, ports: list[Port]) -> ChipAt:
    chip = harness.buses[bus].chips[number]
    used = frozenset(
        reading_of(port, harness).pins[bit] for port in ports if port.chip == number for bit, _ in port.switches
    )
    mux, channel = (None, None) if chip.mux is None else (chip.mux.address, chip.mux.channel)
    return ChipAt(chip.chip, chip.address, used, mux, channel)


def _bus_period_us(scan: ScanMap, harness: Harness) -> int:
    """Return how often the switches on I2C buses should be read at least."""
    return max(SHORTEST_US, round(scan_us(scan, harness).us))


def _sources(harness: Harness, _names: Sequence[str], scan: ScanMap) -> Iterator[Source]:
    return (I2cDevice(harness, bus, scan) for bus in sorted({port.bus for port in scan.ports}))


def _periods_us(harness: Harness, scan: ScanMap) -> Iterator[int]:
    if scan.ports:
        yield _bus_period_us(scan, harness)


MEMBER = SourceKind("i2c", "Port expanders on an I2C bus: [[bus]].", "switches", _sources, _periods_us, rank=1)
