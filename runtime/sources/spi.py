"""Converters on SPI of a harness: all levels of one in one call of the kernel."""

from collections.abc import Callable, Iterator, Sequence

from msgspec.structs import replace

from thenar.drivers.spi.device import SpiDevice

from ..frames import PERIODS, Mask, SwitchFrame, now_us
from ..harness.wiring import Harness
from ..published import Count
from ..scanning.scanmap import ScanMap
from ..scanning.timing import reading_of, scan_us
from ..taxels import calibration_of
from .base import Pace, Source, SourceKind, paced_us
from .i2c import PortLevels


class SpiConverter(Source):
    """SPI device number `number` of a harness, read as in `scan`, whose levels are limits in counts.

    silent  whether the last replies were not a converter's
    """

    def __init__(self, harness: Harness, number: int, scan: ScanMap) -> None:
        wiring = harness.spi[number]
        ports = [port for port in scan.ports if port.bus == len(harness.buses) + number]
        calibration = calibration_of(harness.taxel_settings)
        self.name = f"spi at {wiring.device}"
        self._ports = tuple(PortLevels(port, harness, calibration) for port in ports)
        self.taxels = tuple(port.taxels for port in self._ports)
        self.owned: Mask = sum(port.targets for port in self._ports)
        self._wire_us = scan_us(replace(scan, ports=tuple(ports)), harness).us
        self.period_us = paced_us(wiring.rate_hz)
        self.longest_us = PERIODS * self.period_us
        self.part = wiring.kind
        self.device = SpiDevice(wiring.device, wiring.chip, wiring.clock_hz)
        self.run: Callable[[], list[int | None]] = self.device.prepare([reading_of(port, harness) for port in ports])
        self._everything = len(harness.taxel_names)
        self._pace = Pace(wiring.rate_hz)
        self.silent = False

    @property
    def wire_us(self) -> float:
        """The time of all conversions."""
        return self._wire_us

    def open(self) -> None:
        """Open the device."""
        self.device.open()

    def read(self, timeout_s: float) -> SwitchFrame | None:
        """Convert all channels once, when it is due."""
        if not self._pace.wait(timeout_s):
            return None
        replies = self.run()
        self.silent = None in replies
        closed = lost = 0
        codes: list[int | None] = [None] * self._everything
        for taxel, reply in zip(self._ports, replies, strict=True):
            shut, silent = taxel.states(reply)
            closed, lost = closed | shut, lost | silent
            codes[taxel.place] = reply
        return SwitchFrame(now_us(), closed, lost, taxels=tuple(codes))

    def counts(self) -> tuple[Count, ...]:
        """Return the numbers of transfers, and of replies that were not a converter's."""
        return (Count("transfers", self.device.calls), Count("silent", self.device.silent))

    def fault_message(self) -> str:
        """Return the fault of the converter or its taxels; "" if there is none."""
        silent = f"{self.device.chip.name} does not reply: check its supply, its wires and its chip select"
        return silent if self.silent else self.taxel_faults()

    def close(self) -> None:
        """Close the device."""
        self.device.close()


def _sources(harness: Harness, _names: Sequence[str], scan: ScanMap) -> Iterator[Source]:
    return (SpiConverter(harness, number, scan) for number in _numbers(harness, scan))


def _periods_us(harness: Harness, scan: ScanMap) -> Iterator[int]:
    return (paced_us(harness.spi[number].rate_hz) for number in _numbers(harness, scan))


def _numbers(harness: Harness, scan: ScanMap) -> list[int]:
    """Return the numbers of the SPI devices that are read."""
    buses = len(harness.buses)
    return sorted({port.bus - buses for port in scan.ports if port.bus >= buses})


MEMBER = SourceKind("spi", "Converters on SPI: [[spi]].", "switches", _sources, _periods_us, rank=2)
