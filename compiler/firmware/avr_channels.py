"""The files that read a board's taxels through the part's converter, directly or through multiplexers."""

from math import ceil

from .avr_inputs import CONVERSION_CYCLES, avr_of, channel_number, disabled_inputs, needs_jtag_off, prescaler_of, text
from .board import Board
from .board_inputs import channels_header, taxel_rows


def channels_files(board: Board) -> dict[str, str]:
    """Return name -> text of the files that read the board's taxels; empty for a board without taxels."""
    taxels = board.taxels
    if taxels is None:
        return {}
    part, prescaler = avr_of(board), prescaler_of(board.clock_hz)
    # A conversion that is started by software waits for the converter's next clock.
    conversion_us = (CONVERSION_CYCLES + 1) * 2**prescaler * 1e6 / board.clock_hz
    pins = [part.analog[channel] for channel in taxels.inputs]
    source = text(
        "thenar_channels.c",
        taxels=taxel_rows(taxels),
        inputs=[channel_number(channel) for channel in taxels.inputs],
        select=taxels.select,
        wide=len(part.analog) > 8,
        jtag=needs_jtag_off(board, (*pins, *taxels.select)),
        disabled=disabled_inputs(board, taxels.inputs),
        prescaler=prescaler,
        conversion_us=ceil(conversion_us),
        settle_us=taxels.settle_us,
        settling=ceil(taxels.settle_us / conversion_us) if taxels.select else 0,
    )
    return {"thenar_channels.h": channels_header("AVCC"), "thenar_channels.c": source}
