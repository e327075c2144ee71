"""The files that read a board's joints: its converter, or a CyberGlove on one of its UARTs."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

from thenar.drivers.cyberglove_protocol import SENSORS_18, SENSORS_22, period_words, shortest_us, told_us
from thenar.runtime.manifest import Calibration
from thenar.runtime.names import list_names, nearest

from .board import Board, GloveUart
from .board_inputs import needs_jtag_off
from .board_text import text
from .errors import FirmwareError
from .words import comment

# The converter is exact to its last bit up to this clock; a conversion takes 13 of its cycles.
_CONVERTER_HZ, _CONVERSION_CYCLES = 200_000, 13
_BYTES = range(1, 256)


@dataclass(frozen=True, slots=True)
class AnalogJoint:
    """A joint on a channel of the converter."""

    name: str
    channel: str
    number: int


@dataclass(frozen=True, slots=True)
class InputsOff:
    """A register DIDRn, and the digital inputs that it switches off, in C's words."""

    number: int
    mask: str


@dataclass(frozen=True, slots=True)
class GloveJoint:
    """A joint of a CyberGlove: its place in a record, whose first byte, the S, is 0."""

    name: str
    place: int


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
    rows = [AnalogJoint(comment(joint.name), board.analog[joint.name], _number(board, joint.name)) for joint in joints]
    # The data sheet's ADPS: the clock divided by 2 to the power of 1 to 7.
    prescaler = next(power for power in range(1, 8) if board.clock_hz >> power <= _CONVERTER_HZ)
    return text(
        "thenar_adc.c",
        name=name,
        joints=rows,
        wide=len(board.microcontroller.analog) > 8,
        jtag=needs_jtag_off(board, (board.microcontroller.analog[row.channel] for row in rows)),
        disabled=_disabled(board, rows),
        prescaler=prescaler,
        conversion_us=ceil(_CONVERSION_CYCLES * 2**prescaler * 1e6 / board.clock_hz),
    )


def _number(board: Board, joint: str) -> int:
    return int(board.analog[joint].removeprefix("ADC"))


def _disabled(board: Board, rows: Sequence[AnalogJoint]) -> list[InputsOff]:
    """Return the digital inputs to switch off: DIDR0 is for channels 0 to 7, DIDR2 for 8 to 15, each bit a pin."""
    masks = {0: 0, 2: 0}
    for row in rows:
        if board.microcontroller.analog[row.channel]:
            masks[0 if row.number < 8 else 2] |= 1 << row.number % 8
    return [InputsOff(number, f"0x{mask:02X}") for number, mask in masks.items() if mask]


def _glove_file(name: str, glove: GloveUart, joints: Sequence[Calibration]) -> str:
    sensors = glove.joints or (SENSORS_18 if glove.sensors == len(SENSORS_18) else SENSORS_22)
    words = period_words(glove.rate_hz)
    period_us = max(told_us(words), shortest_us(glove.sensors, glove.baud, filtered=True))
    return text(
        "thenar_cyberglove.c",
        name=name,
        uart=glove.uart,
        sensors=glove.sensors,
        joints=[GloveJoint(comment(joint.name), 1 + _place(joint, sensors)) for joint in joints],
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
