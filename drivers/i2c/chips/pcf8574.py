"""NXP and TI PCF8574 and PCF8574A: eight quasi-bidirectional pins and no registers. They differ in their addresses."""

from .base import Chip, Device, Package, Reading, Write, byte_pins

_SOIC16 = "Package_SO:SOIC-16W_7.5x10.3mm_P1.27mm"
_PINS = ("A0", "A1", "A2", "P0", "P1", "P2", "P3", "VSS", "P4", "P5", "P6", "P7", "INT", "SCL", "SDA", "VDD")
_DOUBT = "the body's width (7.5 mm) is not confirmed: some sellers' parts have 3.9 mm"


class Pcf8574Model(Device):
    """No registers: what is written is the latch, and a pin is high where latch and world are."""

    pins = 8
    has_registers = False

    def reset(self) -> None:
        """Do as after power-on."""
        self._latch = 0xFF

    def write(self, data: bytes) -> None:
        """Take the bytes of one message that writes."""
        if data:
            self._latch = data[-1]

    def read(self, length: int) -> bytes:
        """Return the bytes of one message that reads."""
        return bytes((self._latch & self.levels,)) * length

    def poke(self, register: int, value: int) -> None:
        """Put `value` where nobody wrote it."""
        self._latch = value


class Pcf8574(Chip):
    """Eight pins, P0 to P7, each with a current source of about 100 uA to the supply. SCL up to 100 kHz.

    What is written is the latch of the outputs; a pin is an input while its latch is 1, as it is after power-on.
    """

    name = "pcf8574"
    rank = 4
    tried = False  # eight pins, at 100 kHz, take longer than the sixteen of a pcf8575
    addresses = range(0x20, 0x28)
    clock_hz = 100_000
    pins = tuple(f"P{bit}" for bit in range(8))
    readings = (Reading("P", b"", byte_pins(0)),)
    registers = False
    model = Pcf8574Model
    package = Package("PCF8574T/3,518", "NXP", "PCF8574", _SOIC16, _PINS, sure=False, note=_DOUBT)

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

    name = "pcf8574a"
    rank = 5
    addresses = range(0x38, 0x40)
    package = Package("PCF8574AT/3,518", "NXP", "PCF8574A", _SOIC16, _PINS, sure=False, note=_DOUBT)


MEMBER = Pcf8574(), Pcf8574a()
