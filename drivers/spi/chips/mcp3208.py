"""Microchip MCP3208 and MCP3204: eight or four channels of 12 bits, converted during the transfer (DS21298)."""

from typing import ClassVar

from ...i2c.chips.base import ChipPackage
from .base import SpiChip, SpiModel

_SOIC16 = "Package_SO:SOIC-16_3.9x9.9mm_P1.27mm"
_SOIC14 = "Package_SO:SOIC-14_3.9x8.7mm_P1.27mm"
_START_AND_SINGLE = 0x06


class Mcp3208Model(SpiModel):
    """A start bit, single-ended or not, three bits of a channel, a bit's rest, a null bit, and twelve of the code."""

    channels, bits = 8, 12

    def transfer(self, sent: bytes) -> bytes:
        """Return the bytes received while `sent` goes out: zeros, the code, and zeros again."""
        length = 8 * len(sent)
        word = int.from_bytes(sent, "big")
        start = word.bit_length()
        # Start, single, D2, D1, D0; a clock to sample and the null bit follow; then the code, high bit first.
        end = start - 5 - 2 - self.bits
        if end < 0 or start > length or not word >> start - 2 & 1:
            return bytes(len(sent))
        channel = (word >> start - 5 & 7) % self.channels
        return (min(self.at(channel), (1 << self.bits) - 1) << end).to_bytes(len(sent), "big")


class Mcp3204Model(Mcp3208Model):
    """Four channels: the first bit of a channel number is ignored."""

    channels = 4


class Mcp3208(SpiChip):
    """Channels CH0 to CH7 against ground. SCLK up to 1 MHz at 2.7 V, 2 MHz at 5 V."""

    name = "mcp3208"
    rank = 1
    clock_hz, most_hz = 1_000_000, 2_000_000
    pins = tuple(f"CH{channel}" for channel in range(8))
    bits = 12
    model: ClassVar[type[SpiModel]] = Mcp3208Model
    package = ChipPackage(
        part="MCP3208-CI/SL",
        maker="Microchip",
        symbol="MCP3208",
        footprint=_SOIC16,
        pins=(*(f"CH{n}" for n in range(8)), "DGND", "CS", "DIN", "DOUT", "CLK", "AGND", "VREF", "VDD"),
        sure=False,
        note="compare symbol and footprint before ordering",
        library="Analog_ADC",
    )

    def sent(self, channel: int) -> bytes:
        """Return the bytes that convert a channel: the code ends with the last of them."""
        return bytes((_START_AND_SINGLE | channel >> 2, (channel & 3) << 6, 0))


class Mcp3204(Mcp3208):
    """Channels CH0 to CH3."""

    name = "mcp3204"
    rank = 2
    pins = tuple(f"CH{channel}" for channel in range(4))
    model = Mcp3204Model
    package = ChipPackage(
        part="MCP3204-CI/SL",
        maker="Microchip",
        symbol="MCP3204",
        footprint=_SOIC14,
        pins=(*(f"CH{n}" for n in range(4)), "NC", "NC", "DGND", "CS", "DIN", "DOUT", "CLK", "AGND", "VREF", "VDD"),
        sure=False,
        note="compare symbol and footprint before ordering",
        library="Analog_ADC",
    )


MEMBER = Mcp3208(), Mcp3204()
