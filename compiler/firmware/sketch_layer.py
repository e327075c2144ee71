"""The layer for parts with an Arduino core, below the portable firmware: a sketch, and Serial or Wi-Fi to the host."""

from collections.abc import Mapping, Sequence

from thenar.firmware_templates.rendering import render
from thenar.runtime.manifest import Calibration

from .board import Board, host_name
from .board_inputs import analog_channels, channels_header, line_type, portable, taxel_rows, wrapped
from .targets.base import Mode
from .targets.sketch import SketchPart
from .words import comment

__all__ = ["base_files", "bus_files", "channels_files", "folder", "joints_files", "keys_files", "uart_files"]

_CHARGE_US = 100
_WIRE_MS, _FREEING_US = 2, 110
# Calls of each core: pins of the bus and of UARTs, disabling the radio's sleep, a random number.
_BUS = {
    "arduino-esp32": ("(void)Wire.begin((int)SDA_PIN, (int)SCL_PIN);",),
    "arduino-pico": ("(void)Wire.setSDA(SDA_PIN);", "(void)Wire.setSCL(SCL_PIN);", "Wire.begin();"),
}
_BUS_TIMEOUT = {"arduino-esp32": f"Wire.setTimeOut({_WIRE_MS}u);", "arduino-pico": f"Wire.setTimeout({_WIRE_MS}u);"}
_UART = {
    "arduino-esp32": (
        "(void)Serial{n}.setRxBufferSize(256);",
        "(void)Serial{n}.setTxBufferSize(256);",
        "Serial{n}.begin({baud}, SERIAL_8N1, {rxd}, {txd});",
    ),
    "arduino-pico": (
        "(void)Serial{n}.setRX({rxd}u);",
        "(void)Serial{n}.setTX({txd}u);",
        "(void)Serial{n}.setFIFOSize(256);",
        "Serial{n}.begin({baud});",
    ),
}
_AWAKE = {"arduino-esp32": ("(void)WiFi.setSleep(false);",), "arduino-pico": ("WiFi.noLowPowerMode();",)}
_RANDOM = {"arduino-esp32": "esp_random()", "arduino-pico": "rp2040.hwrand32()"}


def base_files(board: Board, about: str) -> dict[str, str]:
    """Return name -> text of the sketch, the clock, and the host line."""
    part, wifi = _part(board), board.wifi
    if wifi is None:
        what = "bytes of a serial port"
        uart, usb = bool(part.uarts[0]), bool(part.usb)
        line = {"thenar_line_serial.cpp": _text("thenar_line_serial.cpp", uart=uart, usb=usb, baud=board.baud)}
    else:
        what = "datagrams in a Wi-Fi"
        core = part.arduino_core
        values = {"port": wifi.port, "host_name": host_name(board), "awake": _AWAKE[core], "random": _RANDOM[core]}
        line = {"thenar_line_udp.cpp": _text("thenar_line_udp.cpp", **values)}
        line |= {f"thenar_datagram.{end}": portable(f"thenar_datagram.{end}") for end in "hc"}
        line["secrets.example.h"] = _text("secrets.example.h")
    return {
        _SKETCH: _text("NAME.ino", about=about),
        "thenar_clock.cpp": _text("thenar_clock.cpp"),
        "thenar_line.h": _text("thenar_line.h", what=what),
        **line,
    }


def keys_files(board: Board, switches: Sequence[str]) -> dict[str, str]:
    """Return name -> text of the files that read switches on pins or in a matrix."""
    matrix = board.matrix
    if matrix is None:
        keys = [
            {"pin": _number(board.pins[name]), "title": wrapped(f"{key}: {comment(name)}", 12)}
            for key, name in enumerate(switches)
        ]
        return {"thenar_pins.cpp": _text("thenar_pins.cpp", keys=keys, charge_us=_CHARGE_US)}
    values = {
        "rows": list(map(_number, matrix.rows)),
        "columns": list(map(_number, matrix.columns)),
        "names": [wrapped(", ".join(comment(name) or "-" for name in row), 11) for row in matrix.switches],
        "diodes": matrix.diodes,
        "settle_us": matrix.settle_us,
        "line_type": line_type(matrix)[0],
    }
    return {"thenar_matrix.cpp": _text("thenar_matrix.cpp", **values)}


