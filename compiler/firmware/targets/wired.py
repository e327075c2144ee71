"""The properties of a part that board firmware needs: pins, UARTs, bus, converter."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from .base import Mode, Target


@dataclass(frozen=True, kw_only=True)
class Wired(Target):
    """A part that board firmware can be written for.

    pins      usable as inputs with a pull-up and as outputs, by their data sheet names
    uarts     the (RXD, TXD) pins of every UART; the first is the host's, () where the host has another line
    twi       the SDA and SCL pins
    analog    the channels of its converter by name, with the pin each shares; "" for a channel without a digital pin
    tied      pins and channels that are not listed although they might seem usable, and the reason
    code_bits of a code of the converter
    wireless  whether it can send its frames by Wi-Fi
    """

    modes: ClassVar[tuple[Mode, ...]] = ("classify", "scan", "glove")

    pins: tuple[str, ...]
    uarts: tuple[tuple[str, ...], ...]
    twi: tuple[str, str]
    analog: Mapping[str, str]
    tied: Mapping[str, str] = field(default_factory=dict)
    code_bits: int = 10
    wireless: bool = False
