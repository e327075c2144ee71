"""NXP and TI PCF8574 and PCF8574A: eight quasi-bidirectional pins, no registers, different addresses."""

from .base import Chip, ChipPackage, Device, Reading, Write, byte_pins

_SOIC16 = "Package_SO:SOIC-16W_7.5x10.3mm_P1.27mm"
_PINS = ("A0", "A1", "A2", "P0", "P1", "P2", "P3", "VSS", "P4", "P5", "P6", "P7", "INT", "SCL", "SDA", "VDD")
_DOUBT = "the body's width (7.5 mm) is not confirmed: some sellers' parts have 3.9 mm"


class LatchedModel(Device):
    """A latch for every eight pins and no registers; bytes go to the latches by turns, from the first after a START.

    A pin is high if both its latch and its external level are. It is a PCF8574 with one latch.
    """

    pins = 8
    has_registers = False

    def reset(self) -> None:
        """Reset to the state after power-on."""
        self._latches = [0xFF] * (self.pins // 8)

    def write(self, data: bytes) -> None:
        """Process the bytes of one write message."""
        for number, byte in enumerate(data):
            self._latches[number % len(self._latches)] = byte

    def read(self, length: int) -> bytes:
        """Return the bytes of one read message."""
        ports = (number % len(self._latches) for number in range(length))
        return bytes(self._latches[port] & self.port(port) for port in ports)


class Pcf8574(Chip):
    """Eight pins, P0 to P7, each with a current source of about 100 uA to the supply. SCL up to 100 kHz.

    Written bytes are the latch of the outputs; a pin is an input while its latch is 1, as after power-on.
    """

    name = "pcf8574"
    rank = 4
    tried = False  # its eight pins, at 100 kHz, take longer than the sixteen of a pcf8575
    addresses = range(0x20, 0x28)
    clock_hz = 100_000
    pins = tuple(f"P{bit}" for bit in range(8))
    readings = (Reading("P", b"", byte_pins(0)),)
    registers = False
    model = LatchedModel
    package = ChipPackage("PCF8574T/3,518", "NXP", "PCF8574", _SOIC16, _PINS, sure=False, note=_DOUBT)

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes that release all pins.

        Without registers only one test identifies the chip: all pins are driven low for two reads, and must read low.
        That is harmless for switches to ground; a switch to the supply must not be on this chip. A PCF8575 would put
        the first of the two bytes on the port that is read; a chip with registers takes it as the number of a
        read-only or missing register.
        """
        return (Write(b"\xf9\x00", b"\x00"), Write(b"\x00", b"\x00"), Write(b"\xff"))


class Pcf8574a(Pcf8574):
    """The same chip at other addresses."""

    name = "pcf8574a"
    rank = 5
    addresses = range(0x38, 0x40)
    package = ChipPackage("PCF8574AT/3,518", "NXP", "PCF8574A", _SOIC16, _PINS, sure=False, note=_DOUBT)


MEMBER = Pcf8574(), Pcf8574a()
