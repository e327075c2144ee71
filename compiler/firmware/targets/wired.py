"""What a target must say of its part for firmware of a board to be written for it: pins, UARTs, bus, converter."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from .base import Mode, Target


@dataclass(frozen=True, kw_only=True)
class Wired(Target):
    """A part on whose pins firmware of a board is written.

    pins      usable as inputs with a pull-up and as outputs, as the data sheet calls them
    uarts     the (RXD, TXD) pins of every UART; the first is the host's, () where the host has another line
    twi       the SDA and SCL pins
    analog    the channels of its converter by name, with the pin each shares; "" for a channel without a digital pin
    tied      pins that are not in `pins` but that one may think of, and why not
    code_bits of a code of the converter
    wireless  whether its frames can go by Wi-Fi
    """

    modes: ClassVar[tuple[Mode, ...]] = ("classify", "scan", "glove")

    pins: tuple[str, ...]
    uarts: tuple[tuple[str, ...], ...]
    twi: tuple[str, str]
    analog: Mapping[str, str]
    tied: Mapping[str, str] = field(default_factory=dict)
    code_bits: int = 10
    wireless: bool = False
