"""The files that read a board's inputs on any part, port expanders and a CyberGlove, and helpers for all parts."""

from collections.abc import Sequence
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
from .board import Board, GloveUart, Matrix, TaxelInputs
from .words import comment


def portable(file: str, /, **values: object) -> str:
    """Return the text of `file`, a template of firmware_templates/board without its ".j2"."""
    return render(f"board/{file}.j2", **values)


def wrapped(words: str, indent: int) -> str:
    """Return `words` for a C comment after `indent` columns, broken into lines of at most 120 columns."""
    blanks = " " * indent
    return fill(words, 117, initial_indent=blanks, subsequent_indent=blanks, break_on_hyphens=False).lstrip()


_NO_KEY = 0xFF
_LINE = {8: ("uint8_t", "0x%02Xu"), 16: ("uint16_t", "UINT16_C(0x%04X)"), 32: ("uint32_t", "UINT32_C(0x%08X)")}


Row = dict[str, object]  # of a template's table


def line_type(matrix: Matrix) -> tuple[str, str]:
    """Return the narrowest C type with a bit for each column, and the expression of a bit of it."""
    width = next((width for width in _LINE if len(matrix.columns) <= width), None)
    if width is None:
        raise FirmwareError(
            f"a matrix of {len(matrix.columns)} columns: the firmware reads at most 32; swap rows and columns"
        )
    return _LINE[width]


def taxel_rows(taxels: TaxelInputs) -> list[Row]:
    """Return the channels that are taxels, with their places."""
    return [
        {"channel": number, "name": comment(name), "place": _place_of(taxels.inputs, number, taxels.per_input)}
        for number, name in enumerate(taxels.names)
        if name
    ]


def channels_header(reference: str) -> str:
    """Return thenar_channels.h for a converter with this reference voltage."""
    return portable("thenar_channels.h", reference=reference)


def _place_of(inputs: tuple[str, ...], number: int, per_input: int) -> str:
    """Return the place of a channel in words: "C3 of the multiplexer at ADC0"."""
    at = inputs[number // per_input]
    return at if per_input == 1 else f"C{number % per_input} of the multiplexer at {at}"


def expanders_file(board: Board, ports: Sequence[Port], switches: Sequence[str]) -> str:
    """Return thenar_expanders.c: the chips with a switch of the build, and these readings of them, in order."""
    used = sorted({port.chip for port in ports})
    wired = [board.chips[number] for number in used]
    writes = [chip.chip.setup(frozenset(chip.numbered_pins)) for chip in wired]
    ends = list(accumulate(map(len, writes), initial=0))
    return portable(
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


def _write_row(write: Write) -> Row:
    reply = _hexed(write.expect or b"\0")
    return {"written": len(write.data), "bytes": _hexed(write.data), "expected": len(write.expect), "reply": reply}


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


_BYTES = range(1, 256)


def check_joints(board: Board, joints: Sequence[Calibration], code_bits: int) -> None:
    """Raise FirmwareError if the build needs joints and the board measures none, or measures other codes."""
    if not joints:
        return
    if code_bits != 8:
        raise FirmwareError(
            "the build distinguishes codes above 254, but a CyberGlove's bytes and the upper 8 bits of a converter end "
            "at 255: compile recordings of such bytes"
        )
    if board.cyberglove is None and not board.analog:
        raise FirmwareError(
            f"the build needs {len(joints)} joints, but the board measures none: add [cyberglove] or [analog] to its "
            "board.toml, or compile the build with --inputs switches"
        )


def analog_channels(board: Board, joints: Sequence[Calibration]) -> list[str]:
    """Return the channel of each joint of a build. Raises FirmwareError if a joint has no channel on the board."""
    lacking = [joint.name for joint in joints if joint.name not in board.analog]
    if lacking:
        raise FirmwareError(
            f"[analog] of the board has no channel for {list_names(lacking)}, which the build needs: add one each"
        )
    return [board.analog[joint.name] for joint in joints]


def glove_file(name: str, glove: GloveUart, joints: Sequence[Calibration]) -> str:
    """Return thenar_cyberglove.c. Raises FirmwareError if the glove lacks a joint, or measures it in other codes."""
    sensors = glove.joints or (SENSORS_18 if glove.sensors == len(SENSORS_18) else SENSORS_22)
    words = period_words(glove.rate_hz)
    period_us = max(told_us(words), shortest_us(glove.sensors, glove.baud, filtered=True))
    return portable(
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
            f"the build needs joint {joint.name!r}, but the CyberGlove has no sensor of that name"
            f"{nearest(joint.name, sensors)}; use the build's names in `joints` of [cyberglove]"
        )
    if joint.code_a not in _BYTES or joint.code_b not in _BYTES or joint.code_a == joint.code_b:
        raise FirmwareError(
            f"joint {joint.name!r} of the build is coded in {joint.unit!r}, not in a CyberGlove's bytes: compile "
            "recordings of its bytes, since the firmware has no calibration"
        )
    return list(sensors).index(joint.name)
