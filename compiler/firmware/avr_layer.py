"""The AVR layer below the portable firmware: clock, UARTs, bus, main() and the Makefile."""

from collections.abc import Collection, Mapping, Sequence
from math import ceil

from thenar.runtime.manifest import Calibration

from . import FirmwareError
from .avr_channels import channels_files
from .avr_inputs import adc_file, avr_of, matrix_file, pins_file, text
from .board import Board
from .board_inputs import portable
from .targets.avr import best_setting
from .targets.base import Mode

__all__ = ["base_files", "bus_files", "channels_files", "folder", "joints_files", "keys_files", "uart_files"]

_TIMER_US, _TIMER_DIVIDER = 20_000, 8  # the timer's period, and the divider of the clock that it counts
_BITS_A_BYTE = 9
_LONGEST_TRANSFER, _PATIENCE = 20, 4  # bytes, more than any transaction has; the factor of the timeout
_RECOVERY_US, _FREEING_US = 5, 110


def base_files(board: Board, about: str) -> dict[str, str]:
    """Return name -> text of main(), the clock, the watchdog, and the host line."""
    counts = board.clock_hz // _TIMER_DIVIDER * _TIMER_US // 1_000_000
    clock = text(
        "thenar_clock.c",
        clock_hz=board.clock_hz,
        counts=counts,
        us_a_count=(_TIMER_US << 16) // counts,
        longest_masked_us=_TIMER_US // 2,
    )
    files = {f"thenar_reset.{end}": text(f"thenar_reset.{end}") for end in "hc"}
    files |= {"main.c": text("main.c", about=about), "thenar_clock.c": clock}
    return files | uart_files(board, 0, board.baud, receive_bytes=128, send_bytes=256)


def keys_files(board: Board, switches: Sequence[str]) -> dict[str, str]:
    """Return name -> text of the files that read switches on pins or in a matrix."""
    if board.matrix is not None:
        return {"thenar_matrix.c": matrix_file(board, board.matrix)}
    return {"thenar_pins.c": pins_file(board, switches)}


def joints_files(name: str, board: Board, joints: Sequence[Calibration]) -> dict[str, str]:
    """Return name -> text of the files that read joints on the converter."""
    return {"thenar_adc.c": adc_file(name, board, joints)}


def uart_files(
    board: Board, number: int, baud: int, *, receive_bytes: int = 128, send_bytes: int = 16
) -> dict[str, str]:
    """Return name -> text of UART `number` with rings of these sizes, powers of two up to 256.

    Raises FirmwareError if it cannot produce the baud rate.
    """
    setting = best_setting(baud, board.clock_hz)
    if setting is None:
        raise FirmwareError(f"a UART at {board.clock_hz} Hz cannot make {baud} baud: use a higher rate")
    uarts = avr_of(board).uarts
    values = {
        "uart": number,
        "rxd": uarts[number][0],
        "vector": "USART" if len(uarts) == 1 else f"USART{number}",
        "ubrr": setting.ubrr,
        "double": setting.double,
        "receive_bytes": receive_bytes,
        "send_bytes": send_bytes,
    }
    how = f" (off by {setting.error:+.1%}), by interrupts"
    return {
        f"thenar_uart{number}.h": portable("thenar_uart.h", uart=number, baud=baud, how=how),
        f"thenar_uart{number}.c": text("thenar_uart.c", **values),
    }


def bus_files(board: Board) -> dict[str, str]:
    """Return name -> text of the I2C bus master, whose SCL is never faster than the board's setting."""
    (sda, scl), wanted_hz = avr_of(board).twi, board.bus.clock_hz
    twbr = max(0, ceil((board.clock_hz - 16 * wanted_hz) / (2 * wanted_hz)))
    scl_hz = board.clock_hz // (16 + 2 * twbr)
    timeout_us = _PATIENCE * _LONGEST_TRANSFER * _BITS_A_BYTE * 1_000_000 // scl_hz
    header = portable("thenar_twi.h", scl_hz=scl_hz, timeout_us=timeout_us, freeing_us=_FREEING_US)
    source = text(
        "thenar_twi.c",
        timeout_us=timeout_us,
        recovery_cycles=ceil(_RECOVERY_US * board.clock_hz / 1_000_000),
        sda=sda,
        scl=scl,
        twbr=twbr,
    )
    return {"thenar_twi.h": header, "thenar_twi.c": source}


def folder(name: str, board: Board, mode: Mode, files: Mapping[str, str]) -> dict[str, str]:
    """Return path -> text of the whole folder: `files` and a Makefile."""
    return {**files, "Makefile": board_makefile(name, board, mode, files)}


def board_makefile(name: str, board: Board, mode: Mode, files: Collection[str]) -> str:
    """Return the Makefile for the firmware of the build `name`, whose other files are `files`."""
    does = "scans the switches" if mode == "scan" else "scans the switches and recognises"
    sources = sorted(file for file in files if file.endswith((".c", ".S")))
    return text(
        "Makefile",
        title=f"Firmware that {does}, for an {board.part} at {board.clock_hz} Hz.",
        program=f"thenar_{name}_{mode}",
        objects=[source.rpartition(".")[0] + ".o" for source in sources],
        headers=sorted(file for file in files if file.endswith(".h")),
        part=board.part,
        brown_out=avr_of(board).brown_out,
        avrdude_part=avr_of(board).avrdude,
        programmer=avr_of(board).programmer,
    )
