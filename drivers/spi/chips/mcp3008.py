"""Microchip MCP3008 and MCP3004: the MCP3208 and MCP3204 with 10 bits, and faster (DS21295)."""

from dataclasses import replace
from typing import ClassVar

from .base import SpiModel
from .mcp3208 import Mcp3204, Mcp3204Model, Mcp3208, Mcp3208Model

_START, _SINGLE = 0x01, 0x80


class Mcp3008Model(Mcp3208Model):
    """Ten bits of the code."""

    bits = 10


class Mcp3004Model(Mcp3204Model):
    """Ten bits of the code."""

    bits = 10


class Mcp3008(Mcp3208):
    """Channels CH0 to CH7 against ground. SCLK up to 1.35 MHz at 2.7 V, 3.6 MHz at 5 V."""

    name = "mcp3008"
    rank = 3
    clock_hz, most_hz = 1_350_000, 3_600_000
    bits = 10
    model: ClassVar[type[SpiModel]] = Mcp3008Model
    package = replace(Mcp3208.package, part="MCP3008-I/SL", symbol="MCP3008")

    def sent(self, channel: int) -> bytes:
        """Return the bytes that convert a channel: the code ends with the last of them."""
        return bytes((_START, _SINGLE | channel << 4, 0))


class Mcp3004(Mcp3008):
    """Channels CH0 to CH3."""

    name = "mcp3004"
    rank = 4
    pins = Mcp3204.pins
    model = Mcp3004Model
    package = replace(Mcp3204.package, part="MCP3004-I/SL", symbol="MCP3004")


MEMBER = Mcp3008(), Mcp3004()
