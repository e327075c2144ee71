"""The scan map and what the wire is bound to take, as tables."""

from collections.abc import Sequence
from dataclasses import dataclass

from thenar.runtime.harness.wiring import Harness
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.scanning.timing import glove_us, port_us, reading_of, scan_us, scanner_us

from ..text import NBSP, counted, microseconds, percent


@dataclass(frozen=True, slots=True)
class Transaction:
    """A reading, in its place in the scan: on which bus, of which chip and ports, for which switches, microseconds."""

    bus: str
    chip: str
    reading: str
    switches: str
    us: str


@dataclass(frozen=True, slots=True)
class ScanView:
    """What is read in which order, and sentences that sum it up."""

    transactions: tuple[Transaction, ...]
    sentences: tuple[str, ...]


def scan_view(scan: ScanMap, harness: Harness, switch_names: Sequence[str], joints: int) -> ScanView:
    """Return how the kept switches called `switch_names` are read, and what `joints` joints take beside them."""
    transactions = []
    for port in scan.ports:
        bus = harness.buses[port.bus]
        transactions.append(
            Transaction(
                bus=f"{bus.device} at {bus.clock_hz / 1000:g} kHz",
                chip=bus.chips[port.chip].place,
                reading=port.reading,
                switches=", ".join(switch_names[switch] for _, switch in port.switches),
                us=microseconds(port_us(reading_of(port, harness), bus.clock_hz)),
            )
        )
    sentences = [*_of_chips(scan, harness), *_of_boards(scan, harness), *_of_glove(harness, joints)]
    return ScanView(tuple(transactions), tuple(sentences))


def _of_chips(scan: ScanMap, harness: Harness) -> list[str]:
    if not scan.ports:
        return []
    time = scan_us(scan, harness)
    wired = sum(len(chip.pins) for bus in harness.buses for chip in bus.chips)
    muxes = f", {counted(time.selects, 'write')} to muxes among them" if time.selects else ""
    return [
        f"A whole scan is {counted(len(scan.ports) + time.selects, 'transaction')}{muxes}: {microseconds(time.us)} µs "
        f"on the wire, {percent(time.share, NBSP)} of the {microseconds(time.full_us)} µs that all {wired} wired ones "
        "take."
    ]


def _of_boards(scan: ScanMap, harness: Harness) -> list[str]:
    return [
        f"The board on {board.port} shows {counted(len(pairs), 'kept switch', 'kept switches')} of "
        f"{counted(len(board.switches), 'key')}, {microseconds(scanner_us(board))} µs a bitmap on its line."
        for board, pairs in zip(harness.scanners, scan.scanners, strict=True)
    ]


def _of_glove(harness: Harness, joints: int) -> list[str]:
    glove = harness.cyberglove
    if glove is None or not joints:
        return []
    sensors = glove.sensors or joints
    us = microseconds(glove_us(glove, sensors))
    return [f"A record of the CyberGlove's {sensors} sensors takes {us} µs on its own line, beside the scan."]
