"""Is a scan that stops early as good as a whole one, on every row?"""

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from thenar.runtime.scanning.decided import Decided
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.tables import IntegerTables


class ScanCheck(Struct, frozen=True):
    """What became of rows that were scanned port by port until they were decided.

    ports are those of the scan map, mean_read how many of them were read on average; changed counts the rows that have
    another grasp type then than after a whole scan.
    """

    ports: int
    mean_read: float
    changed: int


def check_scan(
    scan: ScanMap,
    tables: IntegerTables,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    deployed: NDArray[np.intp],
) -> ScanCheck:
    """Scan all rows, bits (n, s) and codes (n, j), port by port.

    deployed (n,) are their classes as the integers run: what a whole scan gives.
    """
    ports = [[switch for _, switch in port.switches] for port in scan.ports]
    frames = Decided(tables, ports, bits, codes)
    pending = np.ones(len(frames), bool)
    read, changed = 0, 0
    for number in range(len(ports)):
        read += int(np.count_nonzero(pending))
        leaders, decided = frames.after((2 << number) - 1)
        changed += int(np.count_nonzero(leaders[pending & decided] != deployed[pending & decided]))
        pending &= ~decided
    return ScanCheck(len(ports), read / len(frames), changed)
