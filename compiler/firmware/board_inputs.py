"""The files that read a board's switches: pins, a matrix, or port expanders."""

from collections.abc import Iterable, Sequence
from itertools import accumulate, pairwise
from math import ceil
from textwrap import fill

from thenar.drivers.cyberglove_protocol import SENSORS_18, SENSORS_22, period_words, shortest_us, told_us
from thenar.drivers.i2c.chips import Reading, Write
from thenar.firmware_templates.rendering import render
from thenar.runtime.harness.wiring import ChipWiring
from thenar.runtime.manifest import Calibration
from thenar.runtime.names import list_names, nearest
from thenar.runtime.scanning.scanmap import Port

from . import FirmwareError
from .board import Board, GloveUart, Matrix
from .words import comment


def text(file: str, /, **values: object) -> str:
    """Return the text of `file`, a template of firmware_templates/avr without its ".j2"."""
    return render(f"avr/{file}.j2", **values)


def pair(file: str, /, **values: object) -> dict[str, str]:
    """Return name -> text of the header and the source called `file`."""
    return {f"{file}.{end}": text(f"{file}.{end}", **values) for end in "hc"}


def wrapped(words: str, indent: int) -> str:
    """Return what is to stand in a comment of C after `indent` columns, broken into lines of at most 120 of them."""
    blanks = " " * indent
    return fill(words, 117, initial_indent=blanks, subsequent_indent=blanks, break_on_hyphens=False).lstrip()


_NO_KEY = 0xFF
_WHOLE_PORT = 0xFF
_LINE = {8: ("uint8_t", "0x%02Xu"), 16: ("uint16_t", "UINT16_C(0x%04X)"), 32: ("uint32_t", "UINT32_C(0x%08X)")}
_CHARGE_US = 100  # the wires of switches on pins have risen long before


Row = dict[str, object]  # of a template's table


def by_port(pins: Iterable[str]) -> list[Row]:
    """Return, port by port, what clears and what sets the bits of these pins ("PD2") in a register, in C's words."""
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
    wired = [board.chips[number] for number in used]
    writes = [chip.chip.setup(frozenset(chip.numbered_pins)) for chip in wired]
    ends = list(accumulate(map(len, writes), initial=0))
    return text(
        "thenar_expanders.c",
        chips=[
            {
                "place": chip.place,
                "address": chip.address,
                "first": first,
                "last": end - 1,
                "writes": map(_write_row, each),
            }
            for chip, each, (first, end) in zip(wired, writes, pairwise(ends), strict=True)
        ],
        ports=[_port_row(port, board.chips[port.chip], used.index(port.chip), switches) for port in ports],
        most_written=max(len(write.data) for each in writes for write in each),
        most_read=max(len(write.expect) for each in writes for write in each),
        most_ports=max(_reading(port, board.chips[port.chip]).length for port in ports),
    )


def needs_jtag_off(board: Board, pins: Iterable[str]) -> bool:
    """Return whether any of the pins belongs to the part's JTAG interface as long as that is on."""
    return bool(set(pins) & set(board.microcontroller.jtag))


def _write_row(write: Write) -> Row:
    answer = _hexed(write.expect or b"\0")
    return {"written": len(write.data), "bytes": _hexed(write.data), "expected": len(write.expect), "answer": answer}


def _reading(port: Port, wired: ChipWiring) -> Reading:
    return next(each for each in wired.chip.readings if each.name == port.reading)


def _port_row(port: Port, wired: ChipWiring, number: int, switches: Sequence[str]) -> Row:
    reading = _reading(port, wired)
    keys = [_NO_KEY] * (8 * reading.length)
    for bit, switch in port.switches:
        keys[bit] = switch
    names = ", ".join(comment(switches[switch]) for _, switch in port.switches)
    return {
        "title": wrapped(f"{wired.place}, {'port' if reading.length == 1 else 'ports'} {reading.name}: {names}", 7),
        "chip": number,
        "command": reading.command[0],
        "length": reading.length,
        "high": _hexed(reading.high.to_bytes(reading.length, "little")),
        "closed_low": "0u" if port.closed_high else "0xFFu",
        "lines": [_hexed(bytes(keys[first : first + 8])) for first in range(0, len(keys), 8)],
    }


