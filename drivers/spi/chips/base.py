"""Converters on SPI: their interface for the driver, their emulation, and their data as parts to solder.

This file and every chip's file need only the standard library: the system's Python emulates the chips.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from ...i2c.chips.base import ChipPackage, Reading

_BITS = 8
# The time that chip select must be high between two transfers (MCP3208: 500 ns, MCP3008: 270 ns).
SELECT_US = 0.5


@dataclass(frozen=True, slots=True)
class Transfer(Reading):
    """One transaction that reads a channel, the only one of `pins`: as many bytes come in while `command` goes out."""

    @property
    def wire_bytes(self) -> int:
        """Bytes on the wire."""
        return len(self.command)

    @property
    def scl_periods(self) -> int:
        """SCLK periods, eight a byte."""
        return _BITS * self.wire_bytes


class SpiModel(ABC):
    """A converter on an emulated device, with its chip's number of channels and bits of a code.

    levels  the code at each channel, 16 bits each, the first lowest
    """

    def __init__(self, channels: int, bits: int) -> None:
        self.channels, self.bits, self.levels = channels, bits, 0

    @abstractmethod
    def transfer(self, sent: bytes) -> bytes:
        """Return the bytes received while `sent` goes out, from chip select low to high."""

    def at(self, channel: int) -> int:
        """Return the code at a channel."""
        return self.levels >> 16 * channel & 0xFFFF


class SpiChip(ABC):
    """A kind of converter on SPI, mode 0. Its file defines `MEMBER`, one instance, or a tuple of them.

    name      its name in glove.toml
    rank      its place in lists
    clock_hz  the highest SCLK at 3.3 V; most_hz, at 5 V
    pins      the names of its channels, in the order of their numbers
    bits      of a code: code 0 is 0 V, and 2 ** bits is the supply voltage
    package   its data as a part to solder
    model     the class that emulates it
    """

    name: str
    rank: int = 0
    clock_hz: int
    most_hz: int
    pins: tuple[str, ...]
    bits: int
    package: ChipPackage
    model: type[SpiModel]

    @abstractmethod
    def sent(self, channel: int) -> bytes:
        """Return the bytes that convert a channel, of the same length for every channel."""

    @property
    def readings(self) -> tuple[Transfer, ...]:
        """The transfer that reads each channel, in order."""
        sent = (self.sent(channel) for channel in range(len(self.pins)))
        return tuple(
            Transfer(name, command, (channel,) * _BITS * len(command))
            for channel, (name, command) in enumerate(zip(self.pins, sent, strict=True))
        )

    @property
    def highest(self) -> int:
        """The code of the supply, at which a channel is saturated."""
        return (1 << self.bits) - 1

    def code(self, reply: bytes) -> int | None:
        """Return the code, the last bits of a reply; None if the null bit before it is not 0."""
        code = int.from_bytes(reply, "big") & (2 << self.bits) - 1
        return None if code >> self.bits else code
