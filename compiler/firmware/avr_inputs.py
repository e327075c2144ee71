"""AVR code for inputs on its own pins: switches on pins and in a matrix, and joints on its converter."""

from collections.abc import Iterable, Sequence
from math import ceil

from thenar.firmware_templates.rendering import render
from thenar.runtime.manifest import Calibration

from .board import Board, Matrix
from .board_inputs import Row, analog_channels, line_type, wrapped
from .targets.avr import Avr
from .words import comment


def text(file: str, /, **values: object) -> str:
    """Return the text of `file`, a template of firmware_templates/avr without its ".j2"."""
    return render(f"avr/{file}.j2", **values)


def pair(file: str, /, **values: object) -> dict[str, str]:
    """Return name -> text of the header and the source called `file`."""
    return {f"{file}.{end}": text(f"{file}.{end}", **values) for end in "hc"}


def avr_of(board: Board) -> Avr:
    """Return the AVR of a board that has one."""
    assert board.avr is not None
    return board.avr


_WHOLE_PORT = 0xFF
_CHARGE_US = 100  # far longer than the wires of switches on pins take to rise


def by_port(pins: Iterable[str]) -> list[Row]:
    """Return, port by port, the C expressions that clear and that set the bits of these pins ("PD2") in a register."""
    masks: dict[str, int] = {}
    for pin in pins:
        masks[pin[1]] = masks.get(pin[1], 0) | 1 << int(pin[2])
    # avr-gcc 5.4 warns of a conversion where no bit of a register is kept.
    cleared = {mask: f"&= (uint8_t)~0x{mask:02X}u" for mask in masks.values()} | {_WHOLE_PORT: "= 0x00u"}
    raised = {mask: f"|= 0x{mask:02X}u" for mask in masks.values()} | {_WHOLE_PORT: f"= 0x{_WHOLE_PORT:02X}u"}
    return [{"letter": port, "cleared": cleared[mask], "raised": raised[mask]} for port, mask in sorted(masks.items())]


def pins_file(board: Board, switches: Sequence[str]) -> str:
    """Return thenar_pins.c: key k is switch k, on its pin."""
    pins = [board.pins[name] for name in switches]
    keys = [
        {"pin": pin, "title": wrapped(f"{key}: {comment(name)}", 58), "byte": key // 8, "mask": f"0x{1 << key % 8:02X}"}
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
    kind, bit = line_type(matrix)
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


def needs_jtag_off(board: Board, pins: Iterable[str]) -> bool:
    """Return whether any of the pins belongs to the part's JTAG interface while that is enabled."""
    return bool(set(pins) & set(avr_of(board).jtag))


# The converter is accurate to its last bit up to this clock; a conversion takes 13 of its cycles.
_CONVERTER_HZ, CONVERSION_CYCLES = 200_000, 13


def adc_file(name: str, board: Board, joints: Sequence[Calibration]) -> str:
    """Return thenar_adc.c: joints as voltages, the upper 8 bits of the converter's 10."""
    channels = analog_channels(board, joints)
    rows = [
        {"name": comment(joint.name), "channel": channel, "number": channel_number(channel)}
        for joint, channel in zip(joints, channels, strict=True)
    ]
    prescaler = prescaler_of(board.clock_hz)
    return text(
        "thenar_adc.c",
        name=name,
        joints=rows,
        wide=len(board.microcontroller.analog) > 8,
        jtag=needs_jtag_off(board, (board.microcontroller.analog[channel] for channel in channels)),
        disabled=disabled_inputs(board, channels),
        prescaler=prescaler,
        conversion_us=ceil(CONVERSION_CYCLES * 2**prescaler * 1e6 / board.clock_hz),
    )


def prescaler_of(clock_hz: int) -> int:
    """Return the data sheet's ADPS: the clock is divided by 2 to the power of ADPS, 1 to 7."""
    return next(power for power in range(1, 8) if clock_hz >> power <= _CONVERTER_HZ)


def channel_number(channel: str) -> int:
    """Return the number of a channel: 3 for "ADC3"."""
    return int(channel.removeprefix("ADC"))


def disabled_inputs(board: Board, channels: Sequence[str]) -> list[Row]:
    """Return the digital inputs to disable: DIDR0 is for channels 0 to 7, DIDR2 for 8 to 15, one bit a pin."""
    masks = {0: 0, 2: 0}
    for number in (channel_number(channel) for channel in channels if board.microcontroller.analog[channel]):
        masks[0 if number < 8 else 2] |= 1 << number % 8
    return [{"number": number, "mask": f"0x{mask:02X}"} for number, mask in masks.items() if mask]
