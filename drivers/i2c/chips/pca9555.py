"""NXP PCA9555 and TI TCA9555: two ports of eight pins with pull-ups of 100 kohm, in pairs of registers."""

from .base import TSSOP24, Chip, ChipPackage, Reading, RegisterModel, Write, byte_pins, pins_of_24, port_pins

_INPUT_0, _INPUT_1, _OUTPUT, _POLARITY, _CONFIGURATION = 0, 1, 2, 4, 6

# The outputs are unused while all pins are inputs: their values distinguish a set-up chip from one that was reset.
_SIGNATURE = b"\xaa\x55"


class BankedModel(RegisterModel):
    """Banks of inputs, outputs, polarities and configurations, `stride` registers apart; pins as driven externally.

    It is a PCA9555: pairs of registers 0 to 7, whose next byte belongs to the other register of the pair.
    """

    pins, _ports, _stride = 16, 2, 2

    def _point(self, byte: int) -> None:
        self._pointer = byte & 7

    def reset(self) -> None:
        """Reset to the state after power-on."""
        self._outputs = [0xFF] * self._ports
        self._polarities = [0x00] * self._ports
        self._inputs = [0xFF] * self._ports
        self._pointer = 0
        self._moves = True

    def _store(self, byte: int) -> None:
        bank, port = divmod(self._pointer, self._stride)
        if bank and port < self._ports:
            (self._outputs, self._polarities, self._inputs)[bank - 1][port] = byte

    def _advance(self) -> None:
        if self._moves:
            bank, port = divmod(self._pointer, self._stride)
            self._pointer = bank * self._stride + (port + 1) % self._ports

    def _load(self) -> int:
        bank, port = divmod(self._pointer, self._stride)
        if port >= self._ports:
            return 0
        if bank:
            return (self._outputs, self._polarities, self._inputs)[bank - 1][port]
        inputs = self._inputs[port]
        return (self.port(port) & inputs | self._outputs[port] & ~inputs & 0xFF) ^ self._polarities[port]


class Pca9555(Chip):
    """Pins P00 to P07 and P10 to P17. SCL up to 400 kHz. Bytes alternate between the two ports."""

    name = "pca9555"
    rank = 6
    addresses = range(0x20, 0x28)
    clock_hz = 400_000
    pins = port_pins(0, 1)
    readings = (
        Reading("0", bytes((_INPUT_0,)), byte_pins(0)),
        Reading("1", bytes((_INPUT_1,)), byte_pins(1)),
        Reading("01", bytes((_INPUT_0,)), byte_pins(0, 1)),
    )
    model = BankedModel
    package = ChipPackage("PCA9555PW,118", "NXP", "PCA9555PW", TSSOP24, pins_of_24("VSS", "VDD"))

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes that make all pins inputs, read as they are.

        The first pair is read back twice: a chip with an incrementing pointer would return other registers.
        """
        return (
            Write(bytes((_CONFIGURATION,)) + b"\xff\xff", b"\xff\xff" * 2),
            Write(bytes((_POLARITY,)) + b"\x00\x00", b"\x00\x00"),
            Write(bytes((_OUTPUT,)) + _SIGNATURE, _SIGNATURE),
        )


class Tca9555(Pca9555):
    """TI's chip with the same registers and addresses."""

    name = "tca9555"
    rank = 7
    tried = False
    package = ChipPackage("TCA9555PWR", "Texas Instruments", "TCA9555PWR", TSSOP24, pins_of_24("GND", "VCC"))


MEMBER = Pca9555(), Tca9555()
