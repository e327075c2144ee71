"""Converters on SPI of a harness: all levels of one in one call of the kernel."""

from collections.abc import Callable, Iterator, Sequence

from thenar.drivers.spi.device import SpiDevice

from ..frames import PERIODS
from ..harness.wiring import Harness
from ..published import Count
from ..scanning.scanmap import ScanMap
from ..scanning.timing import reading_of
from ..taxels import TaxelCalibration
from .base import Source, SourceKind, paced_us
from .i2c import PortScanner


class SpiConverter(PortScanner):
    """SPI device number `number` of a harness, read as in `scan`, whose levels are limits in counts.

    silent  whether the last replies were not a converter's
    """

    def __init__(self, harness: Harness, number: int, scan: ScanMap, taxels: TaxelCalibration | None = None) -> None:
        wiring, bus = harness.spi[number], len(harness.buses) + number
        ports = [port for port in scan.ports if port.bus == bus]
        self.name, self.part = f"spi at {wiring.device}", wiring.kind
        self.period_us = paced_us(wiring.rate_hz)
        self.longest_us = PERIODS * self.period_us
        self.device = SpiDevice(wiring.device, wiring.chip, wiring.clock_hz)
        self.run: Callable[[], list[int | None]] = self.device.prepare([reading_of(port, harness) for port in ports])
        self.silent = False
        super().__init__(harness, bus, ports, taxels)

    def open(self) -> None:
        """Open the device."""
        self.device.open()

    def replies(self) -> Sequence[int | None]:
        """Convert all channels."""
        replies = self.run()
        self.silent = None in replies
        return replies

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


def _sources(
    harness: Harness, _names: Sequence[str], scan: ScanMap, taxels: TaxelCalibration | None
) -> Iterator[Source]:
    buses = len(harness.buses)
    numbers = sorted({port.bus - buses for port in scan.ports if port.bus >= buses})
    return (SpiConverter(harness, number, scan, taxels) for number in numbers)


MEMBER = SourceKind("spi", _sources, rank=2)
