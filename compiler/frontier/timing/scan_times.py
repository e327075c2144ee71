"""How long a scan takes: arithmetic of the wire, what is beside it, and how often recorded frames end it early."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import fsum

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.cyberglove_protocol import OVERHEAD, sending_us
from thenar.runtime.harness.wiring import Harness, ScannerWiring
from thenar.runtime.scanning.decided import Decided
from thenar.runtime.scanning.plan import Costs, plan_scan
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.scanning.timing import reading_of, scanner_us
from thenar.runtime.tables import IntegerTables

from ..points import How
from .beside_wire import WIRE_ONLY, Beside, board_beside
from .wirings import Wiring

# So many evenly spaced frames decide on the order of ports; all of them, on how often a scan then ends early.
_ORDERING = 200
_BAUD = 115_200
_SENSORS = (18, 22)


@dataclass(frozen=True, slots=True)
class ScanTimes:
    """What reading the kept switches takes, in microseconds.

    full_us   every port is read
    early_us  the mean over recorded frames, each scan ended as soon as it is decided; ends of buses cannot be told
              apart here: they are read one after another, as `scan_us` of the runtime adds them up
    ports     transactions of a whole scan, and a board's frame is one; chips: a board is one
    how       "wire", or "model" where a firmware's own work is in it
    early_ports  how many ports of chips are read then, the mean over the same frames: after each of them the scores are
              looked at
    """

    full_us: float
    early_us: float
    ports: int
    chips: int
    how: How
    early_ports: float


def scan_times(
    names: Sequence[str],
    tables: IntegerTables,
    wiring: Wiring,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    beside: Beside = WIRE_ONLY,
) -> ScanTimes:
    """Return what scans of the build's switches `names` take, the build's order, over frames bits (n, s), codes (n, j).

    beside is what every transaction takes besides the wire; a board takes what thenar's firmware does to scan its keys
    before it sends. Boards and buses work side by side, so the slower counts. Scans end here when the grasp type is
    certain, which is for decisions on single frames: one that asks for a lead reads on until that is safe as well, and
    a sequential test needs whole scans. Raises HarnessError if a switch has no place.
    """
    if not len(names):
        return ScanTimes(0.0, 0.0, 0, 0, "wire", 0.0)
    harness = wiring.harness_of(names, joints=bool(tables.n_joints))
    rows = np.linspace(0, len(bits) - 1, min(_ORDERING, len(bits))).astype(np.intp)
    scan = plan_scan(names, tables, harness, bits[rows], codes[rows])
    boards = [(board, keys) for board, keys in zip(harness.scanners, scan.scanners, strict=True) if keys]
    board_us = max((_board_us(board) for board, _ in boards), default=0.0)
    full_us, early_us, early_ports = (
        _bus_us(scan, harness, tables, bits, codes, beside) if scan.ports else (0.0, 0.0, 0.0)
    )
    return ScanTimes(
        full_us=max(full_us, board_us),
        early_us=max(early_us, board_us),
        ports=len(scan.ports) + len(boards),
        chips=len({(port.bus, port.chip) for port in scan.ports}) + len(boards),
        how="model" if boards or beside.scan_us else "wire",
        early_ports=early_ports,
    )


def _board_us(board: ScannerWiring) -> float:
    own = board_beside()
    return own.scan_us + own.key_us * len(board.switches) + scanner_us(board)


def _bus_us(
    scan: ScanMap,
    harness: Harness,
    tables: IntegerTables,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    beside: Beside,
) -> tuple[float, float, float]:
    """Return the time of a whole scan of the chips, and the mean time and number of ports of one that ends early."""
    costs = Costs(scan.ports, harness)
    frames = Decided(tables, [[switch for _, switch in port.switches] for port in scan.ports], bits, codes)
    always = beside.scan_us + beside.key_us * len(scan.switches)
    whole, weighted, shares, read = [always], [always], list[float](), 0
    for number, port in enumerate(scan.ports):
        # A selection of a channel is a transaction as well.
        wire_ns = costs.after(read, number)
        selected = wire_ns > costs.after(read | 1 << number, number)
        us = wire_ns / 1000 + beside.reading_us(reading_of(port, harness)) + beside.call_us * selected
        # The first port is always read: nothing stops a scan before it.
        share = frames.undecided(read) / len(frames) if read and len(frames) else 1.0
        whole.append(us)
        weighted.append(us * share)
        shares.append(share)
        read |= 1 << number
    return fsum(whole), fsum(weighted), fsum(shares)


def transfer_us(joints: int) -> float:
    """Return what one record of a CyberGlove takes on its line at 115200 baud, with the status byte; 0 without joints.

    Up to 18 joints are a glove of 18 sensors, more one of 22. What the box takes to digitise the sensors before it
    sends is not in it: see `shortest_us` of its protocol.
    """
    return sending_us(_SENSORS[joints > _SENSORS[0]] + OVERHEAD + 1, _BAUD) if joints else 0.0
