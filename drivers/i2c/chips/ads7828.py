"""TI ADS7828: eight channels of 12 bits against the supply, converted within the transfer that reads them (SBAS181)."""

from .base import ChipPackage, Conversion, Converter, ConverterModel, Write

# Single-ended, converter on between conversions, internal reference off: REF is the supply.
_SINGLE, _ON = 0x80, 0x04
# Bits that it ignores; an ADS1115 at the same address interprets them as its configuration register.
_SPARE = 0x01


def _command(channel: int) -> int:
    """Return the byte that selects a channel: the odd ones follow the even ones."""
    return _SINGLE | (channel & 1) << 6 | (channel >> 1) << 4 | _ON | _SPARE


class Ads7828Model(ConverterModel):
    """No registers: the last command selects the channel that every read message converts."""

    pins = 128
    has_registers = False

    def reset(self) -> None:
        """Reset to the state after power-on."""
        self._command = 0

    def write(self, data: bytes) -> None:
        """Process the bytes of one write message."""
        if data:
            self._command = data[-1]

    def read(self, length: int) -> bytes:
        """Return the bytes of one read message."""
        channel = self._command >> 6 & 1 | (self._command >> 4 & 3) << 1
        code = min(self.at(channel), 0xFFF) if self._command & _SINGLE else 0
        return (code.to_bytes(2, "big") * length)[:length]


class Ads7828(Converter):
    """Channels CH0 to CH7 against COM, code 4096 at the supply. SCL up to 400 kHz (3.4 MHz in high-speed mode)."""

    name = "ads7828"
    rank = 21
    addresses = range(0x48, 0x4C)
    clock_hz = 400_000
    pins = tuple(f"CH{channel}" for channel in range(8))
    bits = 12
    # The second byte of a reply holds the lower eight bits, the first the upper four.
    readings = tuple(
        Conversion(f"CH{channel}", bytes((_command(channel),)), (channel,) * 4 + (-1,) * 4 + (channel,) * 8)
        for channel in range(8)
    )
    registers = False
    model = Ads7828Model
    package = ChipPackage(
        part="ADS7828E/250",
        maker="Texas Instruments",
        symbol="ADS7828",
        footprint="Package_SO:TSSOP-16_4.4x5mm_P0.65mm",
        pins=(*(f"CH{n}" for n in range(8)), "GND", "REF", "COM", "A0", "A1", "SCL", "SDA", "VDD"),
        sure=False,
        note="REF is tied to the supply, COM to ground; compare symbol and pins before ordering",
        library="Analog_ADC",
    )

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the write of a command; its reply has four zeros on top, unlike an ADS1115's configuration."""
        return (Write(bytes((_command(min(used, default=0)),)), b"\x00\x00", b"\xf0\x00"),)


MEMBER = Ads7828()
