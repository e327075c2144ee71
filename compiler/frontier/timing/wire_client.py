"""Reads emulated buses in a process of its own: umockdev shows its device nodes to no other. `wire_check` starts it.

The first line on stdin is a harness as JSON, and so many scans; it answers when its buses are open and were scanned
once, and scans each bus so often for every further line.
"""

import sys
from contextlib import ExitStack

import msgspec

from thenar.drivers.i2c.bus import ChipAt, I2cBus, PortRead, Scan
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import reading_of

# Checks of the chips' registers are traffic that is no scan's.
_NEVER_S = 3600.0


class Order(msgspec.Struct, frozen=True):
    """Which buses to scan as a whole, and how often at a time."""

    harness: Harness
    scans: int


def main() -> None:
    """Do as the lines on stdin say, and answer each with an empty one."""
    order = msgspec.json.decode(sys.stdin.readline(), type=Order)
    with ExitStack() as stack:
        scans = [_scan_of(order.harness, number, stack) for number in range(len(order.harness.buses))]
        _read(scans, 1)
        for _ in sys.stdin:
            _read(scans, order.scans)


def _scan_of(harness: Harness, number: int, stack: ExitStack) -> Scan:
    wiring = harness.buses[number]
    bus = stack.enter_context(I2cBus(wiring.device, _chips(wiring), clock_hz=wiring.clock_hz, check_every_s=_NEVER_S))
    bus.open()
    ports = whole_scan(harness, harness.switches).ports
    return bus.prepare([PortRead(port.chip, reading_of(port, harness)) for port in ports if port.bus == number])


def _chips(wiring: BusWiring) -> list[ChipAt]:
    return [ChipAt(chip.chip, chip.address, frozenset(chip.numbered_pins), *behind(chip)) for chip in wiring.chips]


def behind(chip: ChipWiring) -> tuple[int, int] | tuple[None, None]:
    """Return the address of the mux and the channel that a chip is behind."""
    return (None, None) if chip.mux is None else (chip.mux.address, chip.mux.channel)


def _read(scans: list[Scan], times: int) -> None:
    for scan in scans:
        for _ in range(times):
            if None in scan.read():
                sys.exit("a chip of the emulated bus did not answer")
    print(flush=True)


if __name__ == "__main__":
    main()