def _hexed(data: bytes) -> str:
    return ", ".join(f"0x{byte:02X}u" for byte in data)


# The converter is exact to its last bit up to this clock; a conversion takes 13 of its cycles.
_CONVERTER_HZ, CONVERSION_CYCLES = 200_000, 13
_BYTES = range(1, 256)


def joints_file(name: str, board: Board, joints: Sequence[Calibration], code_bits: int) -> dict[str, str]:
    """Return name -> text of the file that reads a build's joints, in its order; nothing for a build without joints.

    Raises FirmwareError if the board measures no joints, lacks one of the build's, or measures it in other codes.
    """
    if not joints:
        return {}
    if code_bits != 8:
        raise FirmwareError(
            "the build tells codes above 254 apart, which are more than a CyberGlove's bytes or the upper 8 bits of a "
            "converter: compile recordings of such bytes"
        )
    if board.cyberglove is not None:
        return {"thenar_cyberglove.c": _glove_file(name, board.cyberglove, joints)}
    if board.analog:
        return {"thenar_adc.c": _adc_file(name, board, joints)}
    raise FirmwareError(
        f"the build needs {len(joints)} joints, and the board measures none: add [cyberglove] or [analog] to its "
        "board.toml, or compile the build with --inputs switches"
    )


def _adc_file(name: str, board: Board, joints: Sequence[Calibration]) -> str:
    lacking = [joint.name for joint in joints if joint.name not in board.analog]
    if lacking:
        raise FirmwareError(f"[analog] of the board has no channel for {list_names(lacking)}, which the build needs")
    channels = [board.analog[joint.name] for joint in joints]
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
    """Return the data sheet's ADPS: the clock is divided by 2 to its power, 1 to 7."""
    return next(power for power in range(1, 8) if clock_hz >> power <= _CONVERTER_HZ)


def channel_number(channel: str) -> int:
    """Return the number of a channel: 3 of "ADC3"."""
    return int(channel.removeprefix("ADC"))


def disabled_inputs(board: Board, channels: Sequence[str]) -> list[Row]:
    """Return the digital inputs to switch off: DIDR0 is for channels 0 to 7, DIDR2 for 8 to 15, each bit a pin."""
    masks = {0: 0, 2: 0}
    for number in (channel_number(channel) for channel in channels if board.microcontroller.analog[channel]):
        masks[0 if number < 8 else 2] |= 1 << number % 8
    return [{"number": number, "mask": f"0x{mask:02X}"} for number, mask in masks.items() if mask]


def _glove_file(name: str, glove: GloveUart, joints: Sequence[Calibration]) -> str:
    sensors = glove.joints or (SENSORS_18 if glove.sensors == len(SENSORS_18) else SENSORS_22)
    words = period_words(glove.rate_hz)
    period_us = max(told_us(words), shortest_us(glove.sensors, glove.baud, filtered=True))
    return text(
        "thenar_cyberglove.c",
        name=name,
        uart=glove.uart,
        sensors=glove.sensors,
        joints=[{"name": comment(joint.name), "place": 1 + _place(joint, sensors)} for joint in joints],
        lost_us=2 * ceil(period_us),
        period=", ".join(f"0x{byte:02X}u" for word in words for byte in word.to_bytes(2, "big")),
        period_meaning=f"every {told_us(words):.0f} us" if glove.rate_hz else "as fast as it can",
    )


def _place(joint: Calibration, sensors: Sequence[str]) -> int:
    if joint.name not in sensors:
        raise FirmwareError(
            f"the build needs joint {joint.name!r}, and the CyberGlove has no sensor of that name"
            f"{nearest(joint.name, sensors)}; name its sensors as the build does: `joints` of [cyberglove]"
        )
    if joint.code_a not in _BYTES or joint.code_b not in _BYTES or joint.code_a == joint.code_b:
        raise FirmwareError(
            f"joint {joint.name!r} of the build is coded in {joint.unit!r}, not in a CyberGlove's bytes: compile "
            "recordings of its bytes, for the firmware has no calibration"
        )
    return list(sensors).index(joint.name)
