"""A scan map of all that is asked for, without a build that would say in which order."""

from collections.abc import Sequence

from ..harness.wiring import Harness
from .scanmap import SCHEMA, ScanMap
from .transactions import ports_of


def whole_scan(harness: Harness, switch_names: Sequence[str]) -> ScanMap:
    """Return the map that reads the switches of these names, chip by chip with the fewest transactions.

    Names that are wired to nothing are read by nobody.
    """
    numbers = {name: number for number, name in enumerate(switch_names)}
    scanners = tuple(
        tuple((key, numbers[name]) for key, name in enumerate(scanner.switches) if name in numbers)
        for scanner in harness.scanners
    )
    return ScanMap(SCHEMA, harness.fingerprint, ports_of(harness, numbers), scanners)
