"""TI TCA6424A: three ports of eight pins without pull-ups; registers in groups of three."""

from .chip import Chip, Reading, Write, byte_pins

_INPUT, _OUTPUT, _POLARITY, _CONFIGURATION = 0x00, 0x04, 0x08, 0x0C
_ALL_THREE = 0x80  # automatic increment, within the group

# As for the PCA9555: the outputs are unused, and a reset would not leave this in them.
_SIGNATURE = b"\xaa\x55\x33"


class Tca6424a(Chip):
    """Pins P00 to P07, P10 to P17, P20 to P27, which need resistors outside. SCL up to 400 kHz."""

    kind = "tca6424a"
    addresses = range(0x22, 0x24)
    clock_hz = 400_000
    pins = tuple(f"P{port}{bit}" for port in range(3) for bit in range(8))
    readings = (
        Reading("0", bytes((_INPUT,)), byte_pins(0)),
        Reading("1", bytes((_INPUT + 1,)), byte_pins(1)),
        Reading("2", bytes((_INPUT + 2,)), byte_pins(2)),
        Reading("01", bytes((_ALL_THREE | _INPUT,)), byte_pins(0, 1)),
        Reading("12", bytes((_ALL_THREE | _INPUT + 1,)), byte_pins(1, 2)),
        Reading("012", bytes((_ALL_THREE | _INPUT,)), byte_pins(0, 1, 2)),
    )

    __slots__ = ()

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes that make all pins inputs, read as they are; a fourth byte must be the first again."""
        return (
            Write(bytes((_ALL_THREE | _CONFIGURATION,)) + b"\xff" * 3, b"\xff" * 4),
            Write(bytes((_ALL_THREE | _POLARITY,)) + bytes(3), bytes(4)),
            Write(bytes((_ALL_THREE | _OUTPUT,)) + _SIGNATURE, _SIGNATURE + _SIGNATURE[:1]),
        )
