"""Parts whose board firmware is a sketch for Arduino's cores: the RP2040, and those of `esp32`. As libraries they are
packages like others.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .package import M0PLUS, Package, family
from .wired import Wired

if TYPE_CHECKING:
    from ..example import Pins


@dataclass(frozen=True, kw_only=True)
class SketchPart(Package, Wired):
    """A part supported by one of Arduino's cores.

    converter the pins of the converter's channels, and `reference`, the voltage of its highest code
    conversion_us  the assumed time of a conversion
    arduino_core  Arduino's core, and `fqbn`, arduino-cli's name of the usual board with it
    platform  PlatformIO's platform, and `pio_board` its usual board; `pio_more` further lines of its platformio.ini
    usb       the pins of the chip's USB port, which `Serial` is where the board's settings say so; () if there is none
    """

    converter: Mapping[str, int]
    reference: str
    conversion_us: int
    arduino_core: str
    fqbn: str
    platform: str
    pio_board: str
    pio_more: tuple[str, ...] = ()
    usb: tuple[str, ...] = ()

    @property
    def example_pins(self) -> "Pins":
        """The usable pins: a channel whose pin is tied is none of them."""
        from ..example import Pins

        analog = [pin for channel, pin in self.converter.items() if self.analog[channel] not in self.tied]
        digital = [number for pin in self.pins if (number := int(pin.removeprefix("GPIO"))) not in analog]
        return Pins(self.part, tuple(digital), tuple(analog))


def gpio(*numbers: int) -> tuple[str, ...]:
    """Return the names of the pins of these numbers."""
    return tuple(f"GPIO{number}" for number in numbers)


# RP2040 datasheet, Pico W datasheet: the module uses 23, 24, 25 and 29 itself.
_RP2040_ADC = {"ADC0": 26, "ADC1": 27, "ADC2": 28}
_RP2040 = family(
    SketchPart,
    "rp2040",
    M0PLUS,
    "a package for pico-sdk, Arduino, PlatformIO, Zephyr: Raspberry Pi Pico, Cortex-M0+; or a sketch",
    rank=32,
    flash=16 << 20,
    ram=256 << 10,
    pins=gpio(*range(23), 26, 27, 28),
    uarts=((), gpio(1, 0), gpio(9, 8)),
    twi=gpio(4, 5),
    analog={channel: f"GPIO{pin}" for channel, pin in _RP2040_ADC.items()},
    code_bits=12,
    wireless=True,
    converter=_RP2040_ADC,
    reference="ADC_VREF, 3.3 V",
    conversion_us=20,
    arduino_core="arduino-pico",
    fqbn="rp2040:rp2040:rpipicow",
    platform="https://github.com/maxgerhardt/platform-raspberrypi.git",
    pio_board="rpipicow",
    pio_more=("board_build.core = earlephilhower",),
    tied=dict.fromkeys(gpio(23, 24, 25, 29), "a Pico uses it itself"),
)

MEMBER = _RP2040
