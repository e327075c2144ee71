"""Parts whose board firmware is a sketch for Arduino's cores: the ESP32 and the RP2040. As libraries they are packages
like others.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from .package import M0PLUS, XTENSA, Package, family
from .wired import Wired


@dataclass(frozen=True, kw_only=True)
class SketchPart(Package, Wired):
    """A part supported by one of Arduino's cores.

    converter the pins of the converter's channels, and `reference`, the voltage of its highest code
    conversion_us  the assumed time of a conversion
    arduino_core  Arduino's core, and `fqbn`, arduino-cli's name of the usual board with it
    platform  PlatformIO's platform, and `pio_board` its usual board; `pio_more` further lines of its platformio.ini
    """

    converter: Mapping[str, int]
    reference: str
    conversion_us: int
    arduino_core: str
    fqbn: str
    platform: str
    pio_board: str
    pio_more: tuple[str, ...] = ()


def _gpio(*numbers: int) -> tuple[str, ...]:
    return tuple(f"GPIO{number}" for number in numbers)


# ESP32 series datasheet: GPIO6 to GPIO11 carry the flash, 16 and 17 of a WROVER the PSRAM, 34 to 39 have no pull-ups;
# 0, 2, 12 and 15 select the boot mode. ADC2 does not convert while Wi-Fi is on. Pins of bus and UARTs are the core's
# defaults except those of UART 1, which share the flash's: any others will do, since the part has a pin matrix.
_ESP32_ADC = {"ADC1_CH0": 36, "ADC1_CH3": 39, "ADC1_CH4": 32, "ADC1_CH5": 33, "ADC1_CH6": 34, "ADC1_CH7": 35}
_ESP32 = family(
    SketchPart,
    "esp32",
    XTENSA,
    "a package for ESP-IDF, Arduino, PlatformIO, Zephyr: ESP32, S2, S3 (Xtensa), C3, C6, H2 (RISC-V); or a sketch",
    rank=31,
    flash=16 << 20,
    ram=256 << 10,
    kind="xtensa",
    pins=_gpio(4, 5, 13, 14, 16, 17, 18, 19, 21, 22, 23, 25, 26, 27, 32, 33),
    uarts=(_gpio(3, 1), _gpio(26, 27), _gpio(16, 17)),
    twi=_gpio(21, 22),
    analog={channel: f"GPIO{pin}" if pin < 34 else "" for channel, pin in _ESP32_ADC.items()},
    code_bits=12,
    wireless=True,
    converter=_ESP32_ADC,
    reference="about 3.1 V",
    conversion_us=100,
    arduino_core="arduino-esp32",
    fqbn="esp32:esp32:esp32",
    platform="espressif32",
    pio_board="esp32dev",
    tied={
        **dict.fromkeys(_gpio(0, 2, 12, 15), "it selects the boot mode"),
        **dict.fromkeys(_gpio(6, 7, 8, 9, 10, 11), "the flash uses it"),
        **dict.fromkeys(_gpio(34, 35, 36, 37, 38, 39), "it has no pull-up"),
    },
)

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
    pins=_gpio(*range(23), 26, 27, 28),
    uarts=((), _gpio(1, 0), _gpio(9, 8)),
    twi=_gpio(4, 5),
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
    tied=dict.fromkeys(_gpio(23, 24, 25, 29), "a Pico uses it itself"),
)

MEMBER = (_ESP32, _RP2040)
