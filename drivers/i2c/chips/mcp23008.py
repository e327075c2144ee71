"""Microchip MCP23008: one port of eight pins, of which seven may be inputs (DS20001919)."""

from .base import Chip, ChipPackage, Reading, Write, byte_pins
from .mcp23017 import NOT_AN_INPUT, OPEN_DRAIN, Mcp230xxModel

_IODIR, _IOCON, _GPIO, _OLAT = 0x00, 0x05, 0x09, 0x0A


class Mcp23008(Chip):
    """Eight pins, GP0 to GP7. SCL up to 1.7 MHz at 4.5 V, 400 kHz at 2.7 V, 100 kHz at 1.8 V."""

    name = "mcp23008"
    rank = 2
    tried = False  # it is read like half an mcp23017
    addresses = range(0x20, 0x28)
    clock_hz = 1_700_000
    pins = tuple(f"GP{bit}" for bit in range(8))
    not_inputs = {"GP7": NOT_AN_INPUT}  # noqa: RUF012
    readings = (Reading("GPIO", bytes((_GPIO,)), byte_pins(0), high=0x80),)
    model = Mcp230xxModel
    package = ChipPackage(
        part="MCP23008-E/SO",
        maker="Microchip",
        symbol="MCP23008-xSO",
        footprint="Package_SO:SOIC-18W_7.5x11.6mm_P1.27mm",
        pins=(
            *("SCL", "SDA", "A2", "A1", "A0", "RESET", "NC", "INT", "VSS"),
            *(f"GP{bit}" for bit in range(8)),
            "VDD",
        ),
        note="GP7 stays unconnected: since 2022 it is only an output",
    )

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes that make all pins inputs, with pull-ups on the used ones and on GP7.

        OLAT is the last register and IODIR follows it: an MCP23017 has IOCON twice there.
        """
        pulled = sum(1 << pin for pin in used | {7})
        control = bytes((OPEN_DRAIN, pulled))  # GPPU follows IOCON
        plain = b"\xff" + bytes(4)  # IODIR all inputs, IPOL, GPINTEN, DEFVAL, INTCON
        return (
            Write(bytes((_IOCON, OPEN_DRAIN))),
            Write(bytes((_IODIR, 0xFF))),
            Write(bytes((_OLAT, 0)), b"\x00\xff"),
            Write(bytes((_IODIR,)) + plain + control, plain + control),
            Write(bytes((_IOCON,)) + control, control),
        )


MEMBER = Mcp23008()
