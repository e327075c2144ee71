"""NXP and TI PCF8575: sixteen quasi-bidirectional pins and no registers."""

from .chip import Chip, Reading, Write, byte_pins


class Pcf8575(Chip):
    """Pins P00 to P07 and P10 to P17, each with a current source of about 100 uA. SCL up to 400 kHz.

    Bytes go in pairs, P0 then P1, always: an odd number of them would swap the ports of what follows. A PCF8575C has
    no current sources: it needs resistors to the supply.
    """

    kind = "pcf8575"
    addresses = range(0x20, 0x28)
    clock_hz = 400_000
    pins = tuple(f"P{port}{bit}" for port in range(2) for bit in range(8))
    readings = (Reading("P", b"", byte_pins(0, 1)),)
    registers = False

    __slots__ = ()

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes that release all pins; before, each port is driven low for one read, and must be low.

        See `Pcf8574.setup` for why. A PCF8574 has the last byte of a pair on all its pins, and fails.
        """
        return (
            Write(b"\x00\xff", b"\x00\x00", b"\xff\x00"),
            Write(b"\xff\x00", b"\x00\x00", b"\x00\xff"),
            Write(b"\xff\xff"),
        )
