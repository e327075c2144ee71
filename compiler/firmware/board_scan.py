"""How a board scans: its readings of chips in their order, how long a scan takes, and what the protocol says of it."""

from collections.abc import Sequence
from math import ceil

from thenar.runtime.harness.wiring import BusWiring, Harness
from thenar.runtime.scanning.plan import plan_scan
from thenar.runtime.scanning.scanmap import Port
from thenar.runtime.tables import IntegerTables

from .board import Board
from .board_keys import check_switches, rows_and_columns
from .protocol import BoardConfig

# Cycles of the firmware as libsimavr counts them, rounded up: of a scan whatever it reads, of a key that is read, of a
# byte on the bus beside its SCL periods, of a reading; and of an answer, of a look-up for it, of a class of a look-up.
_SCAN, _KEY, _BUS_BYTE, _READING = 3000, 60, 110, 600
_ANSWER, _LOOKUP, _CLASS = 600, 40, 10


def readings(board: Board, switches: Sequence[str], tables: IntegerTables) -> tuple[Port, ...]:
    """Return which readings of the board's chips show a build's `switches`, in the order in which they are made.

    Of each chip the fewest; what can change the scores of `tables` most per microsecond comes first. There are none
    without chips. Raises FirmwareError if the board lacks a switch.
    """
    check_switches(board, switches)
    return plan_scan(switches, tables, harness_of(board)).ports if board.chips else ()


def harness_of(board: Board) -> Harness:
    """Return the board's chips as a harness of one bus."""
    return Harness(name="board", buses=(BusWiring(device="bus", clock_hz=board.bus.clock_hz, chips=board.chips),))


def switches_of(ports: Sequence[Port]) -> list[list[int]]:
    """Return the numbers of the build's switches that each reading shows: the ports of an early exit."""
    return [[switch for _, switch in port.switches] for port in ports]


def exits_early(board: Board, ports: Sequence[Port]) -> bool:
    """Return whether a scan of the readings `ports` may end before the last: of one there is nothing to leave out."""
    return board.early_exit and len(ports) > 1


def shortest_scan_us(board: Board, switches: Sequence[str], tables: IntegerTables, *, recognises: bool) -> int:
    """Return how many microseconds a scan takes at most, with all that is done once a scan, rounded up to 50."""
    ports = readings(board, switches, tables)
    rows, columns = rows_and_columns(board, switches)
    cycles = _SCAN + _KEY * rows * columns
    seconds = 0.0
    if board.matrix is not None:
        seconds += rows * board.matrix.settle_us / 1e6
    for port in ports:
        reading = next(each for each in board.chips[port.chip].chip.readings if each.name == port.reading)
        seconds += reading.scl_periods / board.bus.clock_hz
        cycles += _READING + _BUS_BYTE * reading.wire_bytes
    if recognises:
        lookups = tables.n_switches // 2 + tables.n_joints
        answers = len(ports) if exits_early(board, ports) else 1
        cycles += answers * (_ANSWER + lookups * (_LOOKUP + _CLASS * tables.n_classes))
    return 50 * ceil((seconds + cycles / board.clock_hz) * 1e6 / 50)


def config_of(board: Board, switches: Sequence[str], tables: IntegerTables, *, recognises: bool = False) -> BoardConfig:
    """Return what the protocol's C is configured with. Raises FirmwareError if the board lacks a switch, has too many
    keys, or is to scan faster than it can.
    """
    rows, columns = rows_and_columns(board, switches)
    return BoardConfig(
        rows=rows,
        columns=columns,
        diodes=board.matrix is None or board.matrix.diodes,
        board=board.board,
        scan_us=board.scan_us,
        state_us=board.state_us,
        heartbeat_us=board.heartbeat_us,
        press_us=board.debounce.press_us,
        release_us=board.debounce.release_us,
        fastest_us=shortest_scan_us(board, switches, tables, recognises=recognises),
    )
