"""The files that read a board's taxels: channels of the part's converter, straight or behind multiplexers."""

from math import ceil

from .board import Board
from .board_inputs import CONVERSION_CYCLES, channel_number, disabled_inputs, needs_jtag_off, pair, prescaler_of
from .words import comment


def channels_files(board: Board) -> dict[str, str]:
    """Return name -> text of what reads the board's taxels; nothing for a board without."""
    taxels = board.taxels
    if taxels is None:
        return {}
    part, prescaler = board.microcontroller, prescaler_of(board.clock_hz)
    # A conversion that is begun by hand waits for the converter's next clock.
    conversion_us = (CONVERSION_CYCLES + 1) * 2**prescaler * 1e6 / board.clock_hz
    pins = [part.analog[channel] for channel in taxels.inputs]
    return pair(
        "thenar_channels",
        taxels=[
            {"channel": number, "name": comment(name), "place": _place(taxels.inputs, number, taxels.per_input)}
            for number, name in enumerate(taxels.names)
            if name
        ],
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


def _place(inputs: tuple[str, ...], number: int, per_input: int) -> str:
    """Return where a channel is, in words: "C3 of the multiplexer at ADC0"."""
    at = inputs[number // per_input]
    return at if per_input == 1 else f"C{number % per_input} of the multiplexer at {at}"