def bus_files(board: Board) -> dict[str, str]:
    """Return name -> text of the I2C bus master."""
    part, hz = _part(board), board.bus.clock_hz
    sda, scl = map(_number, part.twi)
    # A reading is two transfers, and each may wait.
    header = portable("thenar_twi.h", scl_hz=hz, timeout_us=2000 * _WIRE_MS, freeing_us=_FREEING_US)
    words = {"begin": _BUS[part.arduino_core], "timeout": _BUS_TIMEOUT[part.arduino_core]}
    return {
        "thenar_twi.h": header,
        "thenar_twi.cpp": _text("thenar_twi.cpp", sda=sda, scl=scl, clock_hz=hz, **words),
    }


def uart_files(board: Board, number: int, baud: int) -> dict[str, str]:
    """Return name -> text of UART `number`."""
    part = _part(board)
    rxd, txd = map(_number, part.uarts[number])
    begin = [line.format(n=number, baud=baud, rxd=rxd, txd=txd) for line in _UART[part.arduino_core]]
    name = f"thenar_uart{number}"
    return {
        f"{name}.h": portable("thenar_uart.h", uart=number, baud=baud, how=""),
        f"{name}.cpp": _text("thenar_uart.cpp", uart=number, rxd=rxd, txd=txd, begin=begin),
    }


def joints_files(name: str, board: Board, joints: Sequence[Calibration]) -> dict[str, str]:
    """Return name -> text of the files that read joints on the converter."""
    part = _part(board)
    rows = [
        {"name": comment(joint.name), "channel": channel, "pin": part.converter[channel]}
        for joint, channel in zip(joints, analog_channels(board, joints), strict=True)
    ]
    values = {"name": name, "joints": rows, "code_bits": part.code_bits, "reference": part.reference}
    return {"thenar_adc.cpp": _text("thenar_adc.cpp", **values)}


def channels_files(board: Board) -> dict[str, str]:
    """Return name -> text of the files that read taxels on the converter; empty for a board without taxels."""
    taxels, part = board.taxels, _part(board)
    if taxels is None:
        return {}
    source = _text(
        "thenar_channels.cpp",
        taxels=taxel_rows(taxels),
        inputs=[part.converter[channel] for channel in taxels.inputs],
        select=list(map(_number, taxels.select)),
        settle_us=taxels.settle_us,
        conversion_us=part.conversion_us,
    )
    return {"thenar_channels.h": channels_header(part.reference), "thenar_channels.cpp": source}


def folder(name: str, board: Board, mode: Mode, files: Mapping[str, str]) -> dict[str, str]:
    """Return path -> text of the whole folder: the sketch in a folder of the same name, as Arduino requires."""
    part, sketch = _part(board), f"thenar_{name}_{mode}"
    outside = {"glove.toml": files["glove.toml"]}
    inside = {f"{sketch}.ino" if path == _SKETCH else path: text for path, text in files.items() if path not in outside}
    values = {
        "sketch": sketch,
        "part": part,
        "wifi": board.wifi is not None,
        "host_name": host_name(board),
        "does": "scans the switches" if mode == "scan" else "scans the switches and recognises",
    }
    outside |= {path: _text(path, **values) for path in ("platformio.ini", "README.md")}
    return {**{f"{sketch}/{path}": text for path, text in inside.items()}, **outside}


_SKETCH = "sketch"  # the main file of the sketch, which is named after its folder


def _text(file: str, /, **values: object) -> str:
    return render(f"sketch/{file}.j2", **values)


def _part(board: Board) -> SketchPart:
    part = board.microcontroller
    assert isinstance(part, SketchPart)
    return part


def _number(pin: str) -> int:
    return int(pin.removeprefix("GPIO"))
