"""An I2C chip that thenar does not know: TI's TCA9534, eight pins without pull-ups, four registers.

Its package names it in pyproject.toml:

    [project.entry-points."thenar.chips"]
    tca9534 = "my_package.chip:MEMBER"
"""

from thenar.drivers.i2c.chips import Chip, ChipPackage, Device, Reading, Write, byte_pins

INPUT, OUTPUT, POLARITY, CONFIGURATION = range(4)


class Tca9534Model(Device):
    """The chip on an emulated bus: a command byte chooses a register, and the bytes after it all go there."""

    pins = 8

    def reset(self) -> None:
        """Do as after power-on."""
        self.registers, self.chosen = [0x00, 0xFF, 0x00, 0xFF], INPUT

    def write(self, data: bytes) -> None:
        """Take the bytes of one message that writes."""
        if data:
            self.chosen = data[0] & 3
        if len(data) > 1 and self.chosen != INPUT:
            self.registers[self.chosen] = data[-1]

    def read(self, length: int) -> bytes:
        """Return the bytes of one message that reads."""
        _, output, polarity, inputs = self.registers
        pins = (self.port(0) & inputs | output & ~inputs) ^ polarity
        return bytes((pins if self.chosen == INPUT else self.registers[self.chosen],)) * length


class Tca9534(Chip):
    """Pins P0 to P7, which need resistors outside. SCL up to 400 kHz."""

    name = "tca9534"
    addresses = range(0x20, 0x28)
    clock_hz = 400_000
    pins = tuple(f"P{bit}" for bit in range(8))
    readings = (Reading("P", bytes((INPUT,)), byte_pins(0)),)
    pulls_up = False
    package = ChipPackage(
        part="TCA9534PWR",
        maker="Texas Instruments",
        symbol="TCA9534",
        footprint="Package_SO:TSSOP-16_4.4x5mm_P0.65mm",
        pins=("A0", "A1", "A2", *pins[:4], "GND", *pins[4:], "INT", "SCL", "SDA", "VCC"),
    )
    model = Tca9534Model

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Make all pins inputs; a register that is read twice in one go is still the same one, as in no PCA9555."""
        return (
            Write(bytes((CONFIGURATION, 0xFF)), b"\xff\xff"),
            Write(bytes((POLARITY, 0x00)), b"\x00\x00"),
            Write(bytes((OUTPUT, 0xAA)), b"\xaa\xaa"),  # unused, and lost by a reset
        )


MEMBER = Tca9534()
