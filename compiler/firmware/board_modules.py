"""The files of what a board's part itself has: clock, UARTs, I2C bus."""

from math import ceil

from .baud import best_setting
from .board import Board
from .board_text import pair, text
from .errors import FirmwareError

_TIMER_US, _TIMER_DIVIDER = 20_000, 8  # the timer begins anew so often, and counts such a part of the clock
_BITS_A_BYTE = 9
_LONGEST_TRANSFER, _PATIENCE = 20, 4  # bytes, of which no transaction has so many; how often its time it may take
_RECOVERY_US = 5


def clock_files(board: Board) -> dict[str, str]:
    """Return name -> text of the clock of microseconds."""
    counts = board.clock_hz // _TIMER_DIVIDER * _TIMER_US // 1_000_000
    return pair(
        "thenar_clock",
        clock_hz=board.clock_hz,
        counts=counts,
        us_a_count=(_TIMER_US << 16) // counts,
        longest_masked_us=_TIMER_US // 2,
    )


def uart_files(board: Board, number: int, baud: int, *, receive_bytes: int, send_bytes: int) -> dict[str, str]:
    """Return name -> text of UART `number` with rings of these sizes, powers of two up to 256.

    Raises FirmwareError if it cannot make the rate.
    """
    setting = best_setting(baud, board.clock_hz)
    if setting is None:
        raise FirmwareError(f"a UART at {board.clock_hz} Hz cannot make {baud} baud: take a higher rate")
    values = {
        "uart": number,
        "rxd": board.microcontroller.uarts[number][0],
        "baud": baud,
        "error": f"{setting.error:+.1%}",
        "vector": "USART" if len(board.microcontroller.uarts) == 1 else f"USART{number}",
        "ubrr": setting.ubrr,
        "double": setting.double,
        "receive_bytes": receive_bytes,
        "send_bytes": send_bytes,
    }
    return {f"thenar_uart{number}.{end}": text(f"thenar_uart.{end}", **values) for end in "hc"}


def twi_files(board: Board) -> dict[str, str]:
    """Return name -> text of the master of the I2C bus, whose SCL is never faster than the board says."""
    (sda, scl), wanted_hz = board.microcontroller.twi, board.bus.clock_hz
    twbr = max(0, ceil((board.clock_hz - 16 * wanted_hz) / (2 * wanted_hz)))
    scl_hz = board.clock_hz // (16 + 2 * twbr)
    return pair(
        "thenar_twi",
        scl_hz=scl_hz,
        timeout_us=_PATIENCE * _LONGEST_TRANSFER * _BITS_A_BYTE * 1_000_000 // scl_hz,
        recovery_cycles=ceil(_RECOVERY_US * board.clock_hz / 1_000_000),
        sda=sda,
        scl=scl,
        twbr=twbr,
    )
