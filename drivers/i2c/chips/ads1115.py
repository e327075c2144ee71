"""TI ADS1115: four channels of 15 bits, one conversion at a time, at most 860 a second (SBAS444)."""

import time
from collections.abc import Callable

from .base import ChipPackage, Conversion, Converter, ConverterModel, Write

_RESULT, _CONFIG, _LOW, _HIGH = 0, 1, 2, 3
# One conversion: start; channel against ground; 4.096 V; power down afterwards. 860 a second; no comparator.
_START, _FULL_SCALE, _SINGLE, _FASTEST, _NO_COMPARATOR = 0x8000, 0x0200, 0x0100, 0x00E0, 0x0003
_GROUND_BASED = 4
# Its oscillator is up to 10 % slow, and it needs time to wake up.
_RATE, _SLOW, _WAKE_US = 860, 0.9, 25.0
# The comparator's threshold is unused: its value distinguishes a set-up chip from one that was reset.
_SIGNATURE = b"\x55\xaa"
_DEFAULTS = (0, 0x8583, 0x8000, 0x7FFF)


class Ads1115Model(ConverterModel):
    """Four registers of 16 bits behind a pointer; the old result stays until a conversion ends."""

    pins = 64
    clock: Callable[[], float] = staticmethod(time.monotonic)

    def reset(self) -> None:
        """Reset to the state after power-on."""
        self._values: list[int] = list(_DEFAULTS)
        self._pointer, self._ready = 0, 0.0

    def write(self, data: bytes) -> None:
        """Process the bytes of one write message."""
        if data:
            self._pointer = data[0] & 3
        if len(data) > 2 and self._pointer != _RESULT:
            value = int.from_bytes(data[1:3], "big")
            if self._pointer == _CONFIG:
                self._configure(value)
            else:
                self._values[self._pointer] = value

    def read(self, length: int) -> bytes:
        """Return the bytes of one read message."""
        value = self._values[self._pointer]
        if self._pointer == _RESULT and self.clock() >= self._ready:
            value = self._values[_RESULT] = self._converted
        if self._pointer == _CONFIG:
            value = value & 0x7FFF | (0x8000 if self.clock() >= self._ready else 0)
        return (value.to_bytes(2, "big") * length)[:length]

    def poke(self, register: int, value: int) -> None:
        """Set a register to `value` without a bus write."""
        self._values[register & 3] = value

    _converted = 0

    def _configure(self, value: int) -> None:
        self._values[_CONFIG] = value
        mux = value >> 12 & 7
        if value & _START and self.clock() >= self._ready and mux >= _GROUND_BASED:  # a new one waits for the old one
            self._converted = min(self.at(mux - _GROUND_BASED), 0x7FFF)
            self._ready = self.clock() + 1 / _RATE


def _start(channel: int) -> bytes:
    word = _START | (_GROUND_BASED + channel) << 12 | _FULL_SCALE | _SINGLE | _FASTEST | _NO_COMPARATOR
    return bytes((_CONFIG,)) + word.to_bytes(2, "big")


class Ads1115(Converter):
    """Channels AIN0 to AIN3 against ground, code 32768 at 4.096 V. SCL up to 400 kHz (3.4 MHz in high-speed mode)."""

    name = "ads1115"
    rank = 20
    addresses = range(0x48, 0x4C)
    clock_hz = 400_000
    pins = tuple(f"AIN{channel}" for channel in range(4))
    bits, volts = 15, 4.096
    readings = tuple(
        Conversion(
            f"AIN{channel}",
            bytes((_RESULT,)),
            (channel,) * 16,
            start=_start(channel),
            us=round(1e6 / (_SLOW * _RATE) + _WAKE_US),
        )
        for channel in range(4)
    )
    model = Ads1115Model
    package = ChipPackage(
        part="ADS1115IDGSR",
        maker="Texas Instruments",
        symbol="ADS1115IDGS",
        footprint="Package_SO:TSSOP-10_3x3mm_P0.5mm",
        pins=("ADDR", "ALERT", "GND", "AIN0", "AIN1", "AIN2", "AIN3", "VDD", "SDA", "SCL"),
        sure=False,
        note="compare symbol and footprint (VSSOP-10) before ordering",
        straps=("low", "high", "SDA", "SCL"),
        library="Analog_ADC",
    )

    def setup(self, used: frozenset[int]) -> tuple[Write, ...]:
        """Return the writes after which it sleeps until the next conversion, with the comparator off."""
        config = int.from_bytes(_start(min(used, default=0))[1:], "big") & ~_START
        kept = config.to_bytes(2, "big")
        return (
            Write(bytes((_CONFIG,)) + kept, kept, b"\x7f\xff"),
            Write(bytes((_HIGH, 0x7F, 0xFF)), b"\x7f\xff"),
            Write(bytes((_LOW,)) + _SIGNATURE, _SIGNATURE),
        )

    def code(self, reply: bytes) -> int:
        """Return the code of a reply; a channel slightly below ground reads 0."""
        return max(0, int.from_bytes(reply, "big", signed=True))


MEMBER = Ads1115()
