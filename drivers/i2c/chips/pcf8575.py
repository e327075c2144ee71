"""NXP and TI PCF8575: sixteen quasi-bidirectional pins and no registers."""

from .base import TSSOP24, Chip, ChipPackage, Reading, Write, byte_pins, pins_of_24, port_pins
from .pcf8574 import LatchedModel


class Pcf8575Model(LatchedModel):
    """Two latches."""

    pins = 16


class Pcf8575(Chip):
    """Pins P00 to P07 and P10 to P17, each with a current source of about 100 uA. SCL up to 400 kHz.

    Bytes always come in pairs, P0 then P1: an odd number would swap the ports afterwards. A PCF8575C has no current
    sources: it needs resistors to the supply.
    """

    name = "pcf8575"
    rank = 3
    addresses = range(0x20, 0x28)
    clock_hz = 400_000
    pins = port_pins(0, 1)
    readings = (Reading("P", b"", byte_pins(0, 1)),)
    registers = False
    model = Pcf8575Model
    package = ChipPackage(
        part="PCF8575PWR",
        maker="Texas Instruments",
        symbol="PCF8575",
        footprint=TSSOP24,
        pins=pins_of_24("GND", "VCC"),
        note="not the PCF8575C, which has no current sources",
    )

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes that release all pins, after each port was driven low for one read and must read low.

        See `Pcf8574.setup` for the reason. A PCF8574 has the last byte of a pair on all its pins, and fails.
        """
        return (
            Write(b"\x00\xff", b"\x00\x00", b"\xff\x00"),
            Write(b"\xff\x00", b"\x00\x00", b"\x00\xff"),
            Write(b"\xff\xff"),
        )


MEMBER = Pcf8575()
