"""A scan map as a table: which chip is read how, how long it takes, and what is saved."""

from typing import TYPE_CHECKING

from .common import out

if TYPE_CHECKING:
    from thenar.runtime.harness.wiring import Harness
    from thenar.runtime.scanning.scanmap import ScanMap
    from thenar.runtime.scanning.timing import ScanTime


def print_scan(scan: "ScanMap", harness: "Harness") -> None:
    """Print the map chip by chip in the order in which chips are read first, with what the wire is bound to take."""
    from thenar.runtime.scanning.timing import scan_us, scanner_us

    time = scan_us(scan, harness)
    if time.chips:
        _print_chips(time)
        out().print(_in_all(scan, harness, time))
    for board, pairs in zip(harness.scanners, scan.scanners, strict=True):
        out().print(
            f"board {board.port}: {len(pairs)} kept switches of {len(board.switches)} keys, "
            f"{scanner_us(board):.0f} us a bitmap"
        )


def _print_chips(time: "ScanTime") -> None:
    from rich.table import Table

    table = Table("chip", "bus", "reads", "switches", "us", title="Scan map")
    for chip in time.chips:
        table.add_row(chip.place, chip.device, " ".join(chip.readings), str(chip.switches), f"{chip.us:.1f}")
    if time.selects:
        table.add_row(f"{time.selects} writes to muxes", "", "", "", f"{time.select_us:.1f}")
    out().print(table)


def _in_all(scan: "ScanMap", harness: "Harness", time: "ScanTime") -> str:
    wired = sum(len(chip.pins) for bus in harness.buses for chip in bus.chips)
    count = len(scan.ports) + time.selects
    return (
        f"a whole scan: {count} transaction{'s' if count > 1 else ''}, {time.us:.1f} us on the wire, "
        f"{time.share:.1%} of the {time.full_us:.1f} us for all {wired} wired switches"
    )
