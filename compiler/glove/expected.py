"""What to expect of a reduced glove: how long the wire takes for a scan, and what it recognises."""

from msgspec import Struct

from thenar.runtime.harness.wiring import Harness
from thenar.runtime.manifest import Manifest, Recognised
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.scanning.timing import glove_us, scan_us, scanner_us

_SENSORS = 18


class Expected(Struct, frozen=True):
    """Times by the wire's arithmetic, microseconds: what the computer adds to every transaction is not in them.

    scan_us      of all kept switches on expanders, in `transactions` transactions, selections of muxes included
    full_us      of all switches that are wired to expanders, kept or not
    boards_us    of a full bitmap of each scanner board
    glove_us     between records of the CyberGlove; None where the build looks at no joint
    rates        the recognition that was measured when the build was compiled
    """

    transactions: int
    scan_us: float
    full_us: float
    boards_us: tuple[float, ...]
    glove_us: float | None
    rates: tuple[Recognised, ...]


def expected_of(manifest: Manifest, scan: ScanMap, harness: Harness) -> Expected:
    """Return what to expect of a build's switches in a harness, read whole by `scan`."""
    time = scan_us(scan, harness)
    glove = harness.cyberglove if manifest.joints else None
    return Expected(
        transactions=len(scan.ports) + time.selects,
        scan_us=time.us,
        full_us=time.full_us,
        boards_us=tuple(
            scanner_us(board) for board, pairs in zip(harness.scanners, scan.scanners, strict=True) if pairs
        ),
        glove_us=None if glove is None else glove_us(glove, glove.sensors or _SENSORS),
        rates=manifest.rates,
    )
