"""Microchip MCP3208, MCP3204, MCP3008 and MCP3004: eight or four channels of 12 or 10 bits, converted during the
transfer (DS21298, DS21295).
"""

from ...i2c.chips.base import ChipPackage
from .base import SpiChip, SpiModel

_FOOTPRINTS = {8: "Package_SO:SOIC-16_3.9x9.9mm_P1.27mm", 4: "Package_SO:SOIC-14_3.9x8.7mm_P1.27mm"}
_START_AND_SINGLE = 0b11000


class McpModel(SpiModel):
    """A start bit, single-ended or not, three bits of a channel, a bit's rest, a null bit, and those of the code.

    With four channels the first bit of a channel number is ignored.
    """

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


class McpConverter(SpiChip):
    """Channels CH0 and on against ground. SCLK up to `clock_hz` at 2.7 V, `most_hz` at 5 V."""

    model = McpModel

    def __init__(self, name: str, rank: int, channels: int, bits: int, clock_hz: int, most_hz: int, part: str) -> None:
        """`part` is the part number of the small-outline package."""
        self.name, self.rank, self.bits, self.clock_hz, self.most_hz = name, rank, bits, clock_hz, most_hz
        self.pins = tuple(f"CH{channel}" for channel in range(channels))
        unconnected = () if channels == 8 else ("NC", "NC")
        self.package = ChipPackage(
            part=part,
            maker="Microchip",
            symbol=name.upper(),
            footprint=_FOOTPRINTS[channels],
            pins=(*self.pins, *unconnected, "DGND", "CS", "DIN", "DOUT", "CLK", "AGND", "VREF", "VDD"),
            sure=False,
            note="compare symbol and footprint before ordering",
            library="Analog_ADC",
        )

    def sent(self, channel: int) -> bytes:
        """Return the bytes that convert a channel: the code ends with the last of them."""
        return ((_START_AND_SINGLE | channel) << self.bits + 2).to_bytes(3, "big")


MEMBER = (
    McpConverter("mcp3208", 1, 8, 12, 1_000_000, 2_000_000, "MCP3208-CI/SL"),
    McpConverter("mcp3204", 2, 4, 12, 1_000_000, 2_000_000, "MCP3204-CI/SL"),
    McpConverter("mcp3008", 3, 8, 10, 1_350_000, 3_600_000, "MCP3008-I/SL"),
    McpConverter("mcp3004", 4, 4, 10, 1_350_000, 3_600_000, "MCP3004-I/SL"),
)
