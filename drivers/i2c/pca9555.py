"""NXP PCA9555 and TI TCA9555: two ports of eight pins with pull-ups of 100 kohm, in pairs of registers."""

from .chip import Chip, Reading, Write, byte_pins

_INPUT_0, _INPUT_1, _OUTPUT, _POLARITY, _CONFIGURATION = 0, 1, 2, 4, 6

# The outputs are unused while all pins are inputs: what stands in them tells a set-up chip from one that was reset.
_SIGNATURE = b"\xaa\x55"


class Pca9555(Chip):
    """Pins P00 to P07 and P10 to P17. SCL up to 400 kHz. The byte after a port's is the other port's, always."""

    kind = "pca9555"
    addresses = range(0x20, 0x28)
    clock_hz = 400_000
    pins = tuple(f"P{port}{bit}" for port in range(2) for bit in range(8))
    readings = (
        Reading("0", bytes((_INPUT_0,)), byte_pins(0)),
        Reading("1", bytes((_INPUT_1,)), byte_pins(1)),
        Reading("01", bytes((_INPUT_0,)), byte_pins(0, 1)),
    )

    __slots__ = ()

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes that make all pins inputs, read as they are.

        The first pair is read back twice over: a chip whose pointer goes on would show other registers then.
        """
        return (
            Write(bytes((_CONFIGURATION,)) + b"\xff\xff", b"\xff\xff" * 2),
            Write(bytes((_POLARITY,)) + b"\x00\x00", b"\x00\x00"),
            Write(bytes((_OUTPUT,)) + _SIGNATURE, _SIGNATURE),
        )


class Tca9555(Pca9555):
    """TI's chip of the same registers and addresses."""

    kind = "tca9555"

    __slots__ = ()
