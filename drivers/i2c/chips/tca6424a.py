"""TI TCA6424A: three ports of eight pins without pull-ups; registers in groups of three."""

from .base import Chip, ChipPackage, Reading, Write, byte_pins, port_pins
from .pca9555 import BankedModel

_INPUT, _OUTPUT, _POLARITY, _CONFIGURATION = 0x00, 0x04, 0x08, 0x0C
_ALL_THREE = 0x80  # automatic increment, within the group

# As for the PCA9555: the outputs are unused, and a reset would not leave this value in them.
_SIGNATURE = b"\xaa\x55\x33"


class Tca6424aModel(BankedModel):
    """Groups of three registers, four apart; with bit 7 of the command the pointer wraps within its group."""

    pins, _ports, _stride = 24, 3, 4

    def _point(self, byte: int) -> None:
        self._pointer, self._moves = byte & 0xF, bool(byte & 0x80)


class Tca6424a(Chip):
    """Pins P00 to P07, P10 to P17, P20 to P27, which need external resistors. SCL up to 400 kHz."""

    name = "tca6424a"
    rank = 8
    addresses = range(0x22, 0x24)
    clock_hz = 400_000
    pins = port_pins(0, 1, 2)
    readings = (
        Reading("0", bytes((_INPUT,)), byte_pins(0)),
        Reading("1", bytes((_INPUT + 1,)), byte_pins(1)),
        Reading("2", bytes((_INPUT + 2,)), byte_pins(2)),
        Reading("01", bytes((_ALL_THREE | _INPUT,)), byte_pins(0, 1)),
        Reading("12", bytes((_ALL_THREE | _INPUT + 1,)), byte_pins(1, 2)),
        Reading("012", bytes((_ALL_THREE | _INPUT,)), byte_pins(0, 1, 2)),
    )
    pulls_up = False
    model = Tca6424aModel
    package = ChipPackage(
        part="TCA6424ARGJR",
        maker="Texas Instruments",
        symbol="TCA6424A",
        footprint="Package_DFN_QFN:QFN-32-1EP_5x5mm_P0.5mm_EP3.45x3.45mm",
        pins=(*port_pins(0, 1, 2), "GND", "ADDR", "VCCP", "RESET", "SCL", "SDA", "VCCI", "INT", "EP"),
        sure=False,
        note="the footprint's thermal pad is not confirmed: compare it with the data sheet's RGJ package",
    )

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes that make all pins inputs, read as they are; a fourth byte must be the first again."""
        return (
            Write(bytes((_ALL_THREE | _CONFIGURATION,)) + b"\xff" * 3, b"\xff" * 4),
            Write(bytes((_ALL_THREE | _POLARITY,)) + bytes(3), bytes(4)),
            Write(bytes((_ALL_THREE | _OUTPUT,)) + _SIGNATURE, _SIGNATURE + _SIGNATURE[:1]),
        )


MEMBER = Tca6424a()
