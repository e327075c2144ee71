"""NXP and TI PCF8574 and PCF8574A: eight quasi-bidirectional pins and no registers. They differ in their addresses."""

from .chip import Chip, Reading, Write, byte_pins


class Pcf8574(Chip):
    """Eight pins, P0 to P7, each with a current source of about 100 uA to the supply. SCL up to 100 kHz.

    What is written is the latch of the outputs; a pin is an input while its latch is 1, as it is after power-on.
    """

    kind = "pcf8574"
    addresses = range(0x20, 0x28)
    clock_hz = 100_000
    pins = tuple(f"P{bit}" for bit in range(8))
    readings = (Reading("P", b"", byte_pins(0)),)
    registers = False

    __slots__ = ()

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes that release all pins.

        Without registers there is only one way to tell the chip from others: all pins are driven low for two reads,
        and must then be low. That harms no switch to ground; a switch to the supply does not belong on this chip.
        A PCF8575 would have the first of two bytes on the port that is read; a chip with registers takes it for one
        that is read-only or none.
        """
        return (Write(b"\xf9\x00", b"\x00"), Write(b"\x00", b"\x00"), Write(b"\xff"))


class Pcf8574a(Pcf8574):
    """The same at other addresses."""

    kind = "pcf8574a"
    addresses = range(0x38, 0x40)

    __slots__ = ()
