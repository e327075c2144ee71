"""The files that read a board's switches: pins, a matrix, or port expanders."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from thenar.drivers.i2c.chips import Write
from thenar.runtime.harness.wiring import ChipWiring
from thenar.runtime.scanning.scanmap import Port

from .board import Board, Matrix
from .board_text import text, wrapped
from .errors import FirmwareError
from .words import comment

_NO_KEY = 0xFF
_WHOLE_PORT = 0xFF
_LINE = {8: ("uint8_t", "0x%02Xu"), 16: ("uint16_t", "UINT16_C(0x%04X)"), 32: ("uint32_t", "UINT32_C(0x%08X)")}
_CHARGE_US = 100  # the wires of switches on pins have risen long before


@dataclass(frozen=True, slots=True)
class PortPins:
    """Which pins of a port are used: its letter, and what clears or sets their bits in a register, in C's words."""

    letter: str
    cleared: str
    raised: str


@dataclass(frozen=True, slots=True)
class PinKey:
    """A key on a pin: number and name, and its place in a bitmap in C's words."""

    pin: str
    title: str
    byte: int
    mask: str


@dataclass(frozen=True, slots=True)
class WriteRow:
    """A chip's register as a row of C."""

    written: int
    bytes: str
    expected: int
    answer: str


@dataclass(frozen=True, slots=True)
class ChipRows:
    """A chip, the rows that set it up, and the numbers of the first and the last of them."""

    place: str
    address: int
    writes: tuple[WriteRow, ...]
    first: int
    last: int


@dataclass(frozen=True, slots=True)
class PortRow:
    """A reading of a chip as a row of C, and whose switches it shows."""

    title: str
    chip: int
    command: int
    length: int
    high: str
    closed_low: str
    keys: tuple[str, ...]


def by_port(pins: Iterable[str]) -> list[PortPins]:
    """Return the pins ("PD2") port by port."""
    masks: dict[str, int] = {}
    for pin in pins:
        masks[pin[1]] = masks.get(pin[1], 0) | 1 << int(pin[2])
    return [_port_pins(letter, mask) for letter, mask in sorted(masks.items())]


def _port_pins(letter: str, mask: int) -> PortPins:
    # avr-gcc 5.4 warns of a conversion where no bit of a register is kept.
    if mask == _WHOLE_PORT:
        return PortPins(letter, "= 0x00u", f"= 0x{mask:02X}u")
    return PortPins(letter, f"&= (uint8_t)~0x{mask:02X}u", f"|= 0x{mask:02X}u")


def pins_file(board: Board, switches: Sequence[str]) -> str:
    """Return thenar_pins.c: key k is switch k, on its pin."""
    pins = [board.pins[name] for name in switches]
    keys = [
        PinKey(pin, wrapped(f"{key}: {comment(name)}", 58), key // 8, f"0x{1 << key % 8:02X}")
        for key, (name, pin) in enumerate(zip(switches, pins, strict=True))
    ]
    return text(
        "thenar_pins.c",
        ports=by_port(pins),
        keys=keys,
        charge_us=_CHARGE_US,
        charge_cycles=_cycles(board, _CHARGE_US),
        jtag=needs_jtag_off(board, pins),
    )


def _cycles(board: Board, us: int) -> int:
    return -(-us * board.clock_hz // 1_000_000)


def matrix_file(board: Board, matrix: Matrix) -> str:
    """Return thenar_matrix.c: key row * columns + column."""
    width = next((width for width in _LINE if len(matrix.columns) <= width), None)
    if width is None:
        raise FirmwareError(f"a matrix of {len(matrix.columns)} columns: the firmware reads 32, swap rows and columns")
    kind, bit = _LINE[width]
    return text(
        "thenar_matrix.c",
        rows=matrix.rows,
        columns=matrix.columns,
        names=[wrapped(", ".join(comment(name) or "-" for name in row), 11) for row in matrix.switches],
        diodes=matrix.diodes,
        settle_us=matrix.settle_us,
        settle_cycles=_cycles(board, matrix.settle_us),
        row_ports=by_port(matrix.rows),
        column_ports=by_port(matrix.columns),
        line_type=kind,
        line_bit=bit,
        jtag=needs_jtag_off(board, (*matrix.rows, *matrix.columns)),
    )


def expanders_file(board: Board, ports: Sequence[Port], switches: Sequence[str]) -> str:
    """Return thenar_expanders.c: the chips that hold a switch of the build, and these readings of them, in order."""
    used = sorted({port.chip for port in ports})
    chips: list[ChipRows] = []
    for number in used:
        chips.append(_chip_rows(board.chips[number], chips[-1].last + 1 if chips else 0))
    rows = [_port_row(port, board.chips[port.chip], used.index(port.chip), switches) for port in ports]
    writes = [write for chip in chips for write in chip.writes]
    return text(
        "thenar_expanders.c",
        chips=chips,
        ports=rows,
        most_written=max(write.written for write in writes),
        most_read=max(write.expected for write in writes),
        most_ports=max(row.length for row in rows),
    )


def needs_jtag_off(board: Board, pins: Iterable[str]) -> bool:
    """Return whether any of the pins belongs to the part's JTAG interface as long as that is on."""
    return bool(set(pins) & set(board.microcontroller.jtag))


def _chip_rows(wired: ChipWiring, first: int) -> ChipRows:
    writes = tuple(_write_row(write) for write in wired.chip.setup(frozenset(wired.numbered_pins)))
    return ChipRows(wired.place, wired.address, writes, first, first + len(writes) - 1)


def _write_row(write: Write) -> WriteRow:
    return WriteRow(len(write.data), _hexed(write.data), len(write.expect), _hexed(write.expect or b"\0"))


def _port_row(port: Port, wired: ChipWiring, number: int, switches: Sequence[str]) -> PortRow:
    reading = next(each for each in wired.chip.readings if each.name == port.reading)
    keys = [_NO_KEY] * (8 * reading.length)
    for bit, switch in port.switches:
        keys[bit] = switch
    names = ", ".join(comment(switches[switch]) for _, switch in port.switches)
    return PortRow(
        title=wrapped(f"{wired.place}, {'port' if reading.length == 1 else 'ports'} {reading.name}: {names}", 7),
        chip=number,
        command=reading.command[0],
        length=reading.length,
        high=_hexed(reading.high.to_bytes(reading.length, "little")),
        closed_low="0u" if port.closed_high else "0xFFu",
        keys=tuple(_hexed(bytes(keys[first : first + 8])) for first in range(0, len(keys), 8)),
    )


def _hexed(data: bytes) -> str:
    return ", ".join(f"0x{byte:02X}u" for byte in data)
