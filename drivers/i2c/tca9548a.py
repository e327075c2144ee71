"""TI TCA9548A: a mux of eight channels behind one control register. Bit c of the register connects channel c."""

from .chips.base import TSSOP24, ChipPackage, Device

ADDRESSES = range(0x70, 0x78)
CHANNELS = range(8)
CLOCK_HZ = 400_000

# Address and control byte: the cost of one selection, and of reading the register back.
SCL_PERIODS = 20

PACKAGE = ChipPackage(
    part="TCA9548APWR",
    maker="Texas Instruments",
    symbol="TCA9548APWR",
    footprint=TSSOP24,
    pins=(
        *("A0", "A1", "RESET"),
        *(f"{wire}{channel}" for channel in range(4) for wire in ("SD", "SC")),
        "GND",
        *(f"{wire}{channel}" for channel in range(4, 8) for wire in ("SD", "SC")),
        *("A2", "SCL", "SDA", "VCC"),
    ),
)


def control(channel: int | None) -> bytes:
    """Return the control byte that connects this channel alone, or none; it takes effect at the STOP."""
    return bytes((0 if channel is None else 1 << channel,))


class MuxModel(Device):
    """The mux: its control byte takes effect at the STOP."""

    pins = 0
    has_registers = False

    def reset(self) -> None:
        """Reset to the state after power-on."""
        self.control = self.connected = 0

    def write(self, data: bytes) -> None:
        """Process the bytes of one write message."""
        if data:
            self.control = data[-1]

    def read(self, length: int) -> bytes:
        """Return the bytes of one read message."""
        return bytes((self.control,)) * length

    def stop(self) -> None:
        """Process a STOP."""
        self.connected = self.control
